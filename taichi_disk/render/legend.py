"""The text around the disk: title at the upper left, changing lines at the upper right,
scales below."""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

from taichi_disk.fields import FRINGES, QUANTITIES
from taichi_disk.render.geometry import ARROW
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, Colour

Ink = tuple[int, int, int]

LEAST = 11.0  # smallest size of letters [px]
# Sizes [px] in a picture of 720 pixels; other pictures scale them, but not below LEAST.
_MARGIN, _HEADING, _SMALL = 20.0, 17.0, 13.0
_BAR_WIDTH, _BAR_HEIGHT = 300.0, 10.0
_LABELLED = 240  # smallest picture with room for text [px]
# largest height of the header over the picture's; lines that do not fit are left out
_MOST = 0.34
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_ARROWS, _ARROWS_SHORT = "wall force on one point", "wall force"
# largest length of the scale's arrow and of its bar, over the width of the picture
_ARROW, _LENGTH = 0.1, 0.2


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


def draw_line(
    draw: Any,
    at: tuple[float, float],
    line: str,
    size: float,
    ink: Ink,
    bold: bool = False,
) -> None:
    draw.text(at, line, fill=ink, font=font(size, bold), anchor="ls")


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


def label(value: float, percent: bool = False, signed: bool = False) -> str:
    """Return a value as `+5 %`, `0.02` or `2·10⁻⁷`."""
    if not value:
        return "0"
    text = f"{100 * value if percent else value:{'+' if signed else ''}.4g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}"
    return text.replace("-", "−") + (" %" if percent else "")


