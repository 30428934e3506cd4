"""Pictures and films of the disk: drawn on a GGUI canvas, completed with text and
curves, and encoded."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager

from taichi_disk.errors import NoPictures
from taichi_disk.machine import REMEDY


def film_problem() -> str | None:
    """Return why this machine cannot make films, with the command that helps, or None.
    Needs no `ti.init`."""
    try:
        from taichi_disk.engine import internals, ti
    except ImportError as error:
        return f"Taichi cannot be loaded ({error}); as root: {REMEDY}"
    with _silent_stderr():
        has_vulkan = internals.has_vulkan(ti)
    if not has_vulkan:
        return (
            "there is no Vulkan driver here, which draws the pictures of MP4, WebM, GIF"
            f" and PNG; as root: {REMEDY}"
        )
    return None


def require_film() -> None:
    """Raise NoPictures unless this machine can make films."""
    problem = film_problem()
    if problem:
        raise NoPictures(problem)


@contextmanager
def _silent_stderr() -> Iterator[None]:
    """Drop what libraries write to the standard error: without a driver, Taichi writes
    "RHI Error", which says no more than our message."""
    try:
        stderr = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    try:
        with open(os.devnull, "wb") as nowhere:
            os.dup2(nowhere.fileno(), 2)
        yield
    finally:
        os.dup2(stderr, 2)
        os.close(stderr)
