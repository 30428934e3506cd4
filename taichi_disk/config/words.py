"""Words of papers, lectures and other programs for what a scene calls otherwise."""

from __future__ import annotations

# in lower case, with the key that is meant
SYNONYMS = {
    "eta": "eta_star",
    "η": "eta_star",
    "η*": "eta_star",
    "damping": "eta_star",
    "speed": "velocity",
    "v": "velocity",
    "mu": "friction",
    "μ": "friction",  # the Greek letter
    "µ": "friction",  # the micro sign
    "n": "points",
    "theta": "angle",
    "θ": "angle",
    "omega": "spin",
    "ω": "spin",
    "p": "pressure",
    "step": "dt",
    "color": "colour",
}
_LENGTH = "the disk's radius R is the unit of length"
_MASS = "the disk's mass M is the unit of mass"
UNITS = {
    "radius": _LENGTH,
    "r": _LENGTH,
    "diameter": _LENGTH,
    "mass": _MASS,
    "m": _MASS,
}


def resolve_synonym(word: str) -> str:
    """Return the key that `word` means, or `word` itself."""
    return SYNONYMS.get(word.lower(), word)
