"""The thread that owns the engine: it starts it, makes fields and launches kernels.

Taichi 1.7.4 makes fields only in the thread that has called `ti.init`. That is the main
thread until another one computes. Then a thread of this module takes over for the rest
of the process, because the user's threads come and go.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import lru_cache
from typing import Any, TypeVar

from taichi_disk import engine

T = TypeVar("T")
# the program that `start` has made; the user may make others
_program: Any = None
_is_elsewhere = False  # whether the thread of this module has made it


@lru_cache(maxsize=1)
def _thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, "taichi-disk")


def _is_main() -> bool:
    return threading.current_thread() is threading.main_thread()


def must_move() -> bool:
    """Whether this thread cannot use the engine, because the main thread has started
    it."""
    is_ours = engine.program() is _program
    return is_ours and not (_is_elsewhere or _is_main())


def start(init: Callable[[], None]) -> None:
    """Call `init`, which starts the engine anew."""
    global _program, _is_elsewhere
    if _is_main():
        init()
    else:
        _thread().submit(init).result()
    _is_elsewhere = not _is_main()
    _program = engine.program()


def call(function: Callable[..., T], *arguments: Any) -> T:
    """Return `function(*arguments)`, called in the thread that owns the engine."""
    if _is_elsewhere and engine.program() is _program:
        return _thread().submit(function, *arguments).result()
    return function(*arguments)
