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
from functools import lru_cache, wraps
from inspect import unwrap
from typing import Any, TypeVar

from taichi_disk.base import engine
from taichi_disk.base.engine.internals import has_declared_fields, own_settings
from taichi_disk.base.errors import TaichiDiskError

T = TypeVar("T")
# the program that `start` has made; the user may make others
_program: Any = None
# the process in which this module's thread has made it; 0: a main thread has made it
_process = 0
# whether the user has made fields since `start`
_has_user_fields = False
THREAD = "taichi-disk"


@lru_cache(maxsize=1)
def _thread() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(1, THREAD)


def _is_main() -> bool:
    return threading.current_thread() is threading.main_thread()


def must_move() -> bool:
    """Whether this thread cannot use the engine, because the main thread has started
    it. Raises TaichiDiskError if the engine has fields of the user's, which another
    start frees, or if a thread has started it, which a forked process lacks."""
    if engine.program() is not _program:
        return False
    if _process not in (0, os.getpid()):
        raise TaichiDiskError(
            "Taichi was started by a thread of the process that forked this one, and"
            ' a fork copies no threads: start processes with the method "spawn"'
        )
    if _process or _is_main():
        return False
    if _has_user_fields or has_declared_fields(engine.loaded()):
        raise TaichiDiskError(
            "Taichi computes in the main thread, where it holds fields of yours, which"
            " a start in this thread would free: compute in the main thread, or make"
            " the first run of the process in another thread"
        )
    return True


def start(init: Callable[[], None]) -> None:
    """Call `init`, which starts the engine anew."""
    global _program, _process, _has_user_fields
    _process = 0
    if _is_main():
        init()
    else:
        _process = os.getpid()
        _thread().submit(init).result()
    _program = engine.program()
    _share(engine.loaded())
    _has_user_fields = False


@lru_cache(maxsize=1)
def _share(ti: Any) -> None:
    """Let the engine make the user's fields in the thread that owns it, whichever
    thread needs them."""
    finalize = ti.FieldsBuilder.finalize

    @wraps(finalize)
    def carried(builder: Any, raise_warning: bool = True) -> Any:
        global _has_user_fields
        _has_user_fields = _has_user_fields or not builder.empty
        return _carry_out(finalize, builder, raise_warning)

    ti.FieldsBuilder.finalize = carried


def make_fields(builder: Any) -> None:
    """Make the fields that were declared in `builder`. Raises TaichiDiskError in a
    thread in which the engine cannot."""
    try:
        call(unwrap(type(builder).finalize), builder)
    except RuntimeError as error:
        if "main_thread_id" not in str(error):
            raise
        raise TaichiDiskError(
            "Taichi makes fields only in the thread that has called ti.init: compute in"
            " that thread, or leave your ti.init out"
        ) from None


def call(function: Callable[..., T], *arguments: Any) -> T:
    """Return `function(*arguments)`, called in the thread that owns the engine and with
    this package's settings."""
    with own_settings(engine.loaded()):
        return _carry_out(function, *arguments)


def _carry_out(function: Callable[..., T], *arguments: Any) -> T:
    """Return `function(*arguments)`, called in the thread that owns the engine."""
    is_owned = _process and engine.program() is _program
    if is_owned and not threading.current_thread().name.startswith(THREAD):
        return _thread().submit(function, *arguments).result()
    return function(*arguments)
