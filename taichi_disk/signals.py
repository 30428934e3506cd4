"""Ctrl-C and SIGTERM set a flag, which is read where a program can stop: between kernel launches, frames, rows.

A handler that raises would do so between any two bytecodes: Taichi 1.7.4 swallows that in a bare `except` while it
compiles, and an extension module that is just importing another one aborts the process.
"""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from time import monotonic
from types import FrameType

Handler = Callable[[int, FrameType | None], object]

INTERRUPTED = 130  # exit status
AT_ONCE = 0.5  # [s] within which two signals are one: `timeout` sends its to the process, and again to its group
SHOW_CURSOR = b"\x1b[?25h"  # a bar hides it

_unread: list[int] = []  # signals that have come; a process has one place for them, as it has one handler


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt, once, in the main thread, if a signal has come."""
    if _unread and threading.current_thread() is threading.main_thread():
        _unread.clear()
        raise KeyboardInterrupt


def listen() -> None:
    """From now on SIGINT and SIGTERM set the flag, and a second one ends the process at once."""
    handler = _flagging(_end)
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, handler)


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Within, Ctrl-C sets the flag where Python would raise KeyboardInterrupt; a second one is raised at once."""
    usual = signal.default_int_handler
    if threading.current_thread() is not threading.main_thread() or signal.getsignal(signal.SIGINT) is not usual:
        yield
        return
    signal.signal(signal.SIGINT, _flagging(usual))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, usual)
        raise_if_interrupted()


def _flagging(second: Handler) -> Handler:
    """A handler that sets the flag, and leaves a second signal to another one."""
    first = inf

    def handler(number: int, frame: FrameType | None) -> None:
        nonlocal first
        if first == inf:
            first = monotonic()
            _unread.append(number)
        elif monotonic() > first + AT_ONCE:
            second(number, frame)

    return handler


def _end(number: int, frame: FrameType | None) -> None:
    if os.isatty(2):
        os.write(2, SHOW_CURSOR)
    os._exit(INTERRUPTED)


@contextmanager
def ignored_by_children() -> Iterator[None]:
    """Processes that are started within hear no Ctrl-C, which is their parent's to handle: they inherit the mask."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
