"""A pool of processes that run `worker.py`."""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor, wait
from contextlib import suppress
from functools import partial
from math import inf
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from time import monotonic
from typing import Any

from taichi_disk.base.engine import environment
from taichi_disk.base.machine import can_start_python
from taichi_disk.base.signals import (
    POLL_INTERVAL,
    ignored_by_children,
    raise_if_interrupted,
)

REAPING_TIME = 2.0  # [s] after which an ended process has an exit status
WORKER = Path(__file__).with_name("worker.py")


class Pool(ThreadPoolExecutor):
    """An executor of `count` processes, each of which serves one thread at a time. If
    no Python can be started, calls are carried out here while they are submitted.

    The standard library's pool imports files of the working folder and the caller's
    script, and needs semaphores, which small containers lack (/dev/shm). This one needs
    pipes only.
    """

    def __init__(self, count: int, memory: int = 0) -> None:
        """`memory`: limit of each process [bytes]; 0: none."""
        super().__init__(count)
        self.count = count
        environment.prepare()  # workers share the cache of this process
        self._processes = []
        if can_start_python():
            with ignored_by_children():
                self._processes = [_start(memory) for _ in range(count)]
        self._free = SimpleQueue[subprocess.Popen[bytes]]()
        for process in self._processes:
            self._free.put(process)

    def submit(
        self, function: Callable[..., Any], /, *args: Any, **kwargs: Any
    ) -> Future[Any]:
        call = partial(function, *args, **kwargs)
        if not self._processes:
            future: Future[Any] = Future()
            _fulfil(future, call)
            return future
        return super().submit(self._carry_out, pickle.dumps(call))

    def _carry_out(self, request: bytes) -> Any:
        process = self._free.get()
        try:
            _send(process, request)
            assert process.stdout is not None
            value, error = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise BrokenExecutor(_end(process)) from None
        finally:
            self._free.put(process)
        if error is not None:
            raise error
        return value

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, which save their compiled kernels first."""
        super().shutdown(wait, cancel_futures=cancel_futures)
        for process in self._processes:
            with suppress(OSError, ValueError):  # it has died, or ended
                _send(process, None)
        for process in self._processes:
            process.communicate()

    def kill(self) -> None:
        """End the processes at once."""
        for process in self._processes:
            process.kill()
        self.shutdown(cancel_futures=True)

    def __exit__(self, *error: Any) -> None:
        if error[0] is None:
            self.shutdown()
        else:
            self.kill()


def _fulfil(future: Future[Any], call: Callable[[], Any]) -> None:
    try:
        future.set_result(call())
    except Exception as error:
        future.set_exception(error)


def awaited(call: Callable[[], Any], limit: float = inf) -> Any:
    """Return what `call` returns in another thread, and serve signals meanwhile. Raises
    TimeoutError after `limit` [s]; nobody waits for the thread then."""
    future: Future[Any] = Future()
    Thread(target=_fulfil, args=(future, call), daemon=True).start()
    return result_of(future, limit)


def result_of(future: Future[Any], limit: float = inf) -> Any:
    """Return the result of a future, and serve signals meanwhile. Raises TimeoutError
    after `limit` [s]."""
    until = monotonic() + limit
    while not future.done():
        if monotonic() >= until:
            raise TimeoutError  # before Python 3.11 futures raise another one
        raise_if_interrupted()
        wait([future], POLL_INTERVAL)
    return future.result()


def _end(process: subprocess.Popen[bytes]) -> str:
    """Return how a process ended that does not answer any more."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(REAPING_TIME)
    code = process.returncode
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit status {code}"


def _start(memory: int) -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        [sys.executable, str(WORKER), str(memory)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # One thread for each process, so that processes do not compete for the cores.
        # They draw into files; the user's backend may need a display or not exist.
        env={"OPENBLAS_NUM_THREADS": "1", **os.environ, "MPLBACKEND": "agg"},
    )
    with suppress(OSError):  # the process has died, and its first call will fail
        _send(process, sys.path)
    return process


def _send(process: subprocess.Popen[bytes], message: Any) -> None:
    assert process.stdin is not None
    pickle.dump(message, process.stdin)
    process.stdin.flush()
