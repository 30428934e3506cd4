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
ALIASES = {name: key for key, names in _NAMES.items() for name in names.split()}
UNITS = dict.fromkeys(
    ("radius", "r", "diameter"), "the disk's radius R is the unit of length"
)
UNITS |= dict.fromkeys(("mass", "m"), "the disk's mass M is the unit of mass")
_DEGREES = re.compile(r"([-+]?[0-9]*\.?[0-9]+) *(deg|degrees?|°)")
_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(e[-+]?[0-9]+)?")


def number_hint(value: Any, unit: str, key: str) -> str:
    if (
        isinstance(value, list)
        and len(value) > 1
        and not any(isinstance(one, (list, dict)) for one in value)
    ):
        return (
            "; several values are a sweep: write them in the section sweep, as sweep:"
            f" {{{key}: {value}}}"
        )
    if not isinstance(value, str):
        return ""
    if unit == "rad" and (degrees := _DEGREES.fullmatch(value.strip().lower())):
        return f"; in radians that is {radians(float(degrees[1])):.6g}"
    if _COMMA.fullmatch(value.strip().lower()):
        return f"; did you mean {value.strip().replace(',', '.')}?"
    return ""
