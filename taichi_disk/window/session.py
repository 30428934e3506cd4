"""A sandbox behind its pages: it carries out their commands between two states and
packs the messages they show.

A page draws the last state and the last text of each kind, so a slow page misses states
and nothing else.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from typing import Any, get_args

import numpy as np

from taichi_disk.fields import Triangles
from taichi_disk.simulation.observables import INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.web.drawing import colour_values, contact_forces, scene_message
from taichi_disk.window.controls import CHOICES, RANGES, REPEATING_KEYS, Controls, Entry
from taichi_disk.window.graphs import CURVES, Graphs, Scales
from taichi_disk.window.sandbox import Sandbox

MAX_BYTES, MAX_NUMBER = 2**10, 1e7  # limits of a page's message and of a number in it
# most commands between two pictures, without those that a later one replaces
_MAX_PENDING = 64
# A page's commands and their values, by the part of `Session` that has a method of the
# same name. "seen" tells
# the audience that the page has drawn a state.
_METHODS = {
    "controls": "press key, play number, set key value, speed value, collect",
    "sandbox": "scrub t, turn angle final, aim dx dy, throw, pull x y, release, clear",
    "scales": "rescale",
    "audience": "seen number",
}
_COMMANDS = {
    do: (part, values)
    for part, text in _METHODS.items()
    for do, *values in map(str.split, text.split(", "))
}
# commands of which only the latest counts
_REPLACED = ("set", "speed", "scrub", "turn", "aim", "pull")
# points; a larger lattice takes longer to build than a picture may take
LARGE_LATTICE = 5000
HEADER = struct.Struct("<IdIIiI2f")  # see `Session._state`
PAST_HINT = "earlier state: Go on continues from here"
AIM_HINT = "drag the disk to turn it, or from beside it to aim"


def read_command(text: Any) -> dict[str, Any] | None:
    """Return a page's message as {"do": …} with the values of that command, or None if
    no page sends the message."""
    try:
        content = json.loads(text)
        message = {name: content[name] for name in ("do", *_COMMANDS[content["do"]][1])}
        key = message.get("key")
        words = ("do", "key", "value") if key in CHOICES else ("do", "key")
        is_valid = key in (*RANGES, *CHOICES) or message["do"] != "set"
        for name, value in message.items():
            # false for nan
            is_valid &= (
                isinstance(value, str) if name in words else abs(value) < MAX_NUMBER
            )
        return message if is_valid else None
    except (ValueError, TypeError, KeyError, RecursionError):
        return None


class Session:
    """One sandbox for all pages. `ti.init` must have been called; neither a display nor
    Vulkan is needed.

    Attributes:
        sandbox, controls, scales: the disk, the user's controls, and the scales of
            colours and arrows.
        texts: the present JSON message of each kind: "hello", "scene", "graphs", "yaml"
            and "panel".
        number: of the last state.
        state: the last state, the binary message of a picture.
    """

    def __init__(self, playlist: list[Entry], kernels: KernelCache) -> None:
        """Begin with the first scene of the list. Raises TaichiDiskError if it cannot
        be built."""
        self.sandbox = Sandbox(playlist[0].load(), kernels)
        self.controls = Controls(self.sandbox, playlist)
        self.scales, self.graphs = Scales(self.sandbox), Graphs(self.sandbox)
        self.texts: dict[str, str] = {}
        self.number, self.state, self._command_count = 0, b"", 0
        self._pending: dict[Any, dict[str, Any]] = {}
        self._text_keys: dict[str, Any] = {}
        hello = {
            "columns": [*INDEX],
            "playlist": [entry[:2] for entry in playlist],
            "curves": CURVES,
        }
        hello |= {"keys": self.controls.reference, "repeating": REPEATING_KEYS}
        self._write("hello", 0, lambda: hello)
        self.advance()

    # ---- commands

    def hear(self, message: dict[str, Any]) -> None:
        """Keep a command, as `read_command` returns it, until the next picture."""
        self._command_count += 1
        key = (
            (message["do"], message.get("key"))
            if message["do"] in _REPLACED
            else self._command_count
        )
        self._pending.pop(key, None)  # the latest stands at the end
        if len(self._pending) < _MAX_PENDING:
            self._pending[key] = message

    def release(self, pause: bool) -> None:
        """Let go of the disk with the next picture, because its player has left;
        `pause`: nobody else is there."""
        self._pending = {"release": {"do": "release"}}
        if pause and not self.sandbox.paused:
            self.sandbox.pause()

    # ---- pictures

    @property
    def is_busy(self) -> bool:
        """Whether the next picture will differ from the last one even if nobody does
        anything."""
        sandbox = self.sandbox
        return bool(
            self._pending
            or sandbox.grip
            or sandbox.time.lead > 0.0
            or not sandbox.paused
        )

    def advance(self) -> None:
        """Carry out the commands, let the time since the last picture pass, and write
        the next picture's messages."""
        pending, self._pending = self._pending, {}
        for kind, *values in map(dict.values, pending.values()):
            part = getattr(self, _COMMANDS[kind][0])
            self.controls.attempt(getattr(part, kind), *values)
        sandbox = self.sandbox
        sandbox.tick()
        self.number += 1
        last, state = sandbox.time.segment, sandbox.time.display
        scenario, is_past = state.segment.scenario, sandbox.time.lead < 0.0
        # Send the scene again if the lattice, the start or the wall's drawing changes,
        # and the graphs if other curves are shown or the curves end; until then the
        # page itself adds a point with each state.
        look = (
            id(scenario.lattice.bonds),
            scenario.spoke,
            scenario.view,
            scenario.scene.wall.a,
            scenario.point_force,
        )
        curves = (
            last,
            state.segment.hit_began,
            last.status,
            sandbox.paused,
            is_past,
        )
        self._write("scene", look, self._scene)
        self._write("graphs", curves, self.graphs.message)
        self._write("yaml", sandbox.scene, lambda: {"text": sandbox.scene.to_yaml()})
        self.state = self._state()
        panel = self._panel()
        self._write("panel", panel, lambda: panel)

    def _write(
        self, kind: str, key: Any, content: Callable[[], dict[str, Any]]
    ) -> None:
        """Replace the text of a kind if `key`, on which its content depends, has
        changed."""
        if self._text_keys.get(kind) != key:
            self._text_keys[kind] = key
            self.texts[kind] = json.dumps(
                {"kind": kind} | content(), ensure_ascii=False
            )

    def _scene(self) -> dict[str, Any]:
        scenario = self.sandbox.time.display.segment.scenario
        self._triangles = Triangles(scenario.lattice)
        return scene_message(scenario, self.sandbox.scene.video) | {
            "start": self.sandbox.starts
        }

    def _state(self) -> bytes:
        """Return the binary message of a picture, little-endian.

        HEADER holds the number, t since the hit began [R/c], points, forces, the point
        that the mouse pulls (-1: none), values, the value of full colour and the force
        of the longest arrow [M c^2/R]. Observables (INDEX), graph values (CURVES),
        positions (2n), values and forces (3k) follow as float32, and the caption in
        UTF-8.
        """
        sandbox, state, video = (
            self.sandbox,
            self.sandbox.time.display,
            self.sandbox.scene.video,
        )
        scenario, x, v = state.segment.scenario, state.x, state.v
        springs, wall, lattice = (
            scenario.model.springs,
            scenario.model.wall,
            scenario.lattice,
        )
        values = colour_values(
            video.colour, self._triangles, springs, x, v, video.draw == "springs"
        )
        forces = contact_forces(wall, lattice, springs, x, v)
        self.scales.update(values[: lattice.disk_points], forces)
        t = state.t - state.segment.hit_began
        pulled = sandbox.grip[0] if sandbox.grip else -1
        full = self.scales.colour, self.scales.force
        header = HEADER.pack(
            self.number, t, len(x), len(forces), pulled, len(values), *full
        )
        curves = self.graphs.values(state.row[None])[0]
        floats = np.concatenate(
            [state.row, curves, x.ravel(), values, forces.ravel()]
        ).astype("<f4")
        caption = "\n".join(scenario.caption(state.values | {"t": t}))
        return header + floats.tobytes() + caption.encode()

    def _panel(self) -> dict[str, Any]:
        sandbox, controls = self.sandbox, self.controls
        scene, entry = sandbox.scene, controls.playlist[controls.number]
        # A change that needs a new start waits for the end of the drag if the start
        # takes long.
        is_slow = sandbox.at_start and (
            scene.lattice.points > LARGE_LATTICE or not sandbox.can_aim
        )
        can_aim = sandbox.can_aim and not sandbox.message
        return {
            **{
                name: getattr(sandbox, name)
                for name in ("message", "status", "warnings", "paused", "slow")
            },
            "aimed": sandbox.drawn_throw,
            **{name: getattr(entry, name) for name in ("name", "sentence")},
            "number": controls.number,
            "title": [*sandbox.time.display.segment.scenario.title()],
            "hint": (
                PAST_HINT if sandbox.time.lead < 0.0 else AIM_HINT if can_aim else ""
            ),
            "atStart": sandbox.at_start,
            "sliders": [
                {"key": key, "value": controls.value(key)}
                | {
                    "live": (
                        key != "lattice.points"
                        and not (is_slow and key not in ("speed", "video.magnify"))
                    )
                }
                | one._asdict()
                for key, one in controls.ranges.items()
            ],
            "choices": [
                {"key": key, "name": name, "value": value, "options": get_args(options)}
                for key, (name, options) in CHOICES.items()
                if (value := controls.value(key)) is not None
            ],
            "seed": scene.lattice.seed,
            "collecting": len(sandbox.remaining_loads),
            "results": [one._asdict() for one in sandbox.results],
        }
