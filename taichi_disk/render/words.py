"""The words of pictures: title at the upper left, changing words at the upper right,
scales of colours and forces and the pace of the film below.

Words stand in the corners beside a round disk. Where a body reaches the corners, they
stand in a band above it.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from PIL import ImageFont

from taichi_disk.fields import FRINGES, QUANTITIES
from taichi_disk.output.panel import RAISED, factored
from taichi_disk.render.marks import Ink, Mark, arrows, stamp
from taichi_disk.render.moments import Caption
from taichi_disk.render.painter import ARROW, FORCE_ARROW, Painter
from taichi_disk.render.palette import THEMES, ink

Box = tuple[float, float, float, float]  # left, right, top and bottom [px]

LEAST = 11.0  # smallest size of letters [px]
# Sizes [px] in a picture of 720 pixels. In other pictures they are scaled, but letters
# never become smaller than LEAST.
_MARGIN = 24.0
_HEADING = 26.0
_TEXT = 20.0
_SMALL = 18.0
_BAR_HEIGHT = 16.0
_BAR_BELOW = 28.0
_LEADING = 1.3  # distance of baselines over the size of letters
_LABELLED = 240  # smallest picture with room for text [px]
# largest height of a band above the disk over the picture's; lines that do not fit are
# left out
_MOST = 0.34
# width of the bar over that of the picture, and the least one
_BAR_WIDTH = 0.34
_MIN_BAR_WIDTH = 0.08
_ARROW = 0.1  # largest length of the scale's arrow over the height of the picture
_GAP = 0.5  # least distance of two words, in units of the size of their letters


# ---- letters


@lru_cache(maxsize=32)
def _font(size: float, bold: bool) -> ImageFont.FreeTypeFont:
    # finds the font without importing Matplotlib, which takes 0.3 s
    spec = find_spec("matplotlib")
    assert spec and spec.origin
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(spec.origin).with_name("mpl-data") / "fonts/ttf" / name
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)


class Face(NamedTuple):
    """Size [px], colour and weight of letters."""

    size: float
    ink: Ink
    bold: bool = False

    @property
    def font(self) -> ImageFont.FreeTypeFont:
        return _font(self.size, self.bold)

    def width(self, text: str) -> float:
        return self.font.getlength(text)


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
            font=self.face.font,
            anchor="ls",
        )


class Letters:
    """The letters of a picture of `height` [px], larger by the user's `factor`.

    Attributes:
        unit: 1 in a picture of 720 pixels.
        margin: distance of words to the sides of the picture [px].
        footer: height of the scales [px]; 0 in a picture without room for words.
        heading, motion, text, faint, small: faces of the words.
    """

    def __init__(self, height: int, factor: float = 1.0, theme: str = "light") -> None:
        colours = THEMES[theme]
        self.height = height
        self.unit = height / 720
        self.margin = max(_MARGIN * self.unit, 7.0)
        self._factor = factor
        self.heading = Face(self.size(_HEADING), ink(colours.ink), bold=True)
        self.motion = Face(self.size(_HEADING), ink(colours.velocity), bold=True)
        self.text = Face(self.size(_TEXT), ink(colours.ink))
        self.faint = Face(self.size(_TEXT), ink(colours.faint))
        self.small = Face(self.size(_SMALL), ink(colours.ink))
        self.has_words = height >= _LABELLED
        self.footer = 0
        if self.has_words:
            bar = (_BAR_BELOW + _BAR_HEIGHT) * self.unit
            self.footer = _even(bar + 3.9 * self.small.size)

    def size(self, size: float) -> float:
        return max(size * self.unit * self._factor, LEAST)

    def stacked(
        self, words: Sequence[tuple[str, Face]], x: float, part: float = 0.0
    ) -> list[Line]:
        """Return lines one below the other, beginning at the top of the picture."""
        lines: list[Line] = []
        _, first = words[0]
        baseline = self.margin + 0.85 * max(self.heading.size, first.size)
        for text, face in words:
            if lines:
                baseline += _LEADING * max(face.size, lines[-1].face.size)
            lines.append(Line(text, face, x, baseline, part))
        return lines


# ---- words above


def caption_lines(letters: Letters, caption: Caption, width: int) -> list[Line]:
    """Return the changing words at the upper right of a picture of `width` [px]."""
    if not letters.has_words:
        return []
    words = [(text, letters.text) for text in caption.lines]
    if len(words) > 1:
        words[1] = caption.lines[1], letters.motion
    words += [(text, letters.text) for text in caption.note.split()]
    if caption.result:
        words.append((caption.result, letters.heading))
    return letters.stacked(words, width - letters.margin, part=1.0)


@dataclass(frozen=True)
class Legend:
    """The words of one disk's picture: lines that do not change, boxes of all words
    above the scales, and the height that words need above the disk [px]."""

    lines: Sequence[Line] = ()
    boxes: Sequence[Box] = ()
    header: int = 0


def legend(
    letters: Letters,
    width: int,
    title: Sequence[str],
    remarks: Sequence[str],
    samples: Sequence[Caption],
    is_band: bool = False,
    enlarged: float = 1.0,
) -> Legend:
    """Set the words of a picture of `width` [px] in its corners, or in a band above the
    disk. Words that do not fit at 11 pixels are left out.

    Args:
        title, remarks: constant lines.
        samples: captions, the longest among them.
        enlarged: factor for the size of the title's first line.
    """
    if not letters.has_words:
        return Legend()
    changing = [line for one in samples for line in caption_lines(letters, one, width)]
    column = max(line.x - line.left for line in changing)
    room = width - column - 2.0 * letters.margin
    first, *others = title
    parts = "    ".join(others).split("    ")
    if is_band:
        parts = ["    ".join([*parts, *remarks])]
    heading = letters.heading._replace(size=enlarged * letters.heading.size)
    words = _wrapped(first, heading, room)
    for part in parts:
        words += _wrapped(part, letters.faint, room)
    lines = letters.stacked(words, letters.margin)
    above = [line for line in lines if line.face.bold]
    if is_band:
        lines = [line for line in lines if line.baseline < _MOST * letters.height]
        above = [*lines, *changing]
    elif remarks:
        face = letters.small._replace(ink=letters.faint.ink)
        baseline = letters.height - letters.footer - 0.85 * face.size
        lines.append(Line("    ".join(remarks), face, letters.margin, baseline))
    lowest = max(line.baseline for line in above)
    header = _even(lowest + 0.6 * letters.text.size)
    return Legend(lines, [line.box for line in [*lines, *changing]], header)


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


# ---- scales below


def round_below(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that does not exceed
    `value` > 0."""
    decade = 10.0 ** math.floor(math.log10(value))
    return decade * max(step for step in (0.5, 1, 2, 5) if step * decade <= value)


