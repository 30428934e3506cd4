"""A pool of processes that run `worker.py`."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from taichi_disk.engine import environment
from taichi_disk.signals import ignored_by_children

WORKER = Path(__file__).with_name("worker.py")


class Pool(Executor):
    """An executor of `count` processes.

    The standard library's pool imports files of the working folder and the caller's
    script, and needs semaphores, which small containers lack (/dev/shm). This one needs
    pipes only.
    """

    def __init__(self, count: int) -> None:
        environment.prepare()  # workers share the cache of this process
        self._processes: list[subprocess.Popen[bytes]] = []
        self._idle = SimpleQueue[subprocess.Popen[bytes]]()
        self._threads = ThreadPoolExecutor(count)
        try:
            with ignored_by_children():
                for _ in range(count):
                    self._processes.append(_start())
        except OSError:
            self.kill()
            raise
        for process in self._processes:
            self._idle.put(process)

    def submit(
        self, function: Callable[..., Any], /, *args: Any, **kwargs: Any
    ) -> Future[Any]:
        assert not kwargs
        request = pickle.dumps((function, args))
        return self._threads.submit(self._carry_out, request)

    def _carry_out(self, request: bytes) -> Any:
        process = self._idle.get()
        try:
            value, error = _ask(process, request)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise BrokenExecutor("a process has died") from None
        finally:
            self._idle.put(process)
        if error is not None:
            raise error
        return value

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes, which save their compiled kernels first."""
        self._threads.shutdown(wait, cancel_futures=cancel_futures)
        for process in self._processes:
            with suppress(OSError):  # it has died
                _send(process, None)
        for process in self._processes:
            process.wait()
            _close(process)

    def kill(self) -> None:
        """End the processes at once."""
        for process in self._processes:
            process.kill()
        self._threads.shutdown(cancel_futures=True)
        for process in self._processes:
            process.wait()
            _close(process)


def _start() -> subprocess.Popen[bytes]:
    # one thread for each process: they compute at the same time
    variables = {"OPENBLAS_NUM_THREADS": "1"} | os.environ
    process = subprocess.Popen(
        [sys.executable, str(WORKER)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env=variables,
    )
    with suppress(OSError):  # it has died, which the first call will show
        _send(process, sys.path)
    return process


def _ask(process: subprocess.Popen[bytes], request: bytes) -> tuple[Any, Any]:
    _send(process, request)
    assert process.stdout is not None
    value, error = pickle.load(process.stdout)
    return value, error


def _send(process: subprocess.Popen[bytes], message: Any) -> None:
    assert process.stdin is not None
    pickle.dump(message, process.stdin)
    process.stdin.flush()


def _close(process: subprocess.Popen[bytes]) -> None:
    for stream in (process.stdin, process.stdout):
        assert stream is not None
        with suppress(OSError):
            stream.close()
