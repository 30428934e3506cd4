"""Colours of the themes, colour maps and their scales. NumPy only."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.mechanics.fields import FRINGES, QUANTITIES

Colour = tuple[float, float, float]  # sRGB, 0 to 1; CIELAB in maps
Colours = tuple[Colour, ...]
Ink = tuple[int, int, int]  # sRGB, 0 to 255

LEVELS = 512  # number of colours of a map
_BARE = 0.7  # fraction of the lightness range that is used in maps for lines and points


@dataclass(frozen=True)
class Theme:
    """The colours of a picture. `zero`, `low`, `high` define the maps in CIELAB; `low`
    and `high` begin at zero."""

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


THEMES: dict[str, Theme] = {
    "light": Theme(
        ground=(0.980, 0.980, 0.972),
        ink=(0.13, 0.14, 0.16),
        faint=(0.37, 0.38, 0.41),
        wall=(0.77, 0.76, 0.73),
        arrow=(0.10, 0.10, 0.12),
        velocity=(0.0, 0.502, 0.416),
        rule=(0.87, 0.87, 0.86),
        low=((76, 24, 30), (54, 56, 46), (32, 52, 36)),
        zero=(96, 0, 1),
        high=((76, -10, -24), (54, -2, -48), (32, 16, -56)),
        amount=((96, -1, 8), (77, 18, 46), (58, 48, 36), (39, 50, 0), (20, 34, -30)),
        fringe=((96, 0, 1), (20, 2, -8)),
    ),
    "dark": Theme(
        ground=(0.051, 0.055, 0.067),
        ink=(0.93, 0.93, 0.91),
        faint=(0.64, 0.65, 0.67),
        wall=(0.30, 0.33, 0.38),
        arrow=(0.97, 0.97, 0.95),
        velocity=(0.184, 0.78, 0.608),
        rule=(0.20, 0.21, 0.23),
        low=((38, 40, 40), (62, 48, 52), (86, 12, 46)),
        zero=(14, 0, -2),
        high=((38, -4, -34), (62, -14, -38), (86, -18, -18)),
        amount=((9, 12, -18), (31, 44, -14), (53, 56, 36), (75, 26, 66), (97, -8, 44)),
        fringe=((6, 0, 0), (94, -9, 3)),
    ),
}


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
