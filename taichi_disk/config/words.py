"""Common mistakes in keys and numbers, and the suggestions of messages."""

from __future__ import annotations

import re
from math import radians
from typing import Any

# Names from papers, lectures and other programs, in lower case, and the key that has this meaning.
ALIASES = {
    "eta": "eta_star",
    "η": "eta_star",
    "η*": "eta_star",
    "damping": "eta_star",
    "speed": "velocity",
    "v": "velocity",
    "mu": "friction",
    "μ": "friction",
    "µ": "friction",
    "n": "points",
    "theta": "angle",
    "θ": "angle",
    "omega": "spin",
    "ω": "spin",
    "p": "pressure",
    "step": "dt",
    "color": "colour",
}
UNITS = dict.fromkeys(("radius", "r", "diameter"), "the disk's radius R is the unit of length")
UNITS |= dict.fromkeys(("mass", "m"), "the disk's mass M is the unit of mass")
_DEGREES = re.compile(r"([-+]?[0-9]*\.?[0-9]+) *(deg|degrees?|°)")
_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+(e[-+]?[0-9]+)?")


def number_hint(value: Any, unit: str, key: str) -> str:
    """Return the end of a message on a `value` that is no number of this `unit`: what to write, or nothing."""
    if isinstance(value, list) and len(value) > 1:
        return f"; several values are a sweep: write them in the section sweep, as sweep: {{{key}: {value}}}"
    if not isinstance(value, str):
        return ""
    if unit == "rad" and (degrees := _DEGREES.fullmatch(value.strip().lower())):
        return f"; in radians that is {radians(float(degrees[1])):.6g}"
    if _COMMA.fullmatch(value.strip().lower()):
        return f"; did you mean {value.strip().replace(',', '.')}?"
    return ""
