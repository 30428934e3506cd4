"""One run at a time in a folder: a lock that ends with the process that holds it, however it ends."""

from __future__ import annotations

import contextlib
import fcntl
import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class FolderLock:
    """The right to write into a folder.

    Attributes:
        sure: whether the file system knows locks; if not, another run may be at work all the same.
    """

    place: Path
    handle: int
    sure: bool

    @classmethod
    def acquire(cls, folder: Path) -> FolderLock | None:
        """The lock of a folder; None while another run holds it. Raises OSError."""
        place = folder / ".lock"
        while True:
            handle, sure = os.open(place, os.O_RDWR | os.O_CREAT, 0o666), True
            try:
                fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                os.close(handle)
                return None
            except OSError:
                sure = False
            # A run that ends removes the file: it may have done so since the file was opened.
            with contextlib.suppress(FileNotFoundError):
                if os.path.samestat(os.fstat(handle), os.stat(place)):
                    return cls(place, handle, sure)
            os.close(handle)

    def release(self) -> None:
        with contextlib.suppress(OSError):
            self.place.unlink()
        os.close(self.handle)


@contextlib.contextmanager
def signals_wait() -> Iterator[None]:
    """Let Ctrl-C, SIGTERM and timers wait until the block is done. (Only the main thread gets them at all.)"""
    came: dict[int, Any] = {}
    before = {}
    with contextlib.suppress(ValueError):  # not the main thread
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGALRM):
            before[number] = signal.signal(number, came.setdefault)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        for again in came:
            signal.raise_signal(again)
