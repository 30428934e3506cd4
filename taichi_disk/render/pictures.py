"""Draw states, words and curves into finished pictures, off screen."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from taichi_disk.computation.driver import State
from taichi_disk.lattice import Array
from taichi_disk.render.geometry import Camera, View
from taichi_disk.render.legend import Box, Legend, Letters, footer, ink
from taichi_disk.render.moments import Caption
from taichi_disk.render.offscreen import open_window
from taichi_disk.render.palette import THEMES
from taichi_disk.render.panel import Panel
from taichi_disk.render.scales import Scales
from taichi_disk.render.video import Picture

_MARGIN = 8.0  # margin beside the view in a picture of 720 pixels [px]
# width of the strip drawn around the view, which outlines and the wall's edge need [px]
_OVERDRAW = 3.0
_CLEAR = 4.0  # least distance of the disk to words in a picture of 720 pixels [px]


def arranged(
    legends: Sequence[Legend],
    size: tuple[int, int],
    letters: Letters,
    view: View,
    outer: Sequence[Sequence[Array]],
) -> Camera:
    """Return the camera of one or several disks, each in a picture of `size` [px], and
    let words stand in the corners if no disk reaches them and walls are rigid, else in
    a band above.

    The view ends at the footer.

    `outer`: positions (n, 2) [R] of the disk of each legend where it reaches farthest.
    """
    width, height = size
    _, _, ymin, ymax = view
    bottom = height - footer(letters, height)
    beside = _MARGIN * letters.unit
    has_body_below = any(legend.painter.has_elastic_wall for legend in legends)
    for is_band in (has_body_below, True):
        header = max(legend.set_band(is_band) for legend in legends)
        viewport = beside, width - beside, float(header), float(bottom)
        camera = Camera.fit(view, width, height, viewport=viewport)
        free = bottom - header - camera.scale * (ymax - ymin)
        camera = camera.panned(0.0, 0.5 * free)
        pairs = zip(legends, outer, strict=True)
        if not any(_touch(camera, each, one.boxes(), letters) for one, each in pairs):
            break
    return camera


def _touch(
    camera: Camera, disks: Sequence[Array], boxes: Sequence[Box], letters: Letters
) -> bool:
    """Return whether a circle around a disk touches a word."""
    for x in disks:
        centre = x.mean(axis=0)
        column, row = camera.to_pixels(centre)
        radius = camera.scale * np.hypot(*(x - centre).T).max()
        for left, right, top, bottom in boxes:
            beside = max(left - column, column - right, 0.0)
            above = max(top - row, row - bottom, 0.0)
            if np.hypot(beside, above) < radius + _CLEAR * letters.unit:
                return True
    return False


def _drawn(camera: Camera, view: View) -> tuple[slice, slice]:
    """Return the rows and columns that GGUI draws: even numbers [px]."""
    xmin, xmax, ymin, ymax = view
    (left, top), (_, bottom) = camera.to_pixels([(xmin, ymax), (xmax, ymin)])
    middle = camera.width // 2
    half = min(2 * int(0.5 * (middle - left + _OVERDRAW) + 1.0), middle)
    first = 2 * int(max(0.5 * (top - _OVERDRAW), 0.0))
    last = min(2 * int(0.5 * (bottom + _OVERDRAW)), camera.height)
    return slice(first, last), slice(middle - half, middle + half)


class Pictures:
    """Pictures of one disk with curves at the right, or of several disks.

    An instance holds the process's only window until it is closed. Call `draw` in the
    thread that made the instance. Call `finish` and `again` in another thread; they
    always return the same array. `width`: width of a picture [px].
    """

    def __init__(
        self,
        legends: Sequence[Legend],
        scales: Scales,
        camera: Camera,
        view: View,
        supersample: float,
        panel: Panel | None = None,
    ) -> None:
        """
        Args:
            camera: of the picture of one disk, whose width and height are even.
            view: what it shows (xmin, xmax, ymin, ymax) [R].
            supersample: samples across a pixel, 1, 1.5 or 2.
            panel: curves at the right.
        """
        self._legends = legends
        self._scales = scales
        self._one_width = camera.width
        self._disks = len(legends) * camera.width
        self.width = self._disks
        if panel:
            self.width += panel.width
        self._supersample = supersample
        self._panel = panel
        self._rows, self._columns = _drawn(camera, view)
        self._camera = camera.cropped(self._rows, self._columns, supersample)
        self._unit = camera.height / 720 * supersample
        ground = THEMES[legends[0].painter.theme].ground
        still = Image.new("RGBA", (self.width, camera.height), (*ink(ground), 255))
        draw = ImageDraw.Draw(still)
        for k, legend in enumerate(legends):
            for line in legend.lines:
                line.draw(draw, k * camera.width, 0.0)
        words = np.asarray(still).view(np.uint32)[..., 0]
        self._words = np.nonzero(words != words[0, 0])
        self._footer = camera.height - scales.height
        scales.draw(draw, self._footer)
        # The same memory as bytes, as pixels of four bytes, and as Pillow's image.
        self._picture = np.array(still)
        self._pixels = self._picture.view(np.uint32)[..., 0]
        image = Image.frombuffer("RGBA", still.size, self._picture, "raw", "RGBA", 0, 1)
        image.readonly = 0
        self._draw = ImageDraw.Draw(image)
        self._still = self._pixels.copy()
        drawn = self._camera.width, self._camera.height
        self._bytes = np.empty((*drawn, 4), dtype=np.uint8)
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
        disks = self._pixels[:, : self._disks]
        for rows in (slice(self._rows.start), slice(self._rows.stop, None)):
            disks[rows] = self._still[rows, : self._disks]
        for k, image in enumerate(images):
            left = k * self._one_width
            self._place(disks[:, left : left + self._one_width], image)
        self._pixels[self._words] = self._still[self._words]
        for k, legend in enumerate(self._legends):
            for line in legend.caption_lines(captions[k]):
                line.draw(self._draw, k * self._one_width, 0.0)
        for line in self._scales.pace_lines(captions[0].pace):
            line.draw(self._draw, 0.0, self._footer)
        if self._panel:
            self._panel.draw(self._picture[:, self._disks :], t)
        return self._picture

    def again(self) -> Picture:
        """Return the last picture."""
        return self._picture

    def _place(self, part: NDArray[np.uint32], image: NDArray[np.float32]) -> None:
        """Place GGUI's image into the picture of a disk. Columns beside it show only
        the background and a rigid wall, so they repeat the outermost ones."""
        # GGUI made k/255 of each byte k, so 255.5 times this lies from k to k + 1. New
        # memory for each picture would take longer than the arithmetic.
        np.multiply(image, 255.5, out=self._bytes, casting="unsafe")
        # four bytes at a time, which is several times faster
        pixels = shrunk(self._bytes, self._supersample).view(np.uint32)[..., 0]
        rows = part[self._rows]
        rows[:, self._columns] = pixels.T[::-1]
        rows[:, : self._columns.start] = rows[:, self._columns.start, None]
        rows[:, self._columns.stop :] = rows[:, self._columns.stop - 1, None]

    def close(self) -> None:
        self._window.destroy()


def shrunk(pixels: NDArray[np.uint8], samples: float) -> NDArray[np.uint8]:
    """Return an image (k, l, 4) that is `samples` times smaller, by averages over the
    area of a pixel."""
    if samples == 1.0:
        return pixels
    width, height, _ = pixels.shape
    image = Image.frombuffer("RGBX", (height, width), pixels, "raw", "RGBX", 0, 1)
    # twice as large first, because `reduce` takes whole numbers
    twice = image.resize((2 * height, 2 * width), Image.Resampling.NEAREST)
    return np.asarray(twice.reduce(round(2.0 * samples)))
