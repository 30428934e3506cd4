"""The scales below the disks: colours, forces, and the pace of the film."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from taichi_disk.fields import FRINGES, QUANTITIES
from taichi_disk.output.panel import factored
from taichi_disk.render.geometry import ARROW
from taichi_disk.render.legend import (
    BAR_BELOW,
    BAR_HEIGHT,
    MARGIN,
    Letters,
    Line,
    ink,
    text_width,
)
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES

_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_BAR_WIDTH = 280.0  # in a picture of 720 pixels [px]
_ARROWS = "force on a point"
_ARROW = 0.1  # largest length of the scale's arrow over the height of the picture


def round_below(value: float) -> float:
    """Return the largest of 1, 2 and 5 times a power of ten that does not exceed
    `value` > 0."""
    decade = 10.0 ** math.floor(math.log10(value))
    return float(
        decade * max(step for step in (0.5, 1.0, 2.0, 5.0) if step * decade <= value)
    )


def ticks_to(limit: float, signed: bool) -> list[float]:
    count = 3 if f"{limit:e}"[:3] in ("1.5", "3.0", "6.0") else 2
    return [limit * k / count for k in range(-count if signed else 0, count + 1)]


def label(value: float, signed: bool = False) -> str:
    """Return a value as `+5`, `0.02` or `2·10⁻⁷`."""
    if not value:
        return "0"
    text = f"{value:+.4g}" if signed else f"{value:.4g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}"
    return text.replace("-", "−")


class Scales:
    """The scale of colours, that of forces, and the pace of the film: in the body of a
    rigid wall, or below an elastic one. Scales are shared by compared disks."""

    def __init__(
        self,
        painter: Painter,
        size: tuple[int, int],
        letters: Letters,
        paces: Collection[Sequence[str]] = (),
    ) -> None:
        """`size`: (width, height) [px]; `paces`: all that `write` will write."""
        self._painter = painter
        self._width, self._height = size
        self._unit = letters.unit
        self._small = letters.small
        self._margin = max(MARGIN * letters.unit, 7.0)
        self._top = round(BAR_BELOW * letters.unit)
        self._bar_height = max(round(BAR_HEIGHT * letters.unit), 6)
        self._numbers = self._top + self._bar_height + 1.35 * self._small
        self._words = self._numbers + 1.55 * self._small
        theme = THEMES[painter.theme]
        self._ink = ink(theme.ink)
        self._ground = ink(theme.ground if painter.has_elastic_wall else theme.wall)
        self._pace: Sequence[str] = ()
        self._written: list[Line] = []
        first = [lines[0] for lines in paces if lines]
        self._first_pace = max(
            (text_width(one, self._small) for one in first), default=0.0
        )
        second = list(chain.from_iterable(lines[1:] for lines in paces))
        self._second_pace = max(
            (text_width(one, self._small) for one in second), default=0.0
        )
        self._has_second = True

    def still(self, scale: float) -> NDArray[np.uint8]:
        """Return the picture (height, width, 3) of the scales. `scale`: pixels per
        R."""
        image = Image.new("RGB", (self._width, self._height), self._ground)
        if not self._height:
            return np.array(image)
        draw = ImageDraw.Draw(image)
        tip = left = self._margin
        if self._painter.full_force:
            tip, left = self._draw_force(draw, scale)
        beside = max(left, self._margin + self._first_pace)
        # half of the first and of the last number stand beside the bar
        free = self._width - 2.0 * beside - 5.0 * self._small
        least = 0.2 * _BAR_WIDTH * self._unit
        width = round(max(min(_BAR_WIDTH * self._unit, free), least))
        self._draw_bar(draw, width, tip)
        return np.array(image)

    def write(self, picture: NDArray[np.uint8], pace: Sequence[str]) -> None:
        """Replace the pace in `picture` (height, width, 3)."""
        if pace == self._pace:
            return
        self._pace = pace
        for line in self._written:
            picture[line.pixels] = self._ground
        right = self._width - self._margin
        rows = [self._numbers]
        if self._has_second:
            rows.append(self._words)
        self._written = [
            self._line(text, right, row, ends=True)
            for text, row in zip(pace, rows, strict=False)
        ]
        for line in self._written:
            line.write(picture)

    def _line(self, text: str, x: float, row: float, ends: bool = False) -> Line:
        return Line(text, self._small, self._ink, x, row, ends=ends)

    def _draw_force(self, draw: Any, scale: float) -> tuple[float, float]:
        """Draw the arrow of a force, and return the columns at which the arrow and its
        words end."""
        full = self._painter.full_force
        pixels = ARROW * scale / full  # length of an arrow for a force of 1 Mc²/R
        force = round_below(_ARROW * 720.0 * self._unit / pixels)
        row = self._top + self._bar_height / 2
        tip = self._margin + force * pixels
        head = max(6.0 * self._unit, 3.0)
        neck = tip - 1.6 * head
        shaft = [(self._margin, row), (neck, row)]
        draw.line(shaft, fill=self._ink, width=max(round(4.0 * self._unit), 1))
        corners = [(neck, row - head), (neck, row + head), (tip, row)]
        draw.polygon(corners, fill=self._ink)
        number = self._line(f"{label(force)} Mc²/R", self._margin, self._numbers)
        number.draw(draw)
        return tip, number.box[1]

    def _draw_names(self, draw: Any, name: str) -> None:
        """Write what the colours mean; what the arrow means and whether motion is slow,
        only if there is room for it."""
        width = text_width(name, self._small)
        start = (self._width - width) / 2
        end = self._width - self._margin - self._second_pace - self._small
        if start + width > end:
            self._has_second = False
        self._line(name, start, self._words).draw(draw)
        arrow = self._line(_ARROWS, self._margin, self._words)
        if self._painter.full_force and arrow.box[1] + self._small < start:
            arrow.draw(draw)

    # ---- colours

    def _draw_bar(self, draw: Any, width: int, start_of_room: float) -> None:
        """Draw the colour scale. A pointed end means that all values beyond it have the
        same colour. The words beside it are left out without room."""
        painter = self._painter
        left = (self._width - width) // 2
        is_fringes = painter.colour == "fringes"
        quantity = QUANTITIES[painter.colour]
        limit = float(FRINGES) if is_fringes else painter.limit
        least = -limit if painter.signed else 0.0
        self._draw_colours(draw, left, width, limit if is_fringes else 1.0)
        name = quantity.short or quantity.label
        unit = "%" if painter.colour == "strain" else quantity.unit
        words, factor = factored(f"{name} [{unit}]", limit)
        if painter.colour == "strain":
            words = f"{name} [%]"
            factor = 0.01
        if is_fringes:
            words = f"fringes of {label(painter.limit)} Mc²/R²"
            factor = 1.0
        numbers = self._numbers_of(limit, factor, width)
        for tick, text in numbers:
            x = left + (width - 1) * (tick - least) / (limit - least)
            bottom = self._top + self._bar_height
            draw.line([(x, bottom), (x, bottom + 4 * self._unit)], fill=self._ink)
            number_start = x - text_width(text, self._small) / 2
            self._line(text, number_start, self._numbers).draw(draw)
        self._draw_names(draw, words)
        row = self._top + self._bar_height / 2 + 0.35 * self._small
        beside = self._bar_height + 0.4 * self._small
        low = self._line(quantity.low, left - beside, row, ends=True)
        high = self._line(quantity.high, left + width + beside, row)
        end_of_room = self._width - self._margin
        if low.box[0] > start_of_room and high.box[1] < end_of_room:
            low.draw(draw)
            high.draw(draw)

    def _draw_colours(self, draw: Any, left: int, width: int, end: float) -> None:
        painter = self._painter
        top = self._top
        bottom = top + self._bar_height - 1
        right = left + width - 1
        colours = [ink(one) for one in painter.colours(np.linspace(0.0, end, width))]
        for k, colour in enumerate(colours):
            draw.line([(left + k, top), (left + k, bottom)], fill=colour)
        if painter.colour == "fringes":
            return
        middle = (top + bottom) / 2
        reach = 0.8 * self._bar_height
        tip = (right + 1 + reach, middle)
        draw.polygon([(right + 1, top), (right + 1, bottom), tip], fill=colours[-1])
        if painter.signed:
            tip = (left - 1 - reach, middle)
            draw.polygon([(left - 1, top), (left - 1, bottom), tip], fill=colours[0])

    def _numbers_of(
        self, limit: float, factor: float, width: int
    ) -> list[tuple[float, str]]:
        """Return the ticks and their texts, as many as have room."""
        painter = self._painter
        if painter.colour == "fringes":
            return [(float(k), str(k)) for k in range(FRINGES + 1)]
        ticks = ticks_to(limit, painter.signed)
        bounds = {limit: "≥ ", -limit: "≤ "}
        texts = {
            tick: bounds.get(tick, "") + label(tick / factor, painter.signed)
            for tick in ticks
        }
        widest = max(text_width(text, self._small) for text in texts.values())
        if (widest + self._small) * (len(ticks) - 1) > width:
            ticks = sorted({ticks[0], 0.0, ticks[-1]})
        if (widest + self._small) * (len(ticks) - 1) > width:
            ticks = ticks[-1:]
        return [(tick, texts[tick]) for tick in ticks]
