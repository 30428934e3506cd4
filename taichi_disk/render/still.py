"""From positions to the pixels of a finished picture, without a screen."""

from types import TracebackType

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.render.layout import Layout
from taichi_disk.render.painter import Painter
from taichi_disk.render.picture import Frame, Subject

# GGUI has no antialiasing: the stage is drawn this much larger and averaged down. 3/2 smooths nearly as well
# as 2 (a pixel's four samples have different weights) and takes two thirds of the time.
_OVERSIZE = 1.5


class Stills:
    """Makes pictures of one subject. A context manager: it holds a window, of which only one may be alive.

    The picture returned by `draw` is overwritten by the next call.
    """

    def __init__(self, subject: Subject, size: int, changing_lines: int) -> None:
        """`size`: width and height in pixels, even; `changing_lines`: how many lines of text frames have."""
        self._layout = Layout(subject, size, changing_lines)
        self.camera = camera = self._layout.camera
        self._picture = self._layout.still.copy()
        large = round(_OVERSIZE * camera.width), round(_OVERSIZE * camera.height)
        self._columns, self._rows = _taps(camera.width), _taps(camera.height)
        self._painter = Painter(subject, camera, self._layout.unit)
        self._window = ti.ui.Window("taichi-disk", large, show_window=False)
        self._canvas = self._window.get_canvas()

    def draw(self, frame: Frame) -> NDArray[np.uint8]:
        """The picture (size, size, 3) of a frame, rows downwards. Raises SimulationError at a NaN."""
        frame.require_finite()
        self._painter.paint(self._canvas, frame.positions)
        drawn = self._window.get_image_buffer_as_numpy()
        _shrink(drawn, *self._columns, *self._rows, self._picture[self.camera.top :])
        self._layout.write(self._picture, frame.text)
        return self._picture

    def close(self) -> None:
        """Close the window and free the fields."""
        self._window.destroy()
        self._painter.destroy()

    def __enter__(self) -> "Stills":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def _taps(pixels: int) -> tuple[NDArray[np.int32], NDArray[np.float32]]:
    """For each pixel the first of the two samples it covers, and that one's weight (its covered share)."""
    start = _OVERSIZE * np.arange(pixels)
    first = np.floor(start).astype(np.int32)
    return first, ((first + 1 - start) / _OVERSIZE).astype(np.float32)


@ti.kernel
def _shrink(
    drawn: ti.types.ndarray(dtype=ti.f32, ndim=3),  # type: ignore[valid-type]
    column: ti.types.ndarray(dtype=ti.i32, ndim=1),  # type: ignore[valid-type]
    column_weight: ti.types.ndarray(dtype=ti.f32, ndim=1),  # type: ignore[valid-type]
    row: ti.types.ndarray(dtype=ti.i32, ndim=1),  # type: ignore[valid-type]
    row_weight: ti.types.ndarray(dtype=ti.f32, ndim=1),  # type: ignore[valid-type]
    picture: ti.types.ndarray(dtype=ti.u8, ndim=3),  # type: ignore[valid-type]
):
    """Average the drawn samples [x, y upwards] into the upper rows of a picture [row downwards, column]."""
    for x in column:
        i, u = column[x], column_weight[x]
        for y in range(row.shape[0]):
            j, v = row[y], row_weight[y]
            for c in ti.static(range(3)):
                low = u * drawn[i, j, c] + (1 - u) * drawn[i + 1, j, c]
                high = u * drawn[i, j + 1, c] + (1 - u) * drawn[i + 1, j + 1, c]
                mean = v * low + (1 - v) * high
                picture[row.shape[0] - 1 - y, x, c] = ti.cast(255 * mean + 0.5, ti.u8)