class Legend:
    """The text of one disk's picture of `size` x `size` pixels. Text that does not fit
    at 11 pixels is left out.

    Attributes:
        header, footer: heights above and below the disk's part of the picture [px].
        unit: factor of all sizes, 1 in a picture of 720 pixels.
    """

    def __init__(
        self,
        painter: Painter,
        size: int,
        title: Sequence[str],
        samples: Sequence[str],
        rows: int,
        enlarged: float = 1.0,
    ) -> None:
        """Lay out the text.

        `title`: constant lines; `samples`: the changing lines, or the longest of them;
        `rows`: number of changing lines in a picture; `enlarged`: factor for the size
        of the title's first line.
        """
        title = [*title[:-1], "    ".join([title[-1], *painter.remarks])]
        self.painter, self.unit, self._width, self._size = (
            painter,
            size / 720,
            size,
            size,
        )
        theme = THEMES[painter.theme]
        self._ground, self._ink, self._faint, self._rule = map(
            ink, (theme.ground, theme.ink, theme.faint, theme.rule)
        )
        self._small, self._heading = (
            max(_SMALL * self.unit, LEAST),
            max(_HEADING * self.unit, LEAST + 1),
        )
        self._first = enlarged * self._heading
        self._margin, self._leading = (
            max(_MARGIN * self.unit, 7.0),
            round(1.5 * self._small),
        )
        self._column = math.ceil(
            max(text_width(*self._set(line)) for line in samples) + self._margin
        )
        fits = (
            int((_MOST * size - self._margin) / self._leading)
            if size >= _LABELLED
            else 0
        )
        self._title, self._rows = self._wrapped(title)[:fits], min(rows, fits)
        count = max(len(self._title), self._rows)
        self.header = _even(self._margin + self._leading * count) if count else 0
        self.footer = (
            _even(2.0 * self._leading + (_BAR_HEIGHT + 20.0) * self.unit + 4.0)
            if fits
            else 0
        )

    def _wrapped(self, title: Sequence[str]) -> list[tuple[str, float, bool]]:
        width, lines = self._width - self._column - 2.0 * self._margin, []
        for k, line in enumerate(title):
            size, bold, now = (self._small, False, "") if k else (self._first, True, "")
            for part in line.split("    "):
                words = (
                    [part] if text_width(part, size, bold) <= width else part.split(" ")
                )
                for n, word in enumerate(words):
                    longer = f"{now}{' ' if n else '    '}{word}" if now else word
                    if now and text_width(longer, size, bold) > width:
                        lines.append((now, size, bold))
                        longer = word
                    now = longer
            lines.append((now, size, bold))
        return lines

    def _set(self, line: str) -> tuple[str, float, bool]:
        """Return text, size and boldness of a changing line. A leading `*` makes it
        large and bold."""
        return (
            line.removeprefix("*"),
            self._heading if line.startswith("*") else self._small,
            line.startswith("*"),
        )

    def _baseline(self, k: int) -> float:
        return self._margin + 0.72 * self._first + self._leading * k

    def still(self, scale: float) -> NDArray[np.uint8]:
        """Return the picture (size, size, 3) of title and scales, which do not change.
        `scale`: pixels per R."""
        image = Image.new("RGB", (self._width, self._size), self._ground)
        draw = ImageDraw.Draw(image)
        for k, (line, size, bold) in enumerate(self._title):
            draw_line(
                draw,
                (self._margin, self._baseline(k)),
                line,
                size,
                self._ink if bold else self._faint,
                bold,
            )
        if self.footer:
            self._draw_scales(draw, scale)
        return np.array(image)

    def below(self, width: int, scale: float) -> NDArray[np.uint8]:
        """Return the picture (footer, `width`, 3) of the scales that stand below
        several disks."""
        wide = copy(self)
        wide._width, wide._title = width, []
        return wide.still(scale)[self._size - self.footer :]

    def write(self, picture: NDArray[np.uint8], lines: Sequence[str]) -> None:
        if self._rows:
            patch = Image.new("RGB", (self._column, self.header), self._ground)
            for k, line in enumerate(lines[: self._rows]):
                text, size, bold = self._set(line)
                draw_line(
                    ImageDraw.Draw(patch),
                    (0.0, self._baseline(k)),
                    text,
                    size,
                    self._ink,
                    bold,
                )
            picture[: self.header, -self._column :] = np.asarray(patch)

    # ---- scales below the disk: a row with bar, arrow and length, a row with numbers,
    # and a row with words

    def _draw_scales(self, draw: Any, scale: float) -> None:
        top = round(self._size - self.footer + 12.0 * self.unit)
        height = max(round(_BAR_HEIGHT * self.unit), 6)
        numbers = top + height + 0.95 * self._leading
        left, right, row = self._margin, self._width - self._margin, top + height / 2
        if full := self.painter.full_force:
            pixels = ARROW * scale / full  # length of an arrow for a force of 1 Mc²/R
            force = round_below(_ARROW * self._size / pixels)
            ends, line = (left, left + force * pixels), f"{label(force)} Mc²/R"
            _, left = self._draw_length(draw, ends, row, line, numbers, arrow=True)
        length = round_below(_LENGTH * self._size / scale)
        line = f"{length:g} R".removeprefix("1 ")
        right, _ = self._draw_length(
            draw, (right - length * scale, right), row, line, numbers
        )
        free = 2.0 * (
            self._width / 2 - max(left, self._width - right) - 3.0 * self._small
        )
        self._draw_bar(
            draw, round(min(_BAR_WIDTH * self.unit, free)), top, height, numbers
        )
        quantity = QUANTITIES[self.painter.colour]
        # values of single triangles are larger
        line = quantity.label + " (averaged)" * (quantity.on != "points")
        line = f"{line}  [{quantity.unit}]" if quantity.unit else line
        if self.painter.colour == "fringes":
            line = (
                "difference of the principal stresses, one fringe"
                f" {label(self.painter.limit)} Mc²/R²"
            )
        whole = f"◂ {quantity.low}    {line}    {quantity.high} ▸"
        if quantity.low and text_width(whole, self._small) < self._width - 10:
            line = whole
        start, words = (
            (self._width - text_width(line, self._small)) / 2,
            numbers + self._leading,
        )
        if start > 0:
            draw_line(draw, (start, words), line, self._small, self._faint)
        if (
            full
            and self._margin + text_width(_ARROWS, self._small) < start - self._small
        ):
            draw_line(draw, (self._margin, words), _ARROWS, self._small, self._faint)
        elif full:
            behind = ends[1] + 0.4 * self._small, row + 0.36 * self._small
            draw_line(draw, behind, _ARROWS_SHORT, self._small, self._faint)

    def _draw_bar(
        self, draw: Any, width: int, top: int, height: int, numbers: float
    ) -> None:
        """Draw the colour scale. A pointed end means that all values beyond it have the
        same colour."""
        painter, left = self.painter, (self._width - width) // 2
        fringes, percent = painter.colour == "fringes", painter.colour == "strain"
        limit = float(FRINGES) if fringes else painter.limit
        least = -limit if painter.signed else 0.0
        across = np.linspace(0.0, limit if fringes else 1.0, width, dtype=np.float64)
        colours = [ink(colour) for colour in painter.colours(across)]
        bottom, ends = top + height - 1, left + width - 1
        if not painter.signed:  # the pale end of the map needs a border
            draw.rectangle(
                [left - 1, top - 1, ends + 1, bottom + 1], outline=self._rule
            )
        for k, colour in enumerate(colours):
            draw.line([(left + k, top), (left + k, bottom)], fill=colour)
        for edge, way, colour in (
            (left - 1, -1, colours[0]),
            (ends + 1, 1, colours[-1]),
        ):
            if not fringes and (painter.signed or way > 0):
                tip = (edge + 0.8 * way * height, (top + bottom) / 2)
                draw.polygon([(edge, top), (edge, bottom), tip], fill=colour)
        ticks = (
            [float(k) for k in range(FRINGES + 1)]
            if fringes
            else ticks_to(limit, painter.signed)
        )
        labels = {tick: label(tick, percent, painter.signed) for tick in ticks}
        if not fringes:
            labels |= {
                tick: f"{'≥' if tick > 0 else '≤'} {labels[tick]}"
                for tick in (-limit, limit)
                if tick in labels
            }
        widest = (
            max(text_width(line, self._small) for line in labels.values()) + self._small
        )
        choices = (ticks, [ticks[0], 0.0, ticks[-1]], [ticks[0], ticks[-1]])
        numbered = next(
            (some for some in choices if widest * (len(some) - 1) < width), ticks[-1:]
        )
        for tick, line in labels.items():
            x = left + (width - 1) * (tick - least) / (limit - least)
            draw.line(
                [(x, top + height), (x, top + height + 3 * self.unit)], fill=self._faint
            )
            if tick in numbered:
                start = x - text_width(line.removesuffix(" %"), self._small) / 2
                draw_line(draw, (start, numbers), line, self._small, self._faint)

    def _draw_length(
        self,
        draw: Any,
        ends: tuple[float, float],
        row: float,
        line: str,
        numbers: float,
        arrow: bool = False,
    ) -> tuple[float, float]:
        (x0, x1), head = ends, max(4.0 * self.unit, 3.0)
        draw.line(
            [(x0, row), (x1 - head * arrow, row)],
            fill=self._ink,
            width=max(round(1.8 * self.unit), 1),
        )
        if arrow:
            draw.polygon(
                [(x1 - 2 * head, row - head), (x1 - 2 * head, row + head), (x1, row)],
                fill=self._ink,
            )
        else:
            for x in ends:
                draw.line(
                    [(x, row - head), (x, row + head)],
                    fill=self._ink,
                    width=max(round(1.2 * self.unit), 1),
                )
        width = text_width(line, self._small)
        start = min(
            max((x0 + x1 - width) / 2, self._margin), self._width - self._margin - width
        )
        draw_line(draw, (start, numbers), line, self._small, self._faint)
        return min(x0, start), max(x1, start + width)


def _even(pixels: float) -> int:
    return 2 * math.ceil(pixels / 2)
