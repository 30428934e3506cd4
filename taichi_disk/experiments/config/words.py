"""Other names of a scene's keys, in papers, lectures and other programs."""

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
_RESULT = "the restitution e is a result; a larger material.eta_star lowers it"
# what is no key, and why
NO_KEYS = {
    "radius": _LENGTH,
    "r": _LENGTH,
    "diameter": _LENGTH,
    "mass": _MASS,
    "m": _MASS,
    "restitution": _RESULT,
    "e": _RESULT,
    "poisson": "Poisson's ratio follows from the lattice, about 0.28",
}


def resolve_synonym(word: str) -> str:
    """Return the key that `word` means, or `word` itself."""
    return SYNONYMS.get(word.lower(), word)
