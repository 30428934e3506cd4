"""Lines of text with subscripts, set with Pillow in the font that comes with matplotlib (it has Greek)."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path

import matplotlib
from PIL import ImageDraw, ImageFont

Ink = tuple[int, int, int]

# `_cm`, `_0` or `_{any thing}`: what follows an underscore is set as a subscript.
_SUBSCRIPT = re.compile(r"_(?:\{([^}]*)\}|(\w+))")
_SMALLER, _LOWER = 0.72, 0.22  # size of a subscript and its drop, as parts of the line's font size


@lru_cache(maxsize=32)
def font(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans in a size in pixels."""
    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    path = Path(matplotlib.get_data_path(), "fonts", "ttf", name)
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)


def _runs(line: str) -> list[tuple[str, bool]]:
    """The line in pieces (text, is a subscript)."""
    pieces, at = [], 0
    for match in _SUBSCRIPT.finditer(line):
        pieces += [(line[at : match.start()], False), (match[1] or match[2] or "", True)]
        at = match.end()
    return [piece for piece in [*pieces, (line[at:], False)] if piece[0]]


def width(line: str, size: float, bold: bool = False) -> float:
    """Width in pixels of a line set in `size`."""
    return sum(font(size * _SMALLER if sub else size, bold).getlength(text) for text, sub in _runs(line))


def draw_line(
    draw: ImageDraw.ImageDraw, at: tuple[float, float], line: str, size: float, ink: Ink, bold: bool = False
) -> None:
    """Set a line with the left end of its baseline at `at` (column, row)."""
    x, y = at
    for text, sub in _runs(line):
        face = font(size * _SMALLER if sub else size, bold)
        draw.text((x, y + (_LOWER * size if sub else 0.0)), text, fill=ink, font=face, anchor="ls")
        x += face.getlength(text)
