"""Common mistakes in keys and numbers, and the suggestions of messages."""

from __future__ import annotations

import re
from math import radians
from typing import Any

# For each key, its names in papers, lectures and other programs, in lower case.
_NAMES = {
    "eta_star": "eta η η* damping",
    "velocity": "speed v",
    "friction": "mu μ µ",  # the Greek letter and the micro sign
    "points": "n",
    "angle": "theta θ",
    "spin": "omega ω",
    "pressure": "p",
    "dt": "step",
    "colour": "color",
}
ALIASES: dict[str, str] = {}
for _key, _names in _NAMES.items():
    ALIASES |= dict.fromkeys(_names.split(), _key)
_LENGTH = "the disk's radius R is the unit of length"
_MASS = "the disk's mass M is the unit of mass"
UNITS = dict.fromkeys(("radius", "r", "diameter"), _LENGTH)
UNITS |= dict.fromkeys(("mass", "m"), _MASS)
_DEGREES = re.compile(r"([-+]?[0-9]*\.?[0-9]+) *(deg|degrees?|°)")
_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(e[-+]?[0-9]+)?")


def number_hint(value: Any, unit: str, key: str) -> str:
    """Return a hint for a value that should be a number, or "" if there is none."""
    if isinstance(value, list) and len(value) > 1:
        if any(isinstance(one, (list, dict)) for one in value):
            return ""
        return (
            "; several values are a sweep: write them in the section sweep, as sweep:"
            f" {{{key}: {value}}}"
        )
    if not isinstance(value, str):
        return ""
    text = value.strip()
    degrees = _DEGREES.fullmatch(text.lower())
    if unit == "rad" and degrees is not None:
        return f"; in radians that is {radians(float(degrees[1])):.6g}"
    if _COMMA.fullmatch(text.lower()):
        return f"; did you mean {text.replace(',', '.')}?"
    return ""
