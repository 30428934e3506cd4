"""The words around the disk: title at the upper left, changing words at the upper
right, scales below.

Words stand in the corners beside a round disk. Where a body reaches the corners, they
stand in a band above it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import ImageFont

from taichi_disk.render.moments import Caption
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, Colour

Ink = tuple[int, int, int]
Box = tuple[float, float, float, float]  # left, right, top and bottom [px]

LEAST = 11.0  # smallest size of letters [px]
# Sizes [px] in a picture of 720 pixels. In other pictures they are scaled, but letters
# never become smaller than LEAST.
_MARGIN = 24.0
_HEADING = 26.0
_TEXT = 20.0
_SMALL = 18.0
BAR_HEIGHT = 16.0
BAR_BELOW = 28.0
_LEADING = 1.3  # distance of baselines over the size of letters
_LABELLED = 240  # smallest picture with room for text [px]
# largest height of a band above the disk over the picture's; lines that do not fit are
# left out
_MOST = 0.34


def ink(colour: Colour | NDArray[np.float32]) -> Ink:
    red, green, blue = (round(255 * c) for c in colour)
    return red, green, blue


@lru_cache(maxsize=32)
def _font(size: float, bold: bool) -> ImageFont.FreeTypeFont:
    # finds the font without importing Matplotlib, which takes 0.3 s
    spec = find_spec("matplotlib")
    assert spec and spec.origin
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(spec.origin).with_name("mpl-data") / "fonts/ttf" / name
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)


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

    @property
    def margin(self) -> float:
        """Distance of words to the sides of the picture [px]."""
        return max(_MARGIN * self.unit, 7.0)


@dataclass(frozen=True)
class Face:
    """Size [px], colour and weight of letters."""

    size: float
    ink: Ink
    bold: bool = False

    @property
    def font(self) -> ImageFont.FreeTypeFont:
        return _font(self.size, self.bold)

    def width(self, text: str) -> float:
        return self.font.getlength(text)


@dataclass(frozen=True)
class Line:
    """A line of text with its baseline, from `x` to the right, or to the left if it
    `ends` there."""

    text: str
    face: Face
    x: float
    baseline: float
    ends: bool = False

    @property
    def box(self) -> Box:
        left = self.x
        if self.ends:
            left -= self.face.width(self.text)
        right = left + self.face.width(self.text)
        size = self.face.size
        return left, right, self.baseline - 0.8 * size, self.baseline + 0.25 * size

    def draw(self, draw: Any, left: float, top: float) -> None:
        """Draw the text into the part of a picture that begins at `left` and `top`
        [px]."""
        draw.text(
            (self.x + left, self.baseline + top),
            self.text,
            fill=self.face.ink,
            font=self.face.font,
            anchor="rs" if self.ends else "ls",
        )


class Legend:
    """The words of one disk's picture of `width` x `height` pixels. Words that do not
    fit at 11 pixels are left out.

    Attributes:
        lines: the words that do not change, after `set_band`.
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
        self.lines: list[Line] = []
        self._is_band = False
        self._letters = letters
        self._width, self._height = size
        self._title = title
        self._samples = samples
        theme = THEMES[painter.theme]
        heading = letters.size(_HEADING)
        self._first = Face(enlarged * heading, ink(theme.ink), bold=True)
        self._motion = Face(heading, ink(theme.velocity), bold=True)
        self._result = Face(heading, ink(theme.ink), bold=True)
        self._text = Face(letters.size(_TEXT), ink(theme.ink))
        self._faint = Face(letters.size(_TEXT), ink(theme.faint))
        self._has_words = self._height >= _LABELLED

    def set_band(self, is_band: bool) -> int:
        """Let words stand in a band above the disk, or in the corners; return the
        height that they need above the disk [px]."""
        self._is_band = is_band
        if not self._has_words:
            return 0
        titles = self._titles()
        self.lines = [*titles, *self._remarks()]
        above = [line for line in titles if line.face.bold]
        if is_band:
            above = [*titles, *self._sample_lines()]
        return _even(max(line.baseline for line in above) + 0.6 * self._text.size)

    def boxes(self) -> list[Box]:
        """Return the boxes of all words above the footer."""
        return [line.box for line in [*self.lines, *self._sample_lines()]]

    # ---- constant words

    def _titles(self) -> list[Line]:
        first, *others = self._title
        parts = "    ".join(others).split("    ")
        if self._is_band:
            parts = ["    ".join([*parts, *self.painter.remarks])]
        boxes = [line.box for line in self._sample_lines()]
        column = max((right - left for left, right, _, _ in boxes), default=0.0)
        margin = self._letters.margin
        room = self._width - column - 2.0 * margin
        words = _wrapped(first, self._first, room)
        for part in parts:
            words += _wrapped(part, self._faint, room)
        lines = self._stacked(words, margin, ends=False)
        if self._is_band:
            return [line for line in lines if line.baseline < _MOST * self._height]
        return lines

    def _remarks(self) -> list[Line]:
        """Return the painter's remarks as one line of text above the wall's edge; [] if
        words stand in a band."""
        if self._is_band:
            return []
        text = "    ".join(self.painter.remarks)
        face = Face(self._letters.small, self._faint.ink)
        baseline = self._height - footer(self._letters, self._height) - 0.85 * face.size
        return [Line(text, face, self._letters.margin, baseline)]

    # ---- the changing words

    def caption_lines(self, caption: Caption) -> list[Line]:
        """Return the changing words of a picture, at the upper right."""
        if not self._has_words:
            return []
        words = [(caption.time, self._text)]
        if caption.motion:
            words.append((caption.motion, self._motion))
        words += [(text, self._text) for text in caption.others]
        words += [(text, self._text) for text in caption.note.split()]
        if caption.result:
            words.append((caption.result, self._result))
        return self._stacked(words, self._width - self._letters.margin, ends=True)

    def _sample_lines(self) -> list[Line]:
        return list(chain.from_iterable(map(self.caption_lines, self._samples)))

    def _stacked(
        self, words: Sequence[tuple[str, Face]], x: float, ends: bool
    ) -> list[Line]:
        """Return lines one below the other, from or to the column `x`."""
        lines: list[Line] = []
        highest = max(self._result.size, words[0][1].size)
        baseline = self._letters.margin + 0.85 * highest
        for text, face in words:
            if lines:
                baseline += _LEADING * max(face.size, lines[-1].face.size)
            lines.append(Line(text, face, x, baseline, ends))
        return lines


def footer(letters: Letters, height: int) -> int:
    """Return the height of the scales in a picture of `height` [px]; 0 if it has no
    room for words."""
    if height < _LABELLED:
        return 0
    return _even((BAR_BELOW + BAR_HEIGHT) * letters.unit + 3.9 * letters.small)


def _wrapped(line: str, face: Face, room: float) -> list[tuple[str, Face]]:
    """Break a line of parts, which four spaces separate, where it exceeds `room` [px];
    between words only if a part is too long."""
    lines = [""]
    for part in line.split("    "):
        words = [part]
        if face.width(part) > room:
            words = part.split(" ")
        gap = "    "
        for word in words:
            longer = f"{lines[-1]}{gap}{word}" if lines[-1] else word
            if lines[-1] and face.width(longer) > room:
                lines.append(word)
            else:
                lines[-1] = longer
            gap = " "
    return [(text, face) for text in lines]


def _even(pixels: float) -> int:
    return 2 * math.ceil(pixels / 2)
