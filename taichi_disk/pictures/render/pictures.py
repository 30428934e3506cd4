"""Arrange disks and words in pictures, and draw the disks, off screen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import cycle

import numpy as np

from taichi_disk.experiments.computation.driver import State
from taichi_disk.mechanics.lattice import Array
from taichi_disk.pictures.panel import PanelScene
from taichi_disk.pictures.render.artist import WAITING, shared_array
from taichi_disk.pictures.render.finisher import Drawn, Finisher, Placed, canvas
from taichi_disk.pictures.render.geometry import Camera, View
from taichi_disk.pictures.render.letters import Box, Letters
from taichi_disk.pictures.render.moments import Shots
from taichi_disk.pictures.render.offscreen import open_window
from taichi_disk.pictures.render.painter import Painter
from taichi_disk.pictures.render.palette import THEMES, ink
from taichi_disk.pictures.render.words import (
    Legend,
    Scales,
    Title,
    caption_lines,
    legend,
    remark_lines,
)

_MARGIN = 8.0  # margin beside the view in a picture of 720 pixels [px]
# width of the strip drawn around the view, which outlines and the wall's edge need [px]
_OVERDRAW = 3.0
_DISK_WIDTH = 8 / 9  # over the height, of one of several disks: two are 16 : 9
_MOST_ABOVE = 0.34  # largest height of a band above the disk over the picture's
_CLEAR = 4.0  # least distance of the disk to words in a picture of 720 pixels [px]


@dataclass(frozen=True)
class Disk:
    """What one disk's picture shows.

    Attributes:
        captions: changing words of each picture.
        outer: positions (n, 2) [R] of the disk where it reaches farthest.
    """

    painter: Painter
    title: Title
    captions: Shots
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
    corners if no disk reaches them, else in a band above. If the band is too high, the
    least important parameters are left out of all pictures.

    The view ends at the footer, or at a remark above it.
    """
    height = letters.height
    bottom = float(height - letters.footer)
    beside = _MARGIN * letters.unit
    is_elastic = any(one.painter.has_elastic_wall for one in disks)
    most = max(len(one.title.parameters) for one in disks)
    counts: list[int | None] = [None, *range(most, -1, -1)]
    for count in counts:
        legends = [
            legend(letters, width, one.title, one.captions, count) for one in disks
        ]
        header = max(one.header for one in legends)
        lowest = bottom
        if is_elastic and count is None:  # a remark stands below the wall
            lowest -= 1.9 * letters.small.size
        camera = Camera.fit(
            view, width, height, (beside, width - beside, float(header), lowest)
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
    """Pictures of one disk with curves at the right, or of several disks, without what
    a `Finisher` adds.

    An instance holds the process's only window until it is closed, and is used by the
    thread that made it.

    Attributes:
        finisher: completes the pictures.
    """

    def __init__(
        self,
        disks: Sequence[Disk],
        letters: Letters,
        view: View,
        supersample: float,
        panel: PanelScene | None,
    ) -> None:
        """
        Args:
            view: what is shown of the scene (xmin, xmax, ymin, ymax) [R].
            supersample: samples across a pixel, 1, 1.5 or 2.
            panel: curves at the right.
        """
        self._painters = [one.painter for one in disks]
        self._letters = letters
        width = disk_width(letters.height, len(disks))
        camera, legends = arranged(disks, width, letters, view)
        all_disks = len(disks) * width
        self._scales = Scales(self._painters[0], all_disks, letters, camera.scale)
        self._supersample = supersample
        rows, columns = _drawn(camera, view)
        self._whole = camera
        self._camera = camera.cropped(rows, columns, supersample)
        whole_width = all_disks
        if panel:
            whole_width += panel.size[0]
        ground = ink(THEMES[self._painters[0].theme].ground)
        still = np.full((letters.height, whole_width, 4), 255, dtype=np.uint8)
        still[..., :3] = ground
        image, draw = canvas(still)
        for k, one in enumerate(legends):
            for line in one.lines:
                line.draw(draw, k * width, 0.0)
        words = np.nonzero((still[..., :3] != ground).any(axis=2))
        self._scales.draw(still, image, draw)
        drawn = self._camera.width, self._camera.height
        # as many as pictures that wait, one that is finished, and one that is drawn
        count = (WAITING + 2) * len(disks)
        self._images = shared_array((count, *drawn, 4))
        self._places = cycle(range(count))
        self.finisher = Finisher(
            images=self._images,
            still=still,
            words=words,
            width=width,
            disks=all_disks,
            rows=rows,
            columns=columns,
            supersample=supersample,
            ground=ground,
            panel=panel,
        )
        self._window = open_window(drawn)

    def draw(self, states: Sequence[State], captions: Shots) -> list[Drawn]:
        """Draw each disk, its ringing as strong as its caption says."""
        drawn = []
        canvas = self._window.get_canvas()
        unit = self._letters.unit * self._supersample
        disks = zip(self._painters, states, captions, strict=True)
        for painter, (_, x, v), caption in disks:
            placed = painter.placed(x, caption.ringing)
            painter.paint(
                canvas,
                self._camera,
                x,
                v,
                placed,
                unit,
                self._window.is_soft,
                caption.ringing,
            )
            image = self._window.get_image_buffer_as_numpy()
            place = next(self._places)
            # GGUI made k/255 of each byte k, so 255.5 times this lies from k to k + 1.
            image *= 255.5
            self._images[place] = image
            marks = painter.marks(self._whole, x, v, placed, self._letters.unit)
            drawn.append((place, marks))
        return drawn

    def lines(self, captions: Shots) -> list[Placed]:
        """Return the changing words of a picture with the `captions` of its disks."""
        width = self.finisher.width
        lines: list[Placed] = []
        for k, caption in enumerate(captions):
            words = caption_lines(self._letters, caption, width)
            words += remark_lines(self._letters, caption, width)
            lines += [(line, k * width, 0.0) for line in words]
        below = self._letters.height - self._letters.footer
        pace = self._scales.pace_lines(captions[0].pace)
        lines += [(line, 0.0, below) for line in pace]
        return lines

    def close(self) -> None:
        self._window.destroy()
