"""Lines of text, set with Pillow in the font that comes with matplotlib (it has Greek)."""

from __future__ import annotations

from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from PIL import ImageFont

Ink = tuple[int, int, int]


@lru_cache(maxsize=32)
def font(size: float, bold: bool = False) -> ImageFont.FreeTypeFont:
    """DejaVu Sans in a size in pixels."""
    spec = find_spec("matplotlib")  # to import it takes 0.3 s
    assert spec and spec.origin
    path = Path(spec.origin).parent / "mpl-data/fonts/ttf" / ("DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf")
    return ImageFont.truetype(path, size, layout_engine=ImageFont.Layout.BASIC)


def width(line: str, size: float, bold: bool = False) -> float:
    """Width in pixels of a line set in `size`."""
    return font(size, bold).getlength(line)


def draw_line(draw: Any, at: tuple[float, float], line: str, size: float, ink: Ink, bold: bool = False) -> None:
    """Set a line with the left end of its baseline at `at` (column, row); `draw`: Pillow's ImageDraw or the like."""
    draw.text(at, line, fill=ink, font=font(size, bold), anchor="ls")
