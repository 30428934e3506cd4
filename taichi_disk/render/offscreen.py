"""The one window without a screen: GGUI crashes where two live. Who draws takes it, and may lose it to the next."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from typing import Any

from taichi_disk import engine
from taichi_disk.engine import ti
from taichi_disk.errors import TaichiDiskError

_taken: tuple[Any, tuple[int, int], Any] | None = None  # by whom, its size, the window
_program: Any = None  # of the engine, in which it was made


def take(holder: object, size: tuple[int, int]) -> Any:
    """The `ti.ui.Window` of `size` (width, height) [px]; it is the one that `holder` had, if nobody took it since.

    Raises TaichiDiskError where Vulkan cannot draw.
    """
    global _taken, _program
    if _taken is None or _taken[0] is not holder or _taken[1] != size or _program is not engine.program():
        give_back()
        try:
            _program = engine.program()
            _taken = holder, size, ti.ui.Window("taichi-disk", size, show_window=False)
        except RuntimeError as error:  # a Vulkan driver that is there and does not work
            raise TaichiDiskError(f"no picture: Vulkan cannot draw {size[0]} x {size[1]} pixels: {error}") from error
    return _taken[2]


def give_back(holder: object = None) -> None:
    """Destroy the window, if `holder` has it, or anybody where none is named."""
    global _taken
    if _program is not engine.program():  # the user has started the engine anew: the window has gone with the old one
        _taken = None
    if _taken and holder in (None, _taken[0]):
        with elsewhere():
            _taken[2].destroy()
        _taken = None


@contextlib.contextmanager
def elsewhere() -> Iterator[None]:
    """Work in another folder: a window that closes leaves an imgui.ini in the current one."""
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(here)
