"""Ctrl-C and SIGTERM as KeyboardInterrupt, also where a library swallows the first.

Taichi 1.7.4 inspects the stack inside a bare `except`: a KeyboardInterrupt that falls there is lost, or comes out as
an error of Taichi's. So it is raised again every second until somebody has said that it was heard, and an error that
comes before is taken for the interrupt that it is.
"""

from __future__ import annotations

import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

AGAIN = 1.0  # [s]
ENDING = (signal.SIGINT, signal.SIGTERM)


class Interrupted(KeyboardInterrupt):
    """A KeyboardInterrupt after which the program chooses its exit status.

    Python's own, where it falls into text given to `exec` (so dataclasses and named tuples are made), is remembered by
    CPython even if it is caught: `python -m` then ends by SIGINT (`run_eval_code_obj`, which asks for this very class).
    """


def heard() -> None:
    """An interrupt has been taken up: do not raise it again. To be called first thing where one is handled."""
    signal.setitimer(signal.ITIMER_REAL, 0.0)


@contextmanager
def interrupts() -> Iterator[None]:
    """Within, SIGINT and SIGTERM raise Interrupted in the main thread."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = {number: signal.signal(number, _interrupt) for number in (*ENDING, signal.SIGALRM)}
    told = sys.unraisablehook

    def unraisable(what: sys.UnraisableHookArgs) -> None:
        # An interrupt that falls into a callback which cannot raise comes again: it is not worth a traceback.
        if not isinstance(what.exc_value, Interrupted):
            told(what)

    sys.unraisablehook = unraisable
    try:
        yield
    except Exception as error:
        if signal.getitimer(signal.ITIMER_REAL)[0] > 0.0:  # not heard yet
            raise Interrupted from error
        raise
    finally:
        heard()
        for number, handler in before.items():
            signal.signal(number, handler)
        sys.unraisablehook = told


@contextmanager
def signals_wait() -> Iterator[None]:
    """Let Ctrl-C, SIGTERM and timers wait until the block is done. (Only the main thread gets them at all.)"""
    came: dict[int, Any] = {}
    before = {}
    with suppress(ValueError):  # not the main thread
        for number in (*ENDING, signal.SIGALRM):
            before[number] = signal.signal(number, came.setdefault)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for again in came:
            signal.raise_signal(again)


def ignore() -> None:
    """The exit status is decided: signals change nothing while Python ends."""
    for number in ENDING:
        signal.signal(number, signal.SIG_IGN)


def _interrupt(number: int, frame: FrameType | None) -> None:
    signal.setitimer(signal.ITIMER_REAL, AGAIN)
    raise Interrupted
