"""The words of pictures: title at the upper left, changing words at the upper right,
scales of colours and forces and the pace of the film below.

Words stand in the corners beside a round disk. Where a body reaches the corners, they
stand in a band above it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.mechanics.fields import FRINGES, QUANTITIES
from taichi_disk.pictures.panel import factored
from taichi_disk.pictures.plot import RAISED
from taichi_disk.pictures.render.letters import (
    BAR_BELOW,
    BAR_HEIGHT,
    LEADING,
    LEAST,
    Box,
    Face,
    Letters,
    Line,
    even,
)
from taichi_disk.pictures.render.marks import Mark, arrows, stamp
from taichi_disk.pictures.render.moments import Caption, Shots
from taichi_disk.pictures.render.painter import ARROW, FORCE_ARROW, Painter
from taichi_disk.pictures.render.palette import THEMES, Ink, ink

_MOST_BESIDE = 0.5  # largest width of changing words over the picture's
_MOST_BELOW = 0.36  # that of words below a disk in flight
# width of the bar of colours over the picture's, and the least one
_BAR_WIDTH = 0.34
_MIN_BAR_WIDTH = 0.08
_BESIDE_BAR = 9.5  # room for words beside the bar, in units of the size of letters
_ARROW = 0.1  # largest length of the scale's arrow over the height of the picture
_GAP = 0.5  # least distance of two words, in units of the size of their letters


# ---- words above


def caption_lines(letters: Letters, caption: Caption, width: int) -> list[Line]:
    """Return the changing words at the upper right of a picture of `width` [px]."""
    if not letters.footer:
        return []
    first, *others = caption.lines
    words = [(first, letters.small)]
    if letters.are_few and (others or caption.result):
        words = []
    words += zip(others, (letters.motion, letters.text), strict=False)
    words += [(text, letters.text) for text in caption.note.split()]
    if caption.result:
        words.append((caption.result, letters.result))
    return letters.stacked(words, width - letters.margin, part=1.0)


def remark_lines(letters: Letters, caption: Caption, width: int) -> list[Line]:
    """Return the remarks of a caption, above the scales at the right of a picture of
    `width` [px]."""
    if not letters.footer:
        return []
    face = letters.small
    texts = caption.remarks[:2]
    if max(map(face.width, texts), default=0.0) > _MOST_BELOW * width:
        texts = caption.remarks[2:]
    row = letters.height - letters.footer - 0.85 * face.size
    lines: list[Line] = []
    for text in reversed(texts):
        lines.insert(0, Line(text, face, width - letters.margin, row, part=1.0))
        row -= LEADING * face.size
    return lines


def samples(captions: Shots) -> list[Caption]:
    """Return the first and the middle caption, and the last of each kind."""
    kinds = {(one.note, one.result): one for one in captions}
    middle = captions[len(captions) // 2]
    return [captions[0], middle, *kinds.values()]


def fitting_letters(letters: Letters, words: Sequence[Shots], width: int) -> Letters:
    """Return letters whose changing words leave room for others in pictures of `width`
    [px]. `words`: captions of each disk."""
    most = 1.0
    for captions in words:
        for one in samples(captions):
            for line in caption_lines(letters, one, width):
                most = min(most, _MOST_BESIDE * width / (line.x - line.left))
    return replace(letters, factor=most * letters.factor)


@dataclass(frozen=True)
class Legend:
    """The words of one disk's picture: lines that do not change, boxes of all words
    above the scales, and the height that words need above the disk [px]."""

    lines: Sequence[Line] = ()
    boxes: Sequence[Box] = ()
    header: int = 0


@dataclass(frozen=True)
class Title:
    """Constant words of one disk's picture: heading, parameters in the order of their
    importance, and remarks. `enlarged`: factor for the size of the heading."""

    heading: str
    parameters: Sequence[str] = ()
    remarks: Sequence[str] = ()
    enlarged: float = 1.0


def legend(
    letters: Letters,
    width: int,
    title: Title,
    captions: Shots,
    count: int | None,
) -> Legend:
    """Set the words of a picture of `width` [px] in a band above the disk, with `count`
    parameters; None: in its corners, with all of them."""
    if not letters.footer:
        return Legend()
    changing: list[Line] = []
    for one in samples(captions):
        changing += caption_lines(letters, one, width)
    column = max(line.x - line.left for line in changing)
    room = width - column - 3.0 * letters.margin
    widest = max(map(letters.heading.width, title.heading.split()))
    size = letters.heading.size * min(title.enlarged, room / widest)
    heading = letters.heading._replace(size=max(size, LEAST))
    words = _wrapped(title.heading.split(), " ", heading, room)
    parts = list(title.parameters[:count])
    if count is not None:
        words += _wrapped([*parts, *title.remarks], "    ", letters.faint, room)
    else:
        words += [(part, letters.faint) for part in parts]
    lines = letters.stacked(words, letters.margin)
    lines = [line for line in lines if line.face.width(line.text) <= room]
    above = [*lines, *changing]
    if count is None:
        above = [line for line in lines if line.face.bold]
        if title.remarks:
            face = letters.small._replace(ink=letters.faint.ink)
            baseline = letters.height - letters.footer - 0.85 * face.size
            text = "    ".join(title.remarks)
            lines.append(Line(text, face, letters.margin, baseline))
    lowest = max(line.baseline for line in above)
    header = even(lowest + 0.6 * letters.text.size)
    return Legend(lines, [line.box for line in [*lines, *changing]], header)


def _wrapped(
    parts: Sequence[str], gap: str, face: Face, room: float
) -> list[tuple[str, Face]]:
    """Join parts into lines that are not wider than `room` [px]. A part that is too
    wide is broken between its words."""
    lines: list[tuple[str, Face]] = []
    for part in parts:
        longer = part
        if lines:
            longer = f"{lines[-1][0]}{gap}{part}"
        if lines and face.width(longer) <= room:
            lines[-1] = longer, face
        elif gap != " " and face.width(part) > room:
            lines += _wrapped(part.split(), " ", face, room)
        else:
            lines.append((part, face))
    return lines


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
    ) -> None:
        """
        Args:
            width: of all disks together [px].
            scale: pixels per R.
        """
        self._painter = painter
        self._width = width
        self._letters = letters
        self._top = round(BAR_BELOW * letters.unit)
        self._bar_height = max(round(BAR_HEIGHT * letters.unit), 6)
        size = letters.small.size
        self._numbers_row = self._top + self._bar_height + 1.35 * size
        self._words_row = self._numbers_row + 1.55 * size
        self._tip = letters.margin  # column of the tip of the arrow [px]
        self.lines: list[Line] = []
        room = width - 2.0 * (letters.margin + _BESIDE_BAR * size)
        self._bar_width = round(
            max(min(_BAR_WIDTH * width, room), _MIN_BAR_WIDTH * width)
        )
        self._left = (width - self._bar_width) // 2
        if letters.footer and not letters.are_few:
            self._add_colours()
            self._add_force(scale)
            self._add_ends()

    # ---- words

    def _line(self, text: str, x: float, row: float, part: float) -> list[Line]:
        """Return the line if its place is free, else nothing."""
        line = Line(text, self._letters.small, x, row, part)
        left, right, _, _ = line.box
        margin = 0.5 * self._letters.margin
        gap = _GAP * line.face.size
        others = [other.box for other in self.lines if other.baseline == row]
        is_free = all(
            right + gap < first or last + gap < left for first, last, _, _ in others
        )
        if is_free and margin <= left and right <= self._width - margin:
            return [line]
        return []

    def _add(self, text: str, x: float, row: float, part: float = 0.0) -> bool:
        """Add a text if its place is free, and return whether it is."""
        found = self._line(text, x, row, part)
        self.lines += found
        return bool(found)

    def _add_colours(self) -> None:
        painter = self._painter
        quantity = QUANTITIES[painter.colour]
        name = quantity.label
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
        """Name the ends of the bar, if there is room beside the arrow."""
        quantity = QUANTITIES[self._painter.colour]
        size = self._letters.small.size
        row = self._top + self._bar_height / 2 + 0.35 * size
        left = self._left - 0.6 * size
        if left - self._letters.small.width(quantity.low) > self._tip + size:
            self._add(quantity.low, left, row, part=1.0)
        self._add(quantity.high, self._left + self._bar_width + 0.6 * size, row)

    def pace_lines(self, pace: Sequence[str]) -> list[Line]:
        """Return the words of the film's pace, at the right."""
        right = self._width - self._letters.margin
        rows = [self._numbers_row, self._words_row]
        if self._letters.are_few:
            pace = pace[1:]
            rows = [1.5 * self._letters.small.size]
        lines: list[Line] = []
        for text, row in zip(pace, rows, strict=False):
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
        picture[top:, : self._width, :3] = ink(ground)
        if not letters.are_few:
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
        mark = Mark(corners, self._letters.small.ink, 0.0)
        stamp(image, mark, ground, slice(0, self._width))
