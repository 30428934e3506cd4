"""The words around the disk: title at the upper left, changing words at the upper
right, scales below.

Words stand in the corners beside a round disk. Where a body reaches the corners, they
stand in a band above it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from taichi_disk.render.moments import Caption
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, Colour

Ink = tuple[int, int, int]

LEAST = 11.0  # smallest size of letters [px]
# Sizes [px] in a picture of 720 pixels. Other pictures scale them, but letters not
# below LEAST.
MARGIN = 24.0
_HEADING = 26.0
_TEXT = 20.0
_SMALL = 18.0
BAR_HEIGHT = 16.0
BAR_BELOW = 28.0
_LABELLED = 240  # smallest picture with room for text [px]
# largest height of a band above the disk over the picture's; lines that do not fit are
# left out
_MOST = 0.34


def ink(colour: Colour | NDArray[np.float32]) -> Ink:
    red, green, blue = (round(255 * c) for c in colour)
    return red, green, blue


@lru_cache(maxsize=32)
def font(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    # finds the font without importing Matplotlib, which takes 0.3 s
    spec = find_spec("matplotlib")
    assert spec and spec.origin
    path = (
        Path(spec.origin).parent
        / "mpl-data/fonts/ttf"
        / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf")
    )
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)


def text_width(line: str, size: float, bold: bool = False) -> float:
    return font(size, bold).getlength(line)


@dataclass(frozen=True)
class Letters:
    """Sizes of letters [px]. `unit`: 1 in a picture of 720 pixels; `factor`: the user's
    factor."""

    unit: float
    factor: float = 1.0

    def size(self, size: float) -> float:
        return max(size * self.unit * self.factor, LEAST)

    @property
    def small(self) -> float:
        return self.size(_SMALL)


@dataclass(frozen=True)
class Line:
    """A line of text with its baseline, from `x` to the right, or to the left if it
    `ends` there."""

    text: str
    size: float
    ink: Ink
    x: float
    baseline: float
    bold: bool = False
    ends: bool = False

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Left, right, top and bottom [px]."""
        width = text_width(self.text, self.size, self.bold)
        left = self.x - width if self.ends else self.x
        top = self.baseline - 0.8 * self.size
        return left, left + width, top, self.baseline + 0.25 * self.size

    @property
    def pixels(self) -> tuple[slice, slice]:
        """Rows and columns of the text and one pixel around it."""
        left, right, top, bottom = self.box
        rows = slice(max(math.floor(top) - 1, 0), math.ceil(bottom) + 2)
        return rows, slice(max(math.floor(left) - 1, 0), math.ceil(right) + 2)

    def write(self, picture: NDArray[np.uint8]) -> None:
        """Write the text into `picture` (height, width, 3)."""
        rows, columns = self.pixels
        patch = Image.fromarray(picture[rows, columns])
        x = self.x - columns.start
        baseline = self.baseline - rows.start
        replace(self, x=x, baseline=baseline).draw(ImageDraw.Draw(patch))
        picture[rows, columns] = np.asarray(patch)

    def draw(self, draw: Any) -> None:
        anchor = "rs" if self.ends else "ls"
        place = self.x, self.baseline
        face = font(self.size, self.bold)
        draw.text(place, self.text, fill=self.ink, font=face, anchor=anchor)


