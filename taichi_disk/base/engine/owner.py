"""The thread that owns the engine: it starts it, makes fields and launches kernels.

Taichi 1.7.4 makes fields only in the thread that has called `ti.init`. That is the main
thread until another one computes. Then a thread of this module takes over for the rest
of the process, because the user's threads come and go.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, TypeVar

from taichi_disk.base import engine
from taichi_disk.base.engine.internals import own_settings
from taichi_disk.base.errors import TaichiDiskError

T = TypeVar("T")
# the program that `start` has made; the user may make others
_program: Any = None
# the process whose thread of this module has made it; 0: its main thread has
_process = 0


@lru_cache(maxsize=1)
def _thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "taichi-disk")


def _is_main() -> bool:
    return threading.current_thread() is threading.main_thread()


def must_move() -> bool:
    """Whether this thread cannot use the engine, because the main thread has started
    it. Raises TaichiDiskError if a thread has, which a forked process lacks."""
    if engine.program() is not _program:
        return False
    if _process not in (0, os.getpid()):
        raise TaichiDiskError(
            "Taichi was started by a thread of the process that forked this one, and"
            ' a fork copies no threads: start processes with the method "spawn"'
        )
    return not (_process or _is_main())


def start(init: Callable[[], None]) -> None:
    """Call `init`, which starts the engine anew."""
    global _program, _process
    _process = 0
    if _is_main():
        init()
    else:
        _process = os.getpid()
        _thread().submit(init).result()
    _program = engine.program()


def call(function: Callable[..., T], *arguments: Any) -> T:
    """Return `function(*arguments)`, called in the thread that owns the engine and with
    this package's settings."""
    with own_settings(engine.loaded()):
        if _process and engine.program() is _program:
            return _thread().submit(function, *arguments).result()
        return function(*arguments)
