"""What each visitor chooses alone: the colours, the way of drawing, and the theme."""

from __future__ import annotations

from typing import Any, NamedTuple

from taichi_disk.config.sections import VideoSection
from taichi_disk.window.controls import LOOK_KEYS, next_value, values_of


class Look(NamedTuple):
    """The keys of the section `video` that are a visitor's own."""

    colour: str
    draw: str
    theme: str

    @classmethod
    def of(cls, video: VideoSection) -> Look:
        return cls(video.colour, video.draw, video.theme)

    def after(self, message: dict[str, Any]) -> Look:
        """Return the look after a command of its visitor, as `read_command` returns
        it; most commands do not change the look."""
        key = message.get("key", "")
        if message["do"] == "press" and key in LOOK_KEYS:
            key = LOOK_KEYS[key]
            value = next_value(key, self._value(key))
        elif message["do"] == "set" and key in LOOK_KEYS.values():
            value = message["value"]
        else:
            return self
        if value not in values_of(key):
            return self
        return self._replace(**{_name(key): value})

    def commands(self) -> list[dict[str, Any]]:
        """Return the commands that make this the look of the scene."""
        return [
            {"do": "set", "key": key, "value": self._value(key)}
            for key in LOOK_KEYS.values()
        ]

    def _value(self, key: str) -> Any:
        return getattr(self, _name(key))


def _name(key: str) -> str:
    return key.removeprefix("video.")
