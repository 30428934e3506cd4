"""The commands that a page may send, and the check that every message passes first."""

from __future__ import annotations

import json
from typing import Any

from taichi_disk.window.controls import CHOICES, RANGES

MAX_BYTES = 2**10  # of a message
_LONGEST_WORD, _LARGEST_NUMBER = 40, 1e7
# Values of each command, in the order in which `Session` passes them on. "seen": the page has drawn a state.
_VALUES = {
    **{"seen": "number", "play": "number", "speed": "value", "scrub": "t", "turn": "angle final", "aim": "dx dy"},
    **{"pull": "x y", "press": "key", "set": "key value"},
    **dict.fromkeys(("throw", "release", "rescale", "collect", "clear"), ""),
}


def understood(text: Any) -> dict[str, Any] | None:
    """Return a page's message as {"do": …} with the values of that command, or None if no page sends the message."""
    try:
        content = json.loads(text)
        message = {name: content[name] for name in ("do", *_VALUES[content["do"]].split())}
        key = message.get("key")
        if message["do"] == "set" and key not in (*RANGES, *CHOICES):
            return None
        words = ("do", "key", "value") if key in CHOICES else ("do", "key")
        return message if all(_is_valid(value, name in words) for name, value in message.items()) else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


def _is_valid(value: Any, is_word: bool) -> bool:
    if is_word:
        return isinstance(value, str) and len(value) < _LONGEST_WORD
    return isinstance(value, (int, float)) and abs(value) < _LARGEST_NUMBER  # false for nan