class Legend:
    """The words of one disk's picture of `width` x `height` pixels. Words that do not
    fit at 11 pixels are left out.

    Attributes:
        is_band: whether words stand in a band above the disk instead of in the corners.
    """

    def __init__(
        self,
        painter: Painter,
        size: tuple[int, int],
        letters: Letters,
        title: Sequence[str],
        samples: Sequence[Caption],
        enlarged: float = 1.0,
    ) -> None:
        """Prepare the words; `set_band` lays them out.

        Args:
            size: of the picture (width, height) [px].
            title: constant lines.
            samples: captions, the longest among them.
            enlarged: factor for the size of the title's first line.
        """
        self.painter = painter
        self.letters = letters
        self.is_band = False
        self._width, self._height = size
        self._title = title
        self._samples = samples
        self._heading = letters.size(_HEADING)
        self._first = enlarged * self._heading
        self._text = letters.size(_TEXT)
        self._margin = max(MARGIN * letters.unit, 7.0)
        theme = THEMES[painter.theme]
        self._ground = ink(theme.ground)
        self._ink = ink(theme.ink)
        self._faint = ink(theme.faint)
        self._velocity = ink(theme.velocity)
        self._has_words = self._height >= _LABELLED
        self._lines: list[Line] = []
        self._written: list[Line] = []

    def set_band(self, is_band: bool) -> int:
        """Let words stand in a band above the disk, or in the corners; return the
        height that they need above the disk [px]."""
        self.is_band = is_band
        self._lines = self._title_lines() if self._has_words else []
        if not self._lines:
            return 0
        lines = self._lines
        if is_band:
            for sample in self._samples:
                lines = [*lines, *self._caption_lines(sample)]
        else:
            lines = [line for line in lines if line.bold]
        return _even(max(line.baseline for line in lines) + 0.6 * self._text)

    def boxes(self) -> list[tuple[float, float, float, float]]:
        """Return left, right, top and bottom [px] of all words above the footer."""
        lines = [*self._lines, *self._remarks()]
        for sample in self._samples:
            if self._has_words:
                lines += self._caption_lines(sample)
        return [line.box for line in lines]

    # ---- constant words

    def _title_lines(self) -> list[Line]:
        first, *others = self._title
        parts = "    ".join(others).split("    ")
        if self.is_band:
            parts = ["    ".join([*parts, *self.painter.remarks])]
        elif self.painter.has_elastic_wall:
            parts += self.painter.remarks
        column = self._column()
        room = self._width - column - 2.0 * self._margin
        words = [(line, True) for line in _wrapped(first, self._first, True, room)]
        for part in parts:
            words += [(line, False) for line in _wrapped(part, self._text, False, room)]
        lines: list[Line] = []
        baseline = self._margin + 0.85 * self._first
        most = math.inf
        if self.is_band:
            most = _MOST * self._height
        for text, bold in words:
            size = self._first if bold else self._text
            colour = self._ink if bold else self._faint
            if bold and lines:
                baseline += 1.2 * self._first
            elif lines and lines[-1].bold:
                baseline += 1.3 * self._heading
            elif lines:
                baseline += 1.4 * self._text
            if baseline < most:
                lines.append(Line(text, size, colour, self._margin, baseline, bold))
        return lines

    def _remarks(self) -> list[Line]:
        """Return the line above the edge of a rigid wall."""
        text = "    ".join(self.painter.remarks)
        if self.is_band or self.painter.has_elastic_wall or not self._has_words:
            return []
        small = self.letters.small
        baseline = self._height - footer(self.letters, self._height) - 0.85 * small
        return [Line(text, small, self._faint, self._margin, baseline)]

    # ---- the changing words

    def _column(self) -> float:
        """Return the width of the changing words [px]."""
        boxes = [line.box for one in self._samples for line in self._caption_lines(one)]
        return max((right - left for left, right, _, _ in boxes), default=0.0)

    def _caption_lines(self, caption: Caption) -> list[Line]:
        right = self._width - self._margin
        lines: list[Line] = []

        def add(text: str, size: float, ink: Ink, bold: bool = False) -> None:
            baseline = self._margin + 0.85 * self._heading
            if lines:
                gap = 1.3 * max(size, self._heading if lines[-1].bold else self._text)
                baseline = lines[-1].baseline + gap
            lines.append(Line(text, size, ink, right, baseline, bold, ends=True))

        add(caption.time, self._text, self._ink)
        if caption.motion:
            add(caption.motion, self._heading, self._velocity, True)
        for text in (*caption.others, *caption.note.split()):
            add(text, self._text, self._ink)
        if caption.result:
            add(caption.result, self._heading, self._ink, True)
        return lines

    # ---- pictures

    def still(self) -> NDArray[np.uint8]:
        """Return the picture (height, width, 3) of the words that do not change."""
        image = Image.new("RGB", (self._width, self._height), self._ground)
        draw = ImageDraw.Draw(image)
        for line in [*self._lines, *self._remarks()]:
            line.draw(draw)
        return np.array(image)

    def constant_boxes(self) -> list[tuple[slice, slice]]:
        """Return rows and columns of the words that do not change."""
        return [line.pixels for line in [*self._lines, *self._remarks()]]

    def erase(self, picture: NDArray[np.uint8]) -> None:
        """Erase the last caption from `picture` (height, width, 3)."""
        for line in self._written:
            picture[line.pixels] = self._ground
        self._written = []

    def write(self, picture: NDArray[np.uint8], caption: Caption) -> None:
        if self._has_words:
            self._written = self._caption_lines(caption)
        for line in self._written:
            line.write(picture)


def footer(letters: Letters, height: int) -> int:
    """Return the height of the scales in a picture of `height` [px]; 0 if it has no
    room for words."""
    if height < _LABELLED:
        return 0
    return _even((BAR_BELOW + BAR_HEIGHT) * letters.unit + 3.9 * letters.small)


def _wrapped(line: str, size: float, bold: bool, room: float) -> list[str]:
    """Break a line of parts, which four spaces separate, where it exceeds `room` [px];
    between words only if a part is too long."""
    lines = [""]
    for part in line.split("    "):
        words = [part]
        if text_width(part, size, bold) > room:
            words = part.split(" ")
        gap = "    "
        for word in words:
            longer = f"{lines[-1]}{gap}{word}" if lines[-1] else word
            if lines[-1] and text_width(longer, size, bold) > room:
                lines.append(word)
            else:
                lines[-1] = longer
            gap = " "
    return lines


def _even(pixels: float) -> int:
    return 2 * math.ceil(pixels / 2)
