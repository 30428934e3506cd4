"""A window of GGUI, with or without a screen, to draw pictures in."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from typing import Any

from taichi_disk.engine import ti
from taichi_disk.errors import TaichiDiskError


def open_window(title: str, size: tuple[int, int], **options: Any) -> Any:
    """Return a new `ti.ui.Window` of `size` (width, height) [px]. GGUI crashes if two
    exist: destroy it after use.

    Raises TaichiDiskError if Vulkan cannot draw.
    """
    try:
        return ti.ui.Window(title, size, **options)
    except RuntimeError as error:  # the Vulkan driver exists but does not work
        raise TaichiDiskError(
            f"no picture: Vulkan cannot draw {size[0]} x {size[1]} pixels: {error}"
        ) from error


@contextlib.contextmanager
def elsewhere() -> Iterator[None]:
    """Work in a temporary folder, because closing a window leaves an imgui.ini in the
    current folder."""
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(here)
