"""Colours of the themes, colour maps and their scales. NumPy only."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.mechanics.fields import FRINGES, QUANTITIES

Colour = Sequence[float]  # sRGB, 0 to 1; CIELAB in maps
Colours = Sequence[Colour]
Ink = tuple[int, int, int]  # sRGB, 0 to 255

LEVELS = 512  # number of colours of a map
_BARE = 0.7  # fraction of the lightness range that is used in maps for lines and points


@dataclass(frozen=True)
class Theme:
    """The colours of a picture, from themes.json. `zero`, `low`, `high` define the maps
    in CIELAB; `low` and `high` begin at zero."""

    ground: Colour
    ink: Colour  # important text, outlines
    faint: Colour  # other text
    wall: Colour  # body of a rigid wall, and surface layer of an elastic wall
    arrow: Colour  # arrows of forces
    velocity: Colour  # arrow, number and curve of the velocity
    rule: Colour  # grid lines of a graph
    low: Colours
    zero: Colour
    high: Colours
    amount: Colours
    fringe: Colours


_TABLE = json.loads(files(__package__).joinpath("themes.json").read_bytes())
THEMES = {name: Theme(**colours) for name, colours in _TABLE.items()}


def map_kind(quantity: str) -> str:
    known = {"pressure": "pressure", "rate": "pressure", "fringes": "fringes"}
    return known.get(quantity, "stretch" if QUANTITIES[quantity].signed else "amount")


@lru_cache
def colour_map(theme: str, kind: str, bare: bool = False) -> NDArray[np.float32]:
    """Return a colour map (LEVELS, 3) in sRGB, uniform in CIELAB's lightness, lowest
    value first.

    Args:
        kind: "pressure" (compression, the positive values, is blue), "stretch"
            (compression, the negative values, is blue; both have zero in the middle),
            "amount" (from zero up), "fringes" (from dark field to light).
        bare: whether the map is for lines and points on the background; zero then
            differs from the background.
    """
    look = THEMES[theme]
    if kind == "fringes":
        return lab_to_srgb(_curve(look.fringe, LEVELS)).astype(np.float32)
    if kind == "amount":
        lab = _curve(look.amount, LEVELS)
    else:
        sides = (look.low, look.high) if kind == "pressure" else (look.high, look.low)
        below, above = (_curve((look.zero, *side), LEVELS // 2) for side in sides)
        lab = np.concatenate([below[::-1], above])
    if bare:
        lab[:, 0] = lab[-1, 0] + _BARE * (lab[:, 0] - lab[-1, 0])
        lab[:, 1:] *= 0.9  # stay within the colours that screens can show
    return lab_to_srgb(lab).astype(np.float32)


def _curve(nodes: Colours, count: int) -> NDArray[np.float64]:
    known = np.linspace(0.0, 1.0, len(nodes))[:, None]
    powers = np.arange(len(nodes))
    coefficients = np.linalg.solve(known**powers, np.array(nodes, dtype=float))
    return np.linspace(0.0, 1.0, count)[:, None] ** powers @ coefficients


_WHITE = np.array([0.95047, 1.0, 1.08883])  # white point D65
_XYZ_TO_RGB = np.array(
    [
        [3.2404542, -1.5371385, -0.4985314],
        [-0.9692660, 1.8760108, 0.0415560],
        [0.0556434, -0.2040259, 1.0572252],
    ]
)


def lab_to_srgb(lab: NDArray[np.float64]) -> NDArray[np.float64]:
    """Convert CIELAB (..., 3) to sRGB (IEC 61966-2-1), clipped to the gamut."""
    lightness, green_red, blue_yellow = np.moveaxis(lab, -1, 0)
    fy = (lightness + 16.0) / 116.0
    f = np.stack([fy + green_red / 500.0, fy, fy - blue_yellow / 200.0], axis=-1)
    straight = (f - 4.0 / 29.0) * 3.0 * (6.0 / 29.0) ** 2
    xyz = _WHITE * np.where(f > 6.0 / 29.0, f**3, straight)
    linear = np.clip(xyz @ _XYZ_TO_RGB.T, 0.0, 1.0)
    power = 1.055 * linear ** (1.0 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, power)


def ink(colour: Any) -> Ink:
    """Return Pillow's form of a colour."""
    red, green, blue = (round(255 * part) for part in colour)
    return red, green, blue


# ---- scales

FULL_COLOUR = 98.0  # percentile of the values at the end of the colour scale
STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)


def full_scale(values: NDArray[np.floating[Any]], colour: str) -> float:
    """Return the FULL_COLOUR percentile of |values|, rounded; for fringes, the stress
    difference of one fringe."""
    largest = float(np.percentile(np.abs(values), FULL_COLOUR))
    return round_near(largest / FRINGES if colour == "fringes" else largest)


def round_near(value: float) -> float:
    """Return the round number (a power of ten times one of STEPS) whose ratio to
    `value` is closest to 1."""
    value = max(value, 1e-12)
    decade = 10.0 ** math.floor(math.log10(value))
    return float(
        decade * min(STEPS, key=lambda step: abs(math.log(step * decade / value)))
    )
