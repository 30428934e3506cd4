"""Draw states, words and curves into finished pictures, off screen."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_disk.computation.driver import State
from taichi_disk.lattice import Array
from taichi_disk.render.geometry import Camera, View
from taichi_disk.render.legend import Legend, Letters, footer
from taichi_disk.render.moments import Caption
from taichi_disk.render.offscreen import open_window
from taichi_disk.render.panel import Panel
from taichi_disk.render.scales import Scales
from taichi_disk.render.video import Picture

_MARGIN = 8.0  # margin beside the view in a picture of 720 pixels [px]
_BEYOND = 3.0  # drawn around the view, for outlines and the wall's edge [px]
_CLEAR = 4.0  # least distance of the disk to words in a picture of 720 pixels [px]


@dataclass(frozen=True)
class Layout:
    """Where the scene lies in the picture of one disk.

    Attributes:
        scale: pixels per R.
        middle: column of the middle of the view [px].
        bottom: row of the lower end of the view [px].
        view: (xmin, xmax, ymin, ymax) [R].
    """

    scale: float
    middle: float
    bottom: int
    view: View

    @classmethod
    def fit(
        cls, view: View, size: tuple[int, int], header: int, bottom: int, unit: float
    ) -> Layout:
        """Return the layout that shows `view` as large as possible between the rows
        `header` and `bottom`."""
        xmin, xmax, ymin, ymax = view
        width, _ = size
        across = (width - 2.0 * _MARGIN * unit) / (xmax - xmin)
        upwards = (bottom - header) / (ymax - ymin)
        return cls(min(across, upwards), 0.5 * width, bottom, view)

    def pixels(self, points: Array) -> Array:
        """Return columns and rows (n, 2) [px] of points (n, 2) [R]."""
        xmin, xmax, ymin, _ = self.view
        columns = self.middle + self.scale * (points[:, 0] - 0.5 * (xmin + xmax))
        return np.stack([columns, self.bottom - self.scale * (points[:, 1] - ymin)], 1)

    def drawn(self, size: tuple[int, int]) -> tuple[slice, slice]:
        """Return the rows and columns that GGUI draws: even numbers [px]."""
        xmin, xmax, ymin, ymax = self.view
        width, height = size
        across = 0.5 * self.scale * (xmax - xmin) + _BEYOND
        half = min(2 * int(0.5 * across + 1.0), width // 2)
        left = width // 2 - half
        top = self.bottom - self.scale * (ymax - ymin) - _BEYOND
        first = 2 * int(max(0.5 * top, 0.0))
        last = min(2 * int(0.5 * (self.bottom + _BEYOND)), height)
        return slice(first, last), slice(left, left + 2 * half)

    def camera(self, rows: slice, columns: slice, supersample: float) -> Camera:
        width = round((columns.stop - columns.start) * supersample)
        height = round((rows.stop - rows.start) * supersample)
        xmin, xmax, ymin, _ = self.view
        middle = self.middle - columns.start, self.bottom - rows.start
        return Camera(
            width=width,
            height=height,
            scale=self.scale * supersample,
            look_at=(0.5 * (xmin + xmax), ymin),
            middle=(middle[0] * supersample, middle[1] * supersample),
            viewport=(0.0, float(width), 0.0, float(height)),
        )


def arranged(
    legends: Sequence[Legend],
    size: tuple[int, int],
    letters: Letters,
    view: View,
    outer: Sequence[Array],
) -> Layout:
    """Return the layout of one or several disks, and let the legends stand in the
    corners if no disk reaches them, else in a band above.

    `outer`: positions (n, 2) [R] of the disk of each legend that reach farthest.
    """
    bottom = size[1] - footer(letters, size[1])
    clear = _CLEAR * letters.unit
    layouts = []
    for is_band in (False, True):
        header = max(legend.set_band(is_band) for legend in legends)
        layout = Layout.fit(view, size, header, bottom, letters.unit)
        layouts.append(layout)
        pairs = zip(legends, outer, strict=True)
        if not any(_touches(layout.pixels(x), one.boxes(), clear) for one, x in pairs):
            return layout
    return layouts[-1]


def _touches(
    points: Array, boxes: Sequence[tuple[float, float, float, float]], clear: float
) -> bool:
    for left, right, top, bottom in boxes:
        beside = np.maximum(left - points[:, 0], points[:, 0] - right)
        above = np.maximum(top - points[:, 1], points[:, 1] - bottom)
        if (np.maximum(beside, above) < clear).any():
            return True
    return False


class Pictures:
    """Pictures of one disk with curves at the right, or of several disks.

    An instance holds the process's only window until it is closed. Call `draw` in the
    thread that made the instance; `finish` and `again`, which always return the same
    array, in another. `width`: of a picture [px].
    """

    def __init__(
        self,
        legends: Sequence[Legend],
        scales: Scales,
        layout: Layout,
        size: tuple[int, int],
        supersample: float,
        panel: Callable[[], Panel] | None = None,
        panel_width: int = 0,
    ) -> None:
        """
        Args:
            size: (width, height) of the picture of one disk [px], even.
            supersample: samples across a pixel, 1, 1.5 or 2.
            panel: returns the panel of curves, when it is needed.
        """
        width, height = size
        self._legends = legends
        self._scales = scales
        self._width = width
        self._samples = round(2 * supersample)
        self._begin_panel = panel
        self._panel: Panel | None = None
        self._rows, self._columns = layout.drawn(size)
        self._camera = layout.camera(self._rows, self._columns, supersample)
        self._unit = height / 720 * supersample
        self._disks = len(legends) * width
        self.width = self._disks + panel_width
        self._still = np.concatenate([legend.still() for legend in legends], axis=1)
        self._picture = np.full((height, self.width, 4), 255, dtype=np.uint8)
        self._picture[:, : self._disks, :3] = self._still
        below = scales.still(layout.scale)
        self._footer = slice(height - len(below), height)
        self._picture[self._footer, : self._disks, :3] = below
        columns = self._columns.stop - self._columns.start
        rows = self._rows.stop - self._rows.start
        self._levels = np.empty((columns, rows, 4), dtype=np.float32)
        self._bytes = np.empty((columns, rows, 4), dtype=np.uint8)
        drawn = self._camera.width, self._camera.height
        self._window = open_window("taichi-disk", drawn, show_window=False)

    def draw(self, moments: Sequence[State]) -> list[NDArray[np.float32]]:
        """Return GGUI's image of each disk, [x, y upwards, colour]."""
        images = []
        canvas = self._window.get_canvas()
        is_soft = self._window.is_soft
        for legend, (_, x, v) in zip(self._legends, moments, strict=True):
            legend.painter.paint(canvas, self._camera, x, v, self._unit, is_soft)
            images.append(self._window.get_image_buffer_as_numpy())
        return images

    def finish(
        self,
        images: Sequence[NDArray[np.float32]],
        captions: Sequence[Caption],
        t: float,
    ) -> Picture:
        """Return the picture (height, width, 4) with the images, the captions of the
        disks, and the curves up to `t` [R/c]."""
        picture = self._picture[..., :3]
        for k, legend in enumerate(self._legends):
            columns = slice(k * self._width, (k + 1) * self._width)
            legend.erase(picture[:, columns])
            self._place(self._picture[:, columns], images[k])
            for box in legend.constant_boxes():
                picture[:, columns][box] = self._still[:, columns][box]
            legend.write(picture[:, columns], captions[k])
        if self._footer.start < self._footer.stop:
            below = picture[self._footer, : self._disks]
            self._scales.write(below, captions[0].pace)
        if self._begin_panel:
            self._panel = self._panel or self._begin_panel()
            self._panel.draw(picture[:, self._disks :], t)
        return self._picture

    def again(self) -> Picture:
        """Return the last picture."""
        return self._picture

    def _place(self, part: Picture, image: NDArray[np.float32]) -> None:
        """Place GGUI's image into the picture of a disk. Columns beside it show only
        the background and a rigid wall, so they repeat the outermost ones."""
        # New memory for each picture would take longer than the arithmetic.
        np.multiply(shrunk(image, self._samples), 255.0, out=self._levels)
        self._levels += 0.5
        np.copyto(self._bytes, self._levels, casting="unsafe")
        # four bytes at a time, which is several times faster
        words = self._bytes.view(np.uint32)[..., 0]
        rows = part[self._rows].view(np.uint32)[..., 0]
        rows[:, self._columns] = words.T[::-1]
        rows[:, : self._columns.start] = rows[:, self._columns.start, None]
        rows[:, self._columns.stop :] = rows[:, self._columns.stop - 1, None]

    def close(self) -> None:
        self._window.destroy()


def shrunk(image: NDArray[np.float32], samples: int) -> NDArray[np.float32]:
    """Return an image [x, y, colour] in which 2 x 2 pixels replace each block of
    `samples` x `samples`, by averages over the area of a pixel."""
    if samples == 2:
        return image
    edges = np.arange(samples + 1) * 2.0 / samples
    shares = [np.diff(np.clip(edges, pixel, pixel + 1)) for pixel in (0, 1)]
    weights = np.array(shares, dtype=np.float32)
    width, height, _ = image.shape
    columns = weights @ image.reshape(width // samples, samples, -1)
    rows = columns.reshape(-1, height // samples, samples, 4)
    return np.asarray(weights @ rows).reshape(len(rows), -1, 4)
