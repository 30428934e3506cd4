"""Lines of text with subscripts, set with Pillow in the font that comes with matplotlib (it has Greek)."""

from __future__ import annotations

import re
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from PIL import ImageFont

Ink = tuple[int, int, int]

_SUBSCRIPT = re.compile(r"_(?:\{([^}]*)\}|(\w+))")  # `_cm`, `_0` or `_{any thing}`
_SMALLER, _LOWER = 0.72, 0.22  # size of a subscript and its drop, as parts of the line's font size
_LEAST = 10.0  # pixels of a subscript, so that it can be read


@lru_cache(maxsize=32)
def font(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans in a size in pixels."""
    spec = find_spec("matplotlib")  # to import it takes 0.3 s
    assert spec and spec.origin
    path = Path(spec.origin).parent / "mpl-data/fonts/ttf" / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf")
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)


def _runs(line: str, size: float, bold: bool) -> list[tuple[str, ImageFont.FreeTypeFont, float]]:
    """The line in pieces: text, font, drop below the baseline."""
    plain, small = font(size, bold), font(max(size * _SMALLER, min(size, _LEAST)), bold)
    pieces, at = [], 0
    for match in _SUBSCRIPT.finditer(line):
        pieces += [(line[at : match.start()], plain, 0.0), (match[1] or match[2] or "", small, _LOWER * size)]
        at = match.end()
    return [*pieces, (line[at:], plain, 0.0)]


def width(line: str, size: float, bold: bool = False) -> float:
    """Width in pixels of a line set in `size`."""
    return sum(face.getlength(text) for text, face, _ in _runs(line, size, bold))


def draw_line(draw: Any, at: tuple[float, float], line: str, size: float, ink: Ink, bold: bool = False) -> None:
    """Set a line with the left end of its baseline at `at` (column, row); `draw`: Pillow's ImageDraw or the like."""
    x, y = at
    for text, face, drop in _runs(line, size, bold):
        draw.text((x, y + drop), text, fill=ink, font=face, anchor="ls")
        x += face.getlength(text)
