"""A window of GGUI, with or without a screen, to draw pictures in."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from taichi_disk.engine import program, ti
from taichi_disk.errors import NoPictures
from taichi_disk.render import shaders


class Window(ti.ui.Window):
    """A window of GGUI.

    Attributes:
        is_soft: whether triangles are drawn by this package's shaders, which know the
            darkness of sides and the opacity of colours.
    """

    def __init__(
        self,
        title: str,
        size: tuple[int, int],
        show_window: bool = True,
        fps_limit: int = 1000,
        pos: tuple[int, int] = (100, 100),
    ) -> None:
        self.is_soft = shaders.fit_engine()
        if self.is_soft:
            # GGUI reads a shader when it is first used, so the folder stays.
            self._folder = tempfile.TemporaryDirectory()
            options = pos, False, show_window, fps_limit, self._folder.name
            try:
                shaders.copy_into(Path(self._folder.name, "shaders"))
                self.window = ti._lib.core.PyWindow(
                    program(), title, size, *options, ti.cfg.arch
                )
            except (OSError, RuntimeError, TypeError):
                self._folder.cleanup()
                self.is_soft = False
        if not self.is_soft:
            super().__init__(
                title, size, show_window=show_window, fps_limit=fps_limit, pos=pos
            )

    def destroy(self) -> None:
        """Destroy this window, in a temporary folder, because GGUI leaves an imgui.ini
        in the current one."""
        with elsewhere():
            super().destroy()
        if self.is_soft:
            self._folder.cleanup()


def open_window(title: str, size: tuple[int, int], **options: Any) -> Window:
    """Return a new window of `size` (width, height) [px]. GGUI crashes if two exist:
    destroy it after use.

    Raises NoPictures if Vulkan cannot draw.
    """
    try:
        return Window(title, size, **options)
    except RuntimeError as error:  # the Vulkan driver exists but does not work
        raise NoPictures(
            f"no picture: Vulkan cannot draw {size[0]} x {size[1]} pixels: {error}"
        ) from error


@contextlib.contextmanager
def elsewhere() -> Iterator[None]:
    """Work in a temporary folder."""
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            yield
        finally:
            os.chdir(here)
