"""Letters of pictures: their fonts, sizes and lines."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from PIL import ImageFont

from taichi_disk.pictures.render.palette import THEMES, Ink, ink

Box = tuple[float, float, float, float]  # left, right, top and bottom [px]

LEAST = 11.0  # smallest size of letters [px]
# Sizes [px] in a picture of 720 pixels. In other pictures they are scaled, but letters
# never become smaller than LEAST.
_MARGIN = 24.0
_HEADING = 26.0
_RESULT = 36.0
_TEXT = 20.0
_SMALL = 18.0
BAR_HEIGHT = 16.0
BAR_BELOW = 28.0
_FEW_BELOW = 2.4  # height of the wall that carries one line, over the size of letters
LEADING = 1.3  # distance of baselines over the size of letters
_LABELLED = 240  # smallest picture with room for text [px]
_NO_LETTER = "\U0010ffff"  # which fonts draw as they draw letters that they lack


@lru_cache
def _own_font(bold: bool) -> Path:
    # finds the font without importing Matplotlib, which takes 0.3 s
    spec = find_spec("matplotlib")
    assert spec and spec.origin
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return Path(spec.origin).with_name("mpl-data") / "fonts/ttf" / name


@lru_cache(maxsize=32)
def _font(path: Path, size: float) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)


@lru_cache(maxsize=4096)
def _has(path: Path, letter: str) -> bool:
    if letter <= "~":
        return True
    try:
        font = _font(path, _TEXT)
        return bytes(font.getmask(letter)) != bytes(font.getmask(_NO_LETTER))
    except OSError:  # Pillow cannot read this kind of font
        return False


def lacking(text: str) -> str:
    """Return the letters of `text` that its font lacks."""
    path = _font_file(text, bold=False)
    return "".join(letter for letter in text if not _has(path, letter))


@lru_cache(maxsize=4096)
def _font_file(text: str, bold: bool) -> Path:
    """Return a font that has all letters of `text`: this package's, or else one of the
    system, if there is one."""
    own = _own_font(bold)
    if all(_has(own, letter) for letter in text):
        return own
    from matplotlib.font_manager import findSystemFonts

    for path in map(Path, sorted(findSystemFonts())):
        if all(_has(path, letter) for letter in text):
            return path
    return own


class Face(NamedTuple):
    """Size [px], colour and weight of letters."""

    size: float
    ink: Ink
    bold: bool = False

    def font(self, text: str) -> ImageFont.FreeTypeFont:
        return _font(_font_file(text, self.bold), self.size)

    # a picture of a film asks for some fifty widths, most of them again
    @lru_cache(maxsize=4096)  # noqa: B019 (faces live as long as the process)
    def width(self, text: str) -> float:
        return self.font(text).getlength(text)


class Line(NamedTuple):
    """A line of text with its baseline. The fraction `part` of its width lies at the
    left of `x`."""

    text: str
    face: Face
    x: float
    baseline: float
    part: float = 0.0

    @property
    def left(self) -> float:
        return self.x - self.part * self.face.width(self.text)

    @property
    def box(self) -> Box:
        size = self.face.size
        right = self.left + self.face.width(self.text)
        return self.left, right, self.baseline - 0.8 * size, self.baseline + 0.25 * size

    def draw(self, draw: Any, left: float, top: float) -> None:
        """Draw the text into the part of a picture that begins at `left` and `top`
        [px]."""
        draw.text(
            (self.left + left, self.baseline + top),
            self.text,
            fill=self.face.ink,
            font=self.face.font(self.text),
            anchor="ls",
        )


@dataclass
class Letters:
    """The letters of a picture of `height` [px], larger by a `factor`.

    Attributes:
        are_few: whether only the most important words are shown.
        unit: 1 in a picture of 720 pixels.
        margin: distance of words to the sides of the picture [px].
        footer: height of the scales [px]; 0 in a picture without room for words.
        heading, motion, result, text, faint, small: faces of the words.
    """

    height: int
    factor: float = 1.0
    theme: str = "light"
    are_few: bool = False

    def __post_init__(self) -> None:
        colours = THEMES[self.theme]
        self.unit = self.height / 720
        self.margin = max(_MARGIN * self.unit, 7.0)
        self.heading = Face(self.size(_HEADING), ink(colours.ink), bold=True)
        self.motion = Face(self.size(_HEADING), ink(colours.velocity), bold=True)
        self.result = Face(self.size(_RESULT), ink(colours.ink), bold=True)
        self.text = Face(self.size(_TEXT), ink(colours.ink))
        self.faint = Face(self.size(_TEXT), ink(colours.faint))
        self.small = Face(self.size(_SMALL), ink(colours.ink))
        self.footer = 0
        if self.height >= _LABELLED:
            bar = (BAR_BELOW + BAR_HEIGHT) * self.unit
            self.footer = even(bar + 3.9 * self.small.size)
            if self.are_few:
                self.footer = even(_FEW_BELOW * self.small.size)

    def size(self, size: float) -> float:
        return max(size * self.unit * self.factor, LEAST)

    def stacked(
        self, words: Sequence[tuple[str, Face]], x: float, part: float = 0.0
    ) -> list[Line]:
        """Return lines one below the other, beginning at the top of the picture."""
        lines: list[Line] = []
        _, first = words[0]
        baseline = self.margin + 0.85 * max(self.heading.size, first.size)
        for text, face in words:
            if lines:
                baseline += LEADING * max(face.size, lines[-1].face.size)
            lines.append(Line(text, face, x, baseline, part))
        return lines


def even(pixels: float) -> int:
    return 2 * math.ceil(pixels / 2)
