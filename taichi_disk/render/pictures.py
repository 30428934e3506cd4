"""From states to the pixels of finished pictures, without a screen."""

from __future__ import annotations

import contextlib
import os
import tempfile
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.errors import TaichiDiskError
from taichi_disk.lattice import Array
from taichi_disk.render import kernels
from taichi_disk.render.camera import Camera, View
from taichi_disk.render.legend import Legend
from taichi_disk.render.panel import Panel
from taichi_disk.render.video import Picture

_MARGIN = 8.0  # around the view: pixels in a picture of 720


class Pictures:
    """Makes pictures of one disk, or of several side by side, with a panel of curves at the right if wanted.

    It holds a window until it is closed, and only one may be alive. `draw` needs the thread that made it; `finish` may
    run in another while the next picture is drawn.

    Attributes:
        width: of a picture [px].
    """

    def __init__(
        self, legends: Sequence[Legend], size: int, view: View, supersample: float, panel: Panel | None = None
    ) -> None:
        """`size`: of the picture of one disk [px], even; `supersample`: samples across a pixel, 1, 1.5 or 2."""
        self._legends, self._size, self._samples, self._panel = legends, size, round(2 * supersample), panel
        # Side by side all disks lie at the same height: below the longest title.
        header, self._bottom = max(legend.header for legend in legends), size - legends[0].footer
        self._unit = legends[0].unit * supersample
        width, height = round(size * supersample), round((self._bottom - header) * supersample)
        margin = _MARGIN * self._unit
        # Beside the view there is nothing but ground and rigid wall: columns there repeat the last one that is drawn.
        seen = 2.0 * margin + Camera.fit(view, width, height, margin).scale * (view[1] - view[0])
        self._beside = int((width - seen) / (2.0 * supersample))
        drawn = round((size - 2 * self._beside) * supersample), height
        self._camera = Camera.fit(view, *drawn, margin)
        parts = [legend.still(self._camera.scale / supersample) for legend in legends]
        self._blank = np.concatenate([*parts, panel.full] if panel else parts, axis=1)
        self.width = self._blank.shape[1]
        try:
            self._window = ti.ui.Window("taichi-disk", drawn, show_window=False)
        except RuntimeError as error:  # a Vulkan driver that is there and does not work
            raise TaichiDiskError(f"no film: Vulkan cannot draw {drawn[0]} x {drawn[1]} pixels: {error}") from error

    def draw(self, states: Sequence[tuple[float, Array, Array]]) -> Picture:
        """A picture (size, width, 3), rows downwards, with (t, x, v) of each disk and without its changing text."""
        picture = self._blank.copy()
        for k, (legend, (_, x, v)) in enumerate(zip(self._legends, states, strict=True)):
            legend.painter.paint(self._window.get_canvas(), self._camera, x, v, self._unit)
            left, drawn = k * self._size + self._beside, read_back(self._window)
            kernels.shrink(drawn, picture, left, self._bottom, self._beside, self._samples)
        return picture

    def finish(self, picture: Picture, lines: Sequence[Sequence[str]], t: float) -> Picture:
        """Draw the changing `lines` of each disk, and the panel's curves up to `t` [R/c], into `picture`."""
        for k, legend in enumerate(self._legends):
            legend.write(picture[:, k * self._size : (k + 1) * self._size], lines[k])
        if self._panel:
            self._panel.draw(picture[:, len(self._legends) * self._size :], t)
        return picture

    def close(self) -> None:
        with elsewhere():
            self._window.destroy()


def read_back(window: Any) -> NDArray[np.float32]:
    """(columns, rows upwards, 4) what has been drawn on a `ti.ui.Window`, 0 to 1."""
    image: NDArray[np.float32] = window.get_image_buffer_as_numpy()
    return image


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
