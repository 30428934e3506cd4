"""The scales below the disks: colours, forces, and the pace of the film."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any

import numpy as np

from taichi_disk.fields import FRINGES, QUANTITIES
from taichi_disk.output.panel import RAISED, factored
from taichi_disk.render.geometry import ARROW
from taichi_disk.render.legend import (
    BAR_BELOW,
    BAR_HEIGHT,
    Box,
    Face,
    Letters,
    Line,
    ink,
)
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES

# width of the bar over that of the picture, and the least one
_BAR_WIDTH = 0.34
_MIN_BAR_WIDTH = 0.08
_ARROW = 0.1  # largest length of the scale's arrow over the height of the picture
_GAP = 0.5  # least distance of two words, in units of the size of their letters


def round_below(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that does not exceed
    `value` > 0."""
    decade = 10.0 ** math.floor(math.log10(value))
    steps = [step for step in (0.5, 1.0, 2.0, 5.0) if step * decade <= value]
    return decade * steps[-1]


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
        height: [px].
        lines: the words that do not change.
    """

    def __init__(
        self,
        painter: Painter,
        size: tuple[int, int],
        letters: Letters,
        scale: float,
        paces: Collection[Sequence[str]] = (),
    ) -> None:
        """
        Args:
            size: (width, height) [px].
            scale: pixels per R.
            paces: all texts of which `pace_lines` will be asked.
        """
        self._painter = painter
        self._width, self.height = size
        self._letters = letters
        theme = THEMES[painter.theme]
        self._ground = ink(theme.ground if painter.has_elastic_wall else theme.wall)
        self._face = Face(letters.small, ink(theme.ink))
        self._top = round(BAR_BELOW * letters.unit)
        self._bar_height = max(round(BAR_HEIGHT * letters.unit), 6)
        self._numbers_row = self._top + self._bar_height + 1.35 * letters.small
        self._words_row = self._numbers_row + 1.55 * letters.small
        self.lines: list[Line] = []
        self._taken: list[Box] = []
        self._pace_rows: list[float] = []
        self._tip = letters.margin  # column of the tip of the arrow [px]
        paces_wide = [self._face.width(lines[0]) for lines in paces if lines]
        beside = letters.margin + max(paces_wide, default=0.0) + 2.5 * letters.small
        width = min(_BAR_WIDTH * self._width, self._width - 2.0 * beside)
        self._bar_width = round(max(width, _MIN_BAR_WIDTH * self._width))
        self._left = (self._width - self._bar_width) // 2
        if self.height:
            self._add_colours()
            self._pace_rows = self._reserve_pace_rows(paces)
            self._add_force(scale)
            self._add_ends()

    # ---- words

    def _add(self, text: str, x: float, row: float, part: float = 0.0) -> bool:
        """Add a text with the fraction `part` of its width at the left of `x`, unless
        it would touch another. Return whether it is there."""
        line = Line(text, self._face, x - part * self._face.width(text), row)
        if not self._reserve(line):
            return False
        self.lines.append(line)
        return True

    def _reserve(self, line: Line) -> bool:
        """Reserve the place of a line if it is free, and return whether it is."""
        gap = _GAP * self._face.size
        left, right, top, bottom = line.box
        margin = 0.5 * self._letters.margin
        if left < margin or right > self._width - margin:
            return False
        for first, last, upper, lower in self._taken:
            is_beside = right + gap < first or last + gap < left
            if not is_beside and top < lower and upper < bottom:
                return False
        self._taken.append(line.box)
        return True

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

    def _reserve_pace_rows(self, paces: Collection[Sequence[str]]) -> list[float]:
        """Reserve room at the right for the lines that tell the pace of the film, and
        return the baselines [px] that have room for the longest text."""
        rows = []
        for k, row in enumerate((self._numbers_row, self._words_row)):
            texts = [lines[k] for lines in paces if len(lines) > k]
            longest = max(texts, key=self._face.width, default="")
            if self._reserve(self._pace_line(longest, row)):
                rows.append(row)
        return rows

    def _pace_line(self, text: str, row: float) -> Line:
        right = self._width - self._letters.margin
        return Line(text, self._face, right, row, ends=True)

    def pace_lines(self, pace: Sequence[str]) -> list[Line]:
        pairs = zip(pace, self._pace_rows, strict=False)
        return [self._pace_line(text, row) for text, row in pairs]

    def _add_force(self, scale: float) -> None:
        """Choose the arrow of a force, and add its words."""
        full = self._painter.full_force
        margin = self._letters.margin
        if not full:
            return
        pixels = ARROW * scale / full  # length of an arrow for a force of 1 Mc²/R
        force = round_below(_ARROW * 720.0 * self._letters.unit / pixels)
        if self._add(f"{label(force)} Mc²/R", margin, self._numbers_row):
            self._tip = margin + force * pixels
            self._add("force on a point", margin, self._words_row)

    def _add_ends(self) -> None:
        """Name the ends of the bar."""
        quantity = QUANTITIES[self._painter.colour]
        row = self._top + self._bar_height / 2 + 0.35 * self._face.size
        beside = 0.6 * self._face.size
        self._taken.append((0.0, self._tip, 0.0, self._numbers_row))
        self._add(quantity.low, self._left - beside, row, part=1.0)
        self._add(quantity.high, self._left + self._bar_width + beside, row)

    # ---- pictures

    def draw(self, draw: Any, top: float) -> None:
        """Draw what does not change, from the row `top` down."""
        if not self.height:
            return
        box = (0, top, self._width, top + self.height)
        draw.rectangle(box, fill=self._ground)
        self._draw_bar(draw, top + self._top)
        if self._tip > self._letters.margin:
            self._draw_arrow(draw, top + self._top + self._bar_height / 2)
        for line in self.lines:
            line.draw(draw, 0.0, top)

    def _draw_bar(self, draw: Any, top: float) -> None:
        end = 1.0
        if self._painter.colour == "fringes":
            end = float(FRINGES)
        values = np.linspace(0.0, end, self._bar_width)
        bottom = top + self._bar_height - 1
        for k, colour in enumerate(self._painter.colours(values)):
            x = self._left + k
            draw.line([(x, top), (x, bottom)], fill=ink(colour))

    def _draw_arrow(self, draw: Any, row: float) -> None:
        unit = self._letters.unit
        head = max(6.0 * unit, 3.0)
        neck = self._tip - 1.6 * head
        shaft = [(self._letters.margin, row), (neck, row)]
        draw.line(shaft, fill=self._face.ink, width=max(round(4.0 * unit), 1))
        corners = [(neck, row - head), (neck, row + head), (self._tip, row)]
        draw.polygon(corners, fill=self._face.ink)
