"""Draw states, words and curves into finished pictures, off screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from taichi_disk.computation.driver import State
from taichi_disk.lattice import Array
from taichi_disk.render.geometry import Camera, View
from taichi_disk.render.letters import Box, Letters
from taichi_disk.render.marks import Mark, stamp
from taichi_disk.render.moments import Caption
from taichi_disk.render.offscreen import open_window
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, ink
from taichi_disk.render.panel import Panel
from taichi_disk.render.video import Picture
from taichi_disk.render.words import Legend, Scales, Title, caption_lines, legend

_MARGIN = 8.0  # margin beside the view in a picture of 720 pixels [px]
# width of the strip drawn around the view, which outlines and the wall's edge need [px]
_OVERDRAW = 3.0
_DISK_WIDTH = 8 / 9  # over the height, of one of several disks: two are 16 : 9
_MOST_ABOVE = 0.34  # largest height of a band above the disk over the picture's
_CLEAR = 4.0  # least distance of the disk to words in a picture of 720 pixels [px]


# GGUI's image [x, y upwards, colour], and the marks above it
Drawn = tuple[NDArray[np.float32], list[Mark]]


@dataclass(frozen=True)
class Disk:
    """What one disk's picture shows.

    Attributes:
        captions: changing words of each picture.
        outer: positions (n, 2) [R] of the disk where it reaches farthest.
    """

    painter: Painter
    title: Title
    captions: Sequence[Caption]
    outer: Sequence[Array]


def disk_width(height: int, count: int) -> int:
    """Return the width of the picture of one of `count` disks [px]."""
    if count == 1:
        return height
    return 2 * round(height * _DISK_WIDTH / 2)


def arranged(
    disks: Sequence[Disk], width: int, letters: Letters, view: View
) -> tuple[Camera, list[Legend]]:
    """Return the camera of disks in pictures of `width` [px], and their words: in the
    corners if no disk reaches them and walls are rigid, else in a band above. If the
    band is too high, the least important parameters are left out of all pictures.

    The view ends at the footer.
    """
    height = letters.height
    bottom = float(height - letters.footer)
    beside = _MARGIN * letters.unit
    most = max(len(one.title.parameters) for one in disks)
    trials = [(True, count) for count in range(most, -1, -1)]
    if not any(one.painter.has_elastic_wall for one in disks):
        trials.insert(0, (False, most))
    for is_band, count in trials:
        legends = [
            legend(letters, width, one.title, one.captions, is_band, count)
            for one in disks
        ]
        header = max(one.header for one in legends)
        camera = Camera.fit(
            view, width, height, (beside, width - beside, float(header), bottom)
        )
        touching = [
            _touch(camera, one.outer, each.boxes, letters)
            for one, each in zip(disks, legends, strict=True)
        ]
        if header <= _MOST_ABOVE * height and not any(touching):
            break
    return camera, legends


def _touch(
    camera: Camera, disks: Sequence[Array], boxes: Sequence[Box], letters: Letters
) -> bool:
    """Return whether a point of a disk lies on a word."""
    columns, rows = camera.to_pixels(np.concatenate(disks)).T
    clear = _CLEAR * letters.unit
    for left, right, top, bottom in boxes:
        is_beside = np.maximum(left - columns, columns - right) > clear
        is_above = np.maximum(top - rows, rows - bottom) > clear
        if not (is_beside | is_above).all():
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
    always return the same array. `size`: width and height of a picture [px].
    """

    def __init__(
        self,
        disks: Sequence[Disk],
        letters: Letters,
        view: View,
        supersample: float = 1.0,
        panel: Panel | None = None,
    ) -> None:
        """
        Args:
            view: what is shown of the scene (xmin, xmax, ymin, ymax) [R].
            supersample: samples across a pixel, 1, 1.5 or 2.
            panel: curves at the right.
        """
        self._painters = [one.painter for one in disks]
        self._letters = letters
        self._panel = panel
        height = letters.height
        width = disk_width(height, len(disks))
        camera, legends = arranged(disks, width, letters, view)
        self._width = width
        self._disks = len(disks) * width
        self.size = self._disks, height
        if panel:
            self.size = self._disks + panel.width, height
        self._scales = Scales(self._painters[0], self._disks, letters, camera.scale)
        self._supersample = supersample
        self._rows, self._columns = _drawn(camera, view)
        self._whole = camera
        self._camera = camera.cropped(self._rows, self._columns, supersample)
        self._ground = ink(THEMES[self._painters[0].theme].ground)
        self._picture = np.full((height, self.size[0], 4), 255, dtype=np.uint8)
        self._picture[..., :3] = self._ground
        # The same memory as pixels of four bytes, and as Pillow's image.
        self._pixels = self._picture.view(np.uint32)[..., 0]
        self._image = Image.frombuffer(
            "RGBA", self.size, self._picture, "raw", "RGBA", 0, 1
        )
        self._image.readonly = 0
        self._draw = ImageDraw.Draw(self._image)
        for k, one in enumerate(legends):
            for line in one.lines:
                line.draw(self._draw, k * width, 0.0)
        self._words = np.nonzero(self._pixels != self._pixels[0, 0])
        self._scales.draw(self._picture, self._image, self._draw)
        self._still = self._pixels.copy()
        drawn = self._camera.width, self._camera.height
        self._bytes = np.empty((*drawn, 4), dtype=np.uint8)
        self._window = open_window(drawn)

    def draw(self, states: Sequence[State]) -> list[Drawn]:
        """Return GGUI's image of each disk, and the marks above it."""
        drawn = []
        canvas = self._window.get_canvas()
        is_soft = self._window.is_soft
        unit = self._letters.unit * self._supersample
        for painter, (_, x, v) in zip(self._painters, states, strict=True):
            placed = painter.placed(x)
            painter.paint(canvas, self._camera, x, v, placed, unit, is_soft)
            image = self._window.get_image_buffer_as_numpy()
            marks = painter.marks(self._whole, x, v, placed, self._letters.unit)
            drawn.append((image, marks))
        return drawn

    def finish(self, drawn: Sequence[Drawn], captions: Sequence[Caption]) -> Picture:
        """Return the picture (height, width, 4) with what was drawn, the captions of
        the disks, and the curves up to their time."""
        width = self._width
        # `_place` covers the rows between these.
        for rows in (slice(self._rows.start), slice(self._rows.stop, None)):
            self._pixels[rows, : self._disks] = self._still[rows, : self._disks]
        for k, (image, marks) in enumerate(drawn):
            columns = slice(k * width, (k + 1) * width)
            self._place(self._pixels[:, columns], image)
            for mark in marks:
                corners = mark.corners + [k * width, 0.0]
                moved = mark._replace(corners=corners)
                stamp(self._image, moved, self._ground, columns)
        self._pixels[self._words] = self._still[self._words]
        for k, caption in enumerate(captions):
            for line in caption_lines(self._letters, caption, width):
                line.draw(self._draw, k * width, 0.0)
        for line in self._scales.pace_lines(captions[0].pace):
            line.draw(self._draw, 0.0, self._letters.height - self._letters.footer)
        if self._panel:
            self._panel.draw(self._picture[:, self._disks :], captions[0].t)
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
