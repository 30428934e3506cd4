"""Interrupts by Ctrl-C and SIGTERM. They set a flag, which the program checks between kernel launches, frames and rows.

A handler must not raise: Taichi 1.7.4 swallows exceptions in a bare `except` while it compiles, and an extension module
that is importing another one aborts the process.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from math import inf
from time import monotonic
from types import FrameType
from typing import Any, TypeVar

T = TypeVar("T")
Handler = Callable[[int, FrameType | None], object]

INTERRUPTED = 130  # exit status
REPEAT_TIME = 0.5  # [s]; a repeated signal is ignored: `timeout` signals the process and then its group
POLL_INTERVAL = 0.2  # [s] between checks for a signal during a long call
SHOW_CURSOR = b"\x1b[?25h"  # progress bars hide the cursor

_pending: list[int] = []  # signals received; global, because a process has one handler per signal


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt once in the main thread after a signal."""
    if _pending and threading.current_thread() is threading.main_thread():
        _pending.clear()
        raise KeyboardInterrupt


def interruptible(function: Callable[..., T], *arguments: Any) -> T:
    """Return what `function` returns, or raise KeyboardInterrupt after a signal without waiting for its end.

    The function runs in a thread of its own, because a long call of SciPy cannot be interrupted.
    """
    if threading.current_thread() is not threading.main_thread():
        return function(*arguments)
    future = Future[T]()

    def work() -> None:
        try:
            future.set_result(function(*arguments))
        except BaseException as error:
            future.set_exception(error)

    thread = threading.Thread(target=work, daemon=True)
    thread.start()
    while thread.is_alive():
        thread.join(POLL_INTERVAL)
        raise_if_interrupted()
    return future.result()


def listen() -> None:
    """Let SIGINT and SIGTERM set the flag, and a second signal end the process."""
    handler = _flagging(_exit)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Context in which Ctrl-C sets the flag instead of raising KeyboardInterrupt; a second Ctrl-C raises it."""
    default = signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is not default:
        yield
        return
    signal.signal(signal.SIGINT, _flagging(default))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, default)
        raise_if_interrupted()


def _flagging(second: Handler) -> Handler:
    """Return a handler that sets the flag and passes later signals to `second`."""
    first = inf

    def handler(number: int, frame: FrameType | None) -> None:
        nonlocal first
        if first == inf:
            first = monotonic()
            _pending.append(number)
        elif monotonic() > first + REPEAT_TIME:
            second(number, frame)

    return handler


def _exit(number: int, frame: FrameType | None) -> None:
    if os.isatty(2):
        os.write(2, SHOW_CURSOR)
    os._exit(INTERRUPTED)


@contextmanager
def ignored_by_children() -> Iterator[None]:
    """Context in which started processes inherit a mask that blocks Ctrl-C, so that only the parent handles it."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
