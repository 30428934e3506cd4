"""From positions to the pixels of a finished picture, without a screen."""

import os
import tempfile
from collections.abc import Sequence
from types import TracebackType

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.errors import TaichiDiskError
from taichi_disk.render.colouring import QUANTITIES
from taichi_disk.render.layout import Layout
from taichi_disk.render.painter import Painter
from taichi_disk.render.panel import Panel
from taichi_disk.render.picture import Frame, Subject

_Sample = ti.types.vector(4, ti.f32)


class Stills:
    """Makes pictures of one subject, or of several side by side, with a panel of curves at the right if wanted.

    A context manager: it holds a window, of which only one may be alive.
    GGUI has no antialiasing, so the stage is drawn larger and averaged down: 3/2 as large it is nearly as smooth
    as twice (a pixel's four samples have different weights), for two thirds of the time.
    """

    def __init__(
        self,
        subjects: Sequence[Subject],
        size: int,
        lines: int,
        supersample: float = 1.5,
        panel: Panel | None = None,
    ) -> None:
        """`size`: width and height in pixels of the picture of one subject, even; all have the same `view`.

        `lines`: how many lines of text frames have; `supersample`: samples across a pixel, 1, 1.5 or 2;
        `panel`: as high as `size`.
        """
        rows = max(lines, *(len(subject.title) for subject in subjects))
        self._subjects, self._size, self._samples, self._panel = subjects, size, round(2 * supersample), panel
        self._layouts = [Layout(subject, size, rows) for subject in subjects]
        self.camera = camera = self._layouts[0].camera
        parts = [layout.still for layout in self._layouts] + ([panel.empty] if panel else [])
        still = np.concatenate(parts, axis=1)
        self.width = still.shape[1]
        self._picture = np.zeros((size, self.width, 4), dtype=np.uint8)
        self._picture[..., :3] = still
        self._stage_rows = self._picture.view(np.uint32)[camera.top : camera.top + camera.height, :, 0]
        self._painters = [Painter(subject, camera, self._layouts[0].unit) for subject in subjects]
        large = self._samples * camera.width // 2, self._samples * camera.height // 2
        try:
            self._window = ti.ui.Window("taichi-disk", large, show_window=False)
        except RuntimeError as error:  # a Vulkan driver that is there and does not work
            self._destroy_painters()
            raise TaichiDiskError(f"no film: Vulkan cannot draw {large[0]} x {large[1]} pixels: {error}") from error
        self._canvas = self._window.get_canvas()

    def draw(self, frames: Sequence[Frame]) -> NDArray[np.uint8]:
        """The picture (size, width, 4) of one frame of each subject, rows downwards: red, green, blue, unused.

        The next call overwrites it. Raises SimulationError if a position is not finite.
        """
        for k, (subject, frame) in enumerate(zip(self._subjects, frames, strict=True)):
            frame.require_finite()
            signed = QUANTITIES[subject.colouring].signed
            look = frame.values, subject.show, signed, frame.pushed
            self._painters[k].paint(self._canvas, frame.positions, *look)
            drawn, left = self._window.get_image_buffer_as_numpy(), k * self._size
            _shrink(drawn, self._stage_rows, left + self.camera.left, self._samples)
            self._layouts[k].write(self._picture[:, left : left + self._size], frame.text)
        if self._panel:
            self._panel.draw(self._picture[:, len(frames) * self._size :], frames[0].t)
        return self._picture

    def _destroy_painters(self) -> None:
        for painter in self._painters:
            painter.destroy()

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
        self._destroy_painters()

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


def _weights(samples: int) -> NDArray[np.float64]:
    """(2, samples): how much of each of two neighbouring pixels each of the samples across both covers."""
    edges = np.arange(samples + 1) * 2.0 / samples
    return np.array([np.diff(np.clip(edges, pixel, pixel + 1)) for pixel in (0, 1)])


@ti.kernel
def _shrink(
    drawn: ti.types.ndarray(dtype=_Sample, ndim=2),  # type: ignore[valid-type]
    picture: ti.types.ndarray(dtype=ti.u32, ndim=2),  # type: ignore[valid-type]
    first: ti.i32,
    samples: ti.template(),  # type: ignore[valid-type]
):
    """Average `samples` x `samples` samples [x, y upwards] over the 2 x 2 pixels that they cover.

    `picture` [row downwards, column]: as high as what was drawn; its columns from `first` on are filled.
    """
    for x in range(drawn.shape[0] // samples):
        for y in range(drawn.shape[1] // samples):
            i, j = samples * x, samples * y
            row, column = picture.shape[0] - 1 - 2 * y, first + 2 * x
            for a in ti.static(range(2)):
                for b in ti.static(range(2)):
                    mean = _Sample(0.0)
                    for k in ti.static(range(samples)):
                        for m in ti.static(range(samples)):
                            weight = ti.static(255.0 * float(_weights(samples)[a, k] * _weights(samples)[b, m]))
                            if ti.static(weight > 0.0):
                                mean += ti.cast(weight, ti.f32) * drawn[i + k, j + m]
                    picture[row - b, column + a] = _packed(mean)