def label(value: float, signed: bool = False) -> str:
    """Return a value as `+5`, `0.02` or `2·10⁻⁷`."""
    if not value:
        return "0"
    text = f"{value:+.4g}" if signed else f"{value:.4g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}·10{str(int(exponent)).translate(RAISED)}"
    return text.replace("-", "−")


class Scales:
    """The scale of colours, that of forces, and the pace of the film: in the body of a
    rigid wall, or below an elastic one. Scales are shared by compared disks.

    Words are placed in the order of their importance. A word that would touch an
    earlier one, or the picture's sides, is left out.

    Attributes:
        lines: the words that do not change.
    """

    def __init__(
        self,
        painter: Painter,
        width: int,
        letters: Letters,
        scale: float,
        paces: Collection[Sequence[str]] = (),
    ) -> None:
        """
        Args:
            width: of all disks together [px].
            scale: pixels per R.
            paces: all texts of which `pace_lines` will be asked.
        """
        self._painter = painter
        self._width = width
        self._letters = letters
        self._top = round(_BAR_BELOW * letters.unit)
        self._bar_height = max(round(_BAR_HEIGHT * letters.unit), 6)
        size = letters.small.size
        self._numbers_row = self._top + self._bar_height + 1.35 * size
        self._words_row = self._numbers_row + 1.55 * size
        self._tip = letters.margin  # column of the tip of the arrow [px]
        self.lines: list[Line] = []
        self._taken: list[Box] = []
        widest = max([letters.small.width(lines[0]) for lines in paces if lines] or [0])
        beside = letters.margin + widest + 2.5 * size
        room = min(_BAR_WIDTH * width, width - 2.0 * beside)
        self._bar_width = round(max(room, _MIN_BAR_WIDTH * width))
        self._left = (width - self._bar_width) // 2
        if letters.has_words:
            self._add_colours()
            self._add_force(scale)
            self._add_ends()

    # ---- words

    def _line(self, text: str, x: float, row: float, part: float = 0.0) -> list[Line]:
        """Return the line if its place is free, else nothing."""
        line = Line(text, self._letters.small, x, row, part)
        left, right, top, bottom = line.box
        margin = 0.5 * self._letters.margin
        gap = _GAP * line.face.size
        if left < margin or right > self._width - margin:
            return []
        for first, last, upper, lower in self._taken:
            is_beside = right + gap < first or last + gap < left
            if not is_beside and top < lower and upper < bottom:
                return []
        return [line]

    def _add(self, text: str, x: float, row: float, part: float = 0.0) -> bool:
        """Add a text if its place is free, and return whether it is."""
        found = self._line(text, x, row, part)
        self.lines += found
        self._taken += [line.box for line in found]
        return bool(found)

    def _add_colours(self) -> None:
        painter = self._painter
        quantity = QUANTITIES[painter.colour]
        name = quantity.short or quantity.label
        words, factor = factored(f"{name} [{quantity.unit}]", painter.limit)
        if painter.colour == "strain":
            words = f"{name} [%]"
            factor = 0.01
        limit = painter.limit / factor
        end = label(limit, painter.signed)
        ticks = [(1.0, f"≥ {end}"), (0.0, "0"), (0.5, label(0.5 * limit))]
        if painter.signed:
            start = label(-limit, signed=True)
            ticks = [(1.0, f"≥ {end}"), (0.0, f"≤ {start}"), (0.5, "0")]
        if painter.colour == "fringes":
            words = f"fringes of {label(painter.limit)} Mc²/R²"
            ticks = [(k / FRINGES, f"{k}") for k in range(FRINGES + 1)]
        for part, text in ticks:
            x = self._left + part * (self._bar_width - 1)
            self._add(text, x, self._numbers_row, part=0.5)
        self._add(words, self._width / 2, self._words_row, part=0.5)

    def _add_force(self, scale: float) -> None:
        """Choose the arrow of a force, and add its words."""
        full = self._painter.full_force
        margin = self._letters.margin
        if not full:
            return
        pixels = ARROW * scale / full  # length of an arrow for a force of 1 Mc²/R
        force = round_below(_ARROW * self._letters.height / pixels)
        if self._add(f"{label(force)} Mc²/R", margin, self._numbers_row):
            self._tip = margin + force * pixels
            self._add("force on a point", margin, self._words_row)

    def _add_ends(self) -> None:
        """Name the ends of the bar."""
        quantity = QUANTITIES[self._painter.colour]
        size = self._letters.small.size
        row = self._top + self._bar_height / 2 + 0.35 * size
        self._taken.append((0.0, self._tip, 0.0, self._numbers_row))
        self._add(quantity.low, self._left - 0.6 * size, row, part=1.0)
        self._add(quantity.high, self._left + self._bar_width + 0.6 * size, row)

    def pace_lines(self, pace: Sequence[str]) -> list[Line]:
        """Return the words of the film's pace, at the right."""
        right = self._width - self._letters.margin
        lines: list[Line] = []
        for text, row in zip(pace, (self._numbers_row, self._words_row), strict=False):
            lines += self._line(text, right, row, part=1.0)
        return lines

    # ---- pictures

    def draw(self, picture: NDArray[np.uint8], image: Any, draw: Any) -> None:
        """Draw what does not change into the lowest rows of a `picture`, with Pillow's
        `image` of the same memory and its `draw`."""
        letters = self._letters
        theme = THEMES[self._painter.theme]
        top = len(picture) - letters.footer
        ground = theme.ground if self._painter.has_elastic_wall else theme.wall
        if letters.has_words:
            picture[top:, : self._width, :3] = ink(ground)
            self._draw_bar(picture[top + self._top :])
            if self._tip > letters.margin:
                row = top + self._top + self._bar_height / 2
                self._draw_arrow(image, row, ink(ground))
        for line in self.lines:
            line.draw(draw, 0.0, top)

    def _draw_bar(self, below: NDArray[np.uint8]) -> None:
        end = 1.0
        if self._painter.colour == "fringes":
            end = float(FRINGES)
        colours = self._painter.colours(np.linspace(0.0, end, self._bar_width))
        bar = slice(self._left, self._left + self._bar_width)
        below[: self._bar_height, bar, :3] = np.rint(255.0 * colours)

    def _draw_arrow(self, image: Any, row: float, ground: Ink) -> None:
        unit = self._letters.unit
        foot = np.array([[self._letters.margin, row]])
        vector = np.array([[self._tip - self._letters.margin, 0.0]])
        shaft, head = FORCE_ARROW
        corners = arrows(foot, vector, unit * shaft, unit * head)
        stamp(image, Mark(corners, self._letters.small.ink, 0.0), ground)
