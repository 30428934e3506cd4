"""Text, lines and areas beside the disk, as coloured quadrangles: one draw call for all of them.

A picture that covers the window (`canvas.set_image`) would cost 17 ms of processor time in each frame, and another 50
whenever it changes. Letters are set by Pillow once and drawn as boxes of equal coverage, about 11 for each.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray
from PIL import Image, ImageDraw, ImageFont

from taichi_disk.lattice import Array
from taichi_disk.render.geometry import NOTHING, Shape, joined, outline, quads
from taichi_disk.render.kernels import VERTEX
from taichi_disk.render.legend import Ink

Place = tuple[float, float]

_PIECES = re.compile(r"[-−+.\d]|[^-−+.\d]+")  # numbers that change are set of letters that are known
_LEVELS = 3  # shades of a letter: with six, which look the same, it takes half as many boxes again


class Sheet:
    """A stand-in for Pillow's ImageDraw; columns and rows of pixels count from the window's upper left corner.

    Attributes:
        left: the column in the window that counts as column 0; it may be changed.
    """

    def __init__(self, ground: Ink) -> None:
        """`ground`: what letters and curves fade to."""
        self._ground, self.left = ground, 0
        self._shapes: list[Shape] = [NOTHING]

    def _add(self, shape: Shape) -> None:
        corners, colours = shape
        self._shapes.append((corners + (self.left, 0.0), colours / 255.0))

    def polygon(self, corners: Sequence[Place], fill: Ink) -> None:
        """A filled triangle or quadrangle."""
        four = [*corners, corners[-1]][:4]
        self._add(quads(*np.array(four, dtype=float)[:, None], *[np.array(fill)] * 4))

    def rectangle(self, box: Sequence[float], fill: Ink | None = None, outline: Ink | None = None) -> None:
        """(left, top, right, bottom), with the last column and row; an outline is a pixel wide."""
        left, top, right, bottom = box[0], box[1], box[2] + 1, box[3] + 1
        if outline:
            self.polygon([(left, top), (right, top), (right, bottom), (left, bottom)], outline)
            left, top, right, bottom = left + 1, top + 1, right - 1, bottom - 1
            fill = fill or self._ground
        if fill:
            self.polygon([(left, top), (right, top), (right, bottom), (left, bottom)], fill)

    def line(self, ends: Sequence[Place], fill: Ink, width: int = 1) -> None:
        """Along a row or a column."""
        (left, top), (right, bottom) = sorted((round(x), round(y)) for x, y in ends)
        before, after = (width - 1) // 2, width // 2
        if left == right:
            self.rectangle((left - before, top, right + after, bottom), fill)
        else:
            self.rectangle((left, top - before, right, bottom + after), fill)

    def curve(self, x: ArrayLike, y: ArrayLike, half: float, ink: Ink) -> None:
        """A line through the points (k,), that fades to the ground at either side within `half` a pixel and more."""
        points, ground = np.stack([x, y], axis=-1).astype(float), np.array(self._ground)
        inside = np.broadcast_to(ground, (len(points) - 1, 2, 3))
        self._add(outline(points[:-1], points[1:], half, inside, ink, ground))

    def text(self, at: Place, line: str, fill: Ink, font: ImageFont.FreeTypeFont, anchor: str = "ls") -> None:
        """Set a line with the left end of its baseline at `at`."""
        x, baseline = at
        for piece in _PIECES.findall(line):
            corners, colours, length = _letters(piece, font, fill, self._ground)
            self._shapes.append((corners + (self.left + round(x), round(baseline)), colours))
            x += length

    def vertices(self, width: int, height: int) -> NDArray[np.float32]:
        """(3 k, VERTEX) of triangles, for a window of so many pixels."""
        corners, colours = joined(*self._shapes)
        vertices = np.zeros((len(corners), VERTEX), dtype=np.float32)
        vertices[:, 0], vertices[:, 1] = corners[:, 0] / width, 1.0 - corners[:, 1] / height
        vertices[:, 8:11], vertices[:, 11] = colours, 1.0
        return vertices


@lru_cache(maxsize=2048)
def _letters(line: str, font: ImageFont.FreeTypeFont, fill: Ink, ground: Ink) -> tuple[Array, Array, float]:
    """Corners and colours of triangles from the left end of the baseline, and how far the next letter is [px]."""
    boxes, shares = _boxes(line, font)
    corners = (boxes[:, place] for place in ([0, 1], [2, 1], [2, 3], [0, 3]))
    places, colours = quads(*corners, *[ground + shares[:, None] * (np.array(fill) - ground)] * 4)
    return places, colours / 255.0, font.getlength(line)


def _boxes(line: str, font: ImageFont.FreeTypeFont) -> tuple[Array, Array]:
    """Boxes (k, 4) (left, top, right, bottom) from the left end of the baseline, and their coverage (k,)."""
    left, top, right, bottom = (round(edge) for edge in font.getbbox(line, anchor="ls"))
    picture = Image.new("L", (max(right - left, 0) + 2, max(bottom - top, 0) + 2))
    ImageDraw.Draw(picture).text((1 - left, 1 - top), line, fill=255, font=font, anchor="ls")
    cover = np.rint(np.asarray(picture) / 255.0 * (_LEVELS - 1)).astype(int)
    rows, ends = np.nonzero(np.diff(cover, axis=1))  # a run begins or ends after this column
    level = cover[rows, ends + 1]
    starts = np.flatnonzero(level)
    row, begin, end, level = rows[starts], ends[starts], ends[starts + 1], level[starts]
    # Runs that stand below each other are one box.
    order = np.lexsort((row, level, end, begin))
    row, begin, end, level = row[order], begin[order], end[order], level[order]
    new = np.append(True, (np.diff(begin) != 0) | (np.diff(end) != 0) | (np.diff(level) != 0) | (np.diff(row) != 1))
    first = np.flatnonzero(new[: len(row)])
    last = np.append(first[1:], len(row)) - 1
    boxes = np.stack([begin[first], row[first] - 1, end[first], row[last]], axis=1) + np.array([left, top, left, top])
    return boxes.astype(float), level[first] / (_LEVELS - 1.0)
