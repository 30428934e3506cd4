"""Where a scale of colours or of arrows ends, where its ticks lie, and how its numbers are written."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from taichi_disk.fields import FRINGES, QUANTITIES

FULL_COLOUR = 98.0  # percentile of the values that has the full colour
_STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def full_scale(values: NDArray[np.float64], colour: str) -> float:
    """A round number near the largest |value| but for a few; of fringes: the difference that makes FRINGES of them."""
    largest = float(np.percentile(np.abs(values), FULL_COLOUR)) if len(values) else 0.0
    return round_near(largest / FRINGES if colour == "fringes" else largest)


def round_near(value: float) -> float:
    """The round number (of _STEPS, times a power of ten) next to a value; 1e-12 for less than that."""
    value = max(value, 1e-12)
    decade = 10.0 ** math.floor(math.log10(value))
    return float(decade * min(_STEPS, key=lambda step: abs(math.log(step * decade / value))))


def round_below(value: float) -> float:
    """The largest of 1, 2 and 5 times a power of ten up to a value > 0."""
    decade = 10.0 ** math.floor(math.log10(value))
    return float(decade * max(step for step in (0.5, 1.0, 2.0, 5.0) if step * decade <= value))


def ticks(limit: float, signed: bool) -> list[float]:
    """Two or three round values from 0 to `limit`, and where signed the same below."""
    count = 3 if f"{limit:e}"[:3] in ("1.5", "3.0", "6.0") else 2
    return [limit * k / count for k in range(-count if signed else 0, count + 1)]


def label(value: float, percent: bool = False, signed: bool = False) -> str:
    """A value as `+5 %`, `0.02` or `2·10⁻⁷`."""
    if not value:
        return "0"
    text = f"{100 * value if percent else value:{'+' if signed else ''}.4g}"
    if "e" in text:
        mantissa, exponent = text.split("e")
        text = f"{mantissa}·10{str(int(exponent)).translate(_RAISED)}"
    return text.replace("-", "−") + (" %" if percent else "")


def caption(colour: str, limit: float) -> str:
    """What stands below the scale of colours."""
    quantity = QUANTITIES[colour]
    if colour == "fringes":
        return f"difference of the principal stresses, one fringe {label(limit)} Mc²/R²"
    return f"{quantity.label}  [{quantity.unit}]" if quantity.unit else quantity.label
