"""A pool of processes that run `worker.py`."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, Future, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from pathlib import Path
from queue import SimpleQueue
from typing import Any

from taichi_disk.engine import environment
from taichi_disk.signals import ignored_by_children

WORKER = Path(__file__).with_name("worker.py")


class Pool(ThreadPoolExecutor):
    """An executor of `count` processes, each of which serves one thread at a time.

    The standard library's pool imports files of the working folder and the caller's
    script, and needs semaphores, which small containers lack (/dev/shm). This one needs
    pipes only.
    """

    def __init__(self, count: int) -> None:
        super().__init__(count)
        environment.prepare()  # workers share the cache of this process
        with ignored_by_children():
            self._processes = [_start() for _ in range(count)]
        self._free = SimpleQueue[subprocess.Popen[bytes]]()
        for process in self._processes:
            self._free.put(process)

    def submit(
        self, function: Callable[..., Any], /, *args: Any, **kwargs: Any
    ) -> Future[Any]:
        request = pickle.dumps(partial(function, *args, **kwargs))
        return super().submit(self._carry_out, request)

    def _carry_out(self, request: bytes) -> Any:
        process = self._free.get()
        try:
            _send(process, request)
            assert process.stdout is not None
            value, error = pickle.load(process.stdout)
        except (EOFError, OSError, pickle.UnpicklingError):
            raise BrokenExecutor("a process has died") from None
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


def _start() -> subprocess.Popen[bytes]:
    process = subprocess.Popen(
        [sys.executable, str(WORKER)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        # one thread for each process, so that processes do not compete for the cores
        env={"OPENBLAS_NUM_THREADS": "1", **os.environ},
    )
    with suppress(OSError):  # the process has died, and its first call will fail
        _send(process, sys.path)
    return process


def _send(process: subprocess.Popen[bytes], message: Any) -> None:
    assert process.stdin is not None
    pickle.dump(message, process.stdin)
    process.stdin.flush()
