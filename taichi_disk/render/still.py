"""From positions to the pixels of a finished picture, without a screen."""

import os
import tempfile
from types import TracebackType

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.errors import TaichiDiskError
from taichi_disk.render.layout import Layout
from taichi_disk.render.painter import Painter
from taichi_disk.render.picture import Frame, Subject

_Sample = ti.types.vector(4, ti.f32)


class Stills:
    """Makes pictures of one subject. A context manager: it holds a window, of which only one may be alive.

    GGUI has no antialiasing, so the stage is drawn 3/2 as large and averaged down: nearly as smooth as 2
    (a pixel's four samples have different weights), for two thirds of the time.
    """

    def __init__(self, subject: Subject, size: int, changing_lines: int) -> None:
        """`size`: width and height in pixels, even; `changing_lines`: how many lines of text frames have."""
        self._layout = Layout(subject, size, changing_lines)
        self.camera = camera = self._layout.camera
        self._picture = np.zeros((size, size, 4), dtype=np.uint8)
        self._picture[..., :3] = self._layout.still
        self._stage_rows = self._picture.view(np.uint32)[camera.top : camera.top + camera.height, :, 0]
        self._painter = Painter(subject, camera, self._layout.unit)
        large = 3 * camera.width // 2, 3 * camera.height // 2
        try:
            self._window = ti.ui.Window("taichi-disk", large, show_window=False)
        except RuntimeError as error:  # a Vulkan driver that is there and does not work
            self._painter.destroy()
            raise TaichiDiskError(f"no film: Vulkan cannot draw {large[0]} x {large[1]} pixels: {error}") from error
        self._canvas = self._window.get_canvas()

    def draw(self, frame: Frame) -> NDArray[np.uint8]:
        """The picture (size, size, 4) of a frame, rows downwards: red, green, blue and an unused byte.

        The next call overwrites it. Raises SimulationError if a position is not finite.
        """
        frame.require_finite()
        self._painter.paint(self._canvas, frame.positions)
        _shrink(self._window.get_image_buffer_as_numpy(), self._stage_rows, self.camera.left)
        self._layout.write(self._picture, frame.text)
        return self._picture

    def close(self) -> None:
        """Close the window and free the fields."""
        here = os.getcwd()
        with tempfile.TemporaryDirectory() as elsewhere:
            # A window that closes leaves an imgui.ini in the current folder.
            os.chdir(elsewhere)
            try:
                self._window.destroy()
            finally:
                os.chdir(here)
        self._painter.destroy()

    def __enter__(self) -> "Stills":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


@ti.func
def _packed(colour: _Sample) -> ti.u32:  # type: ignore[valid-type]
    """Red, green and blue of 0..255 in the three low bytes, rounded."""
    v = ti.cast(colour + ti.cast(0.5, ti.f32), ti.u32)
    return v[0] | (v[1] << 8) | (v[2] << 16)


@ti.kernel
def _shrink(
    drawn: ti.types.ndarray(dtype=_Sample, ndim=2),  # type: ignore[valid-type]
    picture: ti.types.ndarray(dtype=ti.u32, ndim=2),  # type: ignore[valid-type]
    first: ti.i32,
):
    """Average 3 x 3 samples [x, y upwards] over the 2 x 2 pixels that they cover.

    `picture` [row downwards, column]: as high as what was drawn; its columns from `first` on are filled.
    """
    # A pixel covers one sample wholly, two by half and one by a quarter.
    k = ti.cast(255.0 / 9.0, ti.f32)
    for x in range(drawn.shape[0] // 3):
        for y in range(drawn.shape[1] // 3):
            i, j = 3 * x, 3 * y
            row, column = picture.shape[0] - 1 - 2 * y, first + 2 * x
            middle = drawn[i + 1, j + 1]
            left, right = drawn[i, j + 1], drawn[i + 2, j + 1]
            below, above = drawn[i + 1, j], drawn[i + 1, j + 2]
            picture[row, column] = _packed(k * (4 * drawn[i, j] + 2 * (left + below) + middle))
            picture[row, column + 1] = _packed(k * (4 * drawn[i + 2, j] + 2 * (right + below) + middle))
            picture[row - 1, column] = _packed(k * (4 * drawn[i, j + 2] + 2 * (left + above) + middle))
            picture[row - 1, column + 1] = _packed(k * (4 * drawn[i + 2, j + 2] + 2 * (right + above) + middle))
