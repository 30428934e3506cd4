"""A window of GGUI without a screen, to draw pictures in."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from taichi_disk.base.engine import internals, ti
from taichi_disk.base.errors import NoPictures
from taichi_disk.pictures.render import shaders

TITLE = "taichi-disk"
_MAX_RATE = 1000  # pictures per second
_PLACE = (100, 100)  # on a screen, which is not there


class Window(ti.ui.Window):
    """A window of GGUI.

    Attributes:
        is_soft: whether triangles are drawn by this package's shaders, which know the
            darkness of sides and the opacity of colours.
    """

    def __init__(self, size: tuple[int, int]) -> None:
        self.is_soft = shaders.fit_engine()
        self._folder = tempfile.TemporaryDirectory()
        if self.is_soft:
            # GGUI reads a shader when it is first used, so the folder stays.
            options = _PLACE, False, False, _MAX_RATE, self._folder.name
            shaders.copy_into(Path(self._folder.name, "shaders"))
            self.window = internals.native_window(ti, TITLE, size, *options)
        else:
            super().__init__(TITLE, size, show_window=False, fps_limit=_MAX_RATE)

    def destroy(self) -> None:
        """Destroy this window, in a temporary folder, because GGUI leaves an imgui.ini
        in the current one."""
        here = os.getcwd()
        os.chdir(self._folder.name)
        try:
            super().destroy()
        finally:
            os.chdir(here)
        self._folder.cleanup()


def open_window(size: tuple[int, int]) -> Window:
    """Return a new window of `size` (width, height) [px]. GGUI crashes if two exist:
    destroy it after use.

    Raises NoPictures if Vulkan cannot draw.
    """
    try:
        return Window(size)
    except RuntimeError as error:  # the Vulkan driver exists but does not work
        raise NoPictures(
            f"no picture: Vulkan cannot draw {size[0]} x {size[1]} pixels: {error}"
        ) from error
