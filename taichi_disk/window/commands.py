"""What a page may say: every message is checked against this list before anything is done with it."""

from __future__ import annotations

import json
from math import isfinite
from typing import Any

from taichi_disk.window.controls import CHOICES, RANGES

MAX_BYTES = 2**10  # of a message
_LARGEST = 1e7
_NUMBERS = {  # of each command, the numbers that it needs
    "seen": ("number",),  # a state has been drawn
    "play": ("number",),
    "speed": ("value",),
    "scrub": ("t",),
    "turn": ("angle", "final"),
    "aim": ("dx", "dy"),
    "throw": (),
    "pull": ("x", "y"),
    "release": (),
    "rescale": (),
    "collect": (),
    "clear": (),
    "press": (),
    "set": (),
}
_WORDS = {"press": ("key",), "set": ("key",)}
CHANGEABLE = (*RANGES, *CHOICES, "video.magnify")


def understood(text: Any) -> dict[str, Any] | None:
    """Return a page's message as {"do": …} with the numbers and words that it needs, or None if no page sends it."""
    try:
        given = json.loads(text)
        kind = given["do"]
        message = {"do": kind} | {name: float(given[name]) for name in _NUMBERS[kind]}
        if not all(isfinite(message[name]) and abs(message[name]) < _LARGEST for name in _NUMBERS[kind]):
            return None
        for name in _WORDS.get(kind, ()):
            message[name] = given[name]
            if not (isinstance(given[name], str) and len(given[name]) < 40):
                return None
        if kind == "set":
            value = message["value"] = given["value"]
            is_word = isinstance(value, str) and len(value) < 40
            is_number = type(value) in (int, float) and isfinite(value) and abs(value) < _LARGEST
            if message["key"] not in CHANGEABLE or is_word != (message["key"] in CHOICES) or not (is_word or is_number):
                return None
        return message
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None
