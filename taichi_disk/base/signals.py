"""Handle Ctrl-C, SIGTERM and other signals that end a command by a flag, which the
program checks between kernel launches, frames and rows.

A handler must not raise: Taichi 1.7.4 swallows exceptions in a bare `except` while it
compiles, and an extension module that is importing another one aborts the process.
"""

from __future__ import annotations

import os
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from time import monotonic
from types import FrameType

Handler = Callable[[int, FrameType | None], object]

INTERRUPTED = 130  # exit status
# a signal repeated within this time is ignored [s]: `timeout` signals a process, then
# its group
REPEAT_TIME = 0.5
POLL_INTERVAL = 0.2  # [s] between checks for a signal while this process waits
SHOW_CURSOR = b"\x1b[?25h"  # progress bars hide the cursor

NAMES = (
    "SIGINT",
    "SIGTERM",
    "SIGQUIT",  # Ctrl-\
    "SIGUSR1",  # a job's time is nearly over (Slurm)
    "SIGHUP",  # the terminal or the connection has gone
    "SIGXCPU",  # the processor time of a job is over; comes again each second
)
ENDINGS = [number for number in signal.Signals if number.name in NAMES]

# received signals; global, because a process has one handler per signal
_pending: list[int] = []


def raise_if_interrupted() -> None:
    """Raise KeyboardInterrupt once in the main thread after a signal."""
    if _pending and threading.current_thread() is threading.main_thread():
        _pending.clear()
        raise KeyboardInterrupt


def listen() -> None:
    """Let ENDINGS set the flag, and a second signal end the process."""
    handler = _flagging(_exit)
    # Python calls handlers between two of its instructions, and SciPy meshes a large
    # lattice in one. A thread is told of signals meanwhile.
    receiver, sender = socket.socketpair()
    sender.setblocking(False)
    signal.set_wakeup_fd(sender.detach(), warn_on_full_buffer=False)
    threading.Thread(target=_watch, args=(receiver,), daemon=True).start()
    for number in ENDINGS:
        is_by_nohup = (
            number.name == "SIGHUP" and signal.getsignal(number) == signal.SIG_IGN
        )
        if not is_by_nohup:
            signal.signal(number, handler)


def _watch(receiver: socket.socket) -> None:
    """End the process at the second signal."""
    first = inf
    while True:
        number = receiver.recv(1)[0]
        if number not in ENDINGS:
            continue
        if first == inf:
            first = monotonic()
        elif _is_second(number, first):
            _exit(number, None)


@contextmanager
def deferred_interrupts() -> Iterator[None]:
    """Make Ctrl-C set the flag instead of raising KeyboardInterrupt while the block
    runs; a second Ctrl-C raises."""
    default = signal.default_int_handler
    if (
        threading.current_thread() is not threading.main_thread()
        or signal.getsignal(signal.SIGINT) is not default
    ):
        yield
        return
    signal.signal(signal.SIGINT, _flagging(default))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, default)
        raise_if_interrupted()


def _flagging(second: Handler) -> Handler:
    first = inf

    def handler(number: int, frame: FrameType | None) -> None:
        nonlocal first
        if first == inf:
            first = monotonic()
            _pending.append(number)
        elif _is_second(number, first):
            second(number, frame)

    return handler


def _is_second(number: int, first: float) -> bool:
    """Return whether a signal asks again, after the `first` time [s], for an end."""
    is_limit = signal.Signals(number).name == "SIGXCPU"
    return monotonic() > first + REPEAT_TIME and not is_limit


def _exit(number: int, frame: FrameType | None) -> None:
    if os.isatty(2):
        os.write(2, SHOW_CURSOR)
    os._exit(INTERRUPTED)


@contextmanager
def ignored_by_children() -> Iterator[None]:
    """Start processes that ignore ENDINGS while the block runs, so that only the parent
    handles signals to the whole group."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, ENDINGS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
