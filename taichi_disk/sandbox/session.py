"""A sandbox behind its page: it carries out the page's commands between two states and
packs the messages that the page shows.

A page draws the last state and the last text of each kind, so a slow page misses states
and nothing else.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk.base.text_files import read_text
from taichi_disk.mechanics.fields import Triangles
from taichi_disk.mechanics.lattice import OwnStart, outline_name
from taichi_disk.mechanics.simulation.observables import INDEX
from taichi_disk.pictures.web.drawing import (
    Message,
    colour_values,
    contact_forces,
    scene_message,
)
from taichi_disk.sandbox.controls import (
    CHOICES,
    RANGES,
    REPEATING_KEYS,
    TABLES,
    Controls,
    Preset,
    described,
)
from taichi_disk.sandbox.graphs import CURVES, ScaleMaxima, curve_values, graphs
from taichi_disk.sandbox.sandbox import Sandbox, load_key, value_of

MAX_BYTES = 2**10  # limit of a page's message
MAX_NUMBER = 1e15  # limit of a number in it; a scene has its own limits
# most commands that wait for the next picture; of some, only the latest counts
_MAX_PENDING = 64
_COMMANDS = TABLES["commands"]
# commands of which only the latest counts
_REPLACED = ("set", "scrub", "turn", "aim", "pull")
# points; a larger lattice takes longer to build than a picture may take
LARGE_LATTICE = 5000
PAST_HINT = "earlier state: Go on continues from here"


def read_command(text: Any) -> Message | None:
    """Return a page's message as {"do": …} with the values of that command, or None if
    no page sends the message."""
    try:
        content = json.loads(text)
        _, *values = _COMMANDS[content["do"]]
        message = {name: content[name] for name in ("do", *values)}
        key = message.get("key")
        words = ["do", "key", "path"]
        if key in CHOICES:
            words.append("value")
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
    """One sandbox. `ti.init` must have been called; neither a display nor Vulkan is
    needed.

    Attributes:
        sandbox, controls: the disk and the user's controls.
        scales: the scales of the picture.
        messages: the present messages by their kinds: the JSON texts "hello", "scene",
            "graphs", "panel" and "yaml", and the binary "state".
        number: of the last state.
        news: set when something may have to be computed or shown.
    """

    def __init__(self, playlist: list[Preset]) -> None:
        """Begin with the first scene of the list. Raises TaichiDiskError if the scene
        cannot be built."""
        self.sandbox = Sandbox(playlist[0].load())
        self.controls = Controls(self.sandbox, playlist)
        self.scales = ScaleMaxima(self.sandbox)
        self.number = 0
        self.news = asyncio.Event()
        self._pending: dict[Any, Message] = {}
        # what the last text of a kind depends on
        self._keys: dict[str, Any] = {}
        hello = {
            "kind": "hello",
            "columns": [*INDEX],
            "playlist": [_card(entry) for entry in playlist],
            "curves": CURVES,
            "keys": self.controls.reference,
            "repeating": REPEATING_KEYS,
        }
        self.messages: Message = {"hello": json.dumps(hello)}
        self.advance()

    # ---- commands

    def hear(self, message: Message) -> None:
        """Keep a command, as `read_command` returns it, until the next picture."""
        key: Any = object()  # replaces no other command
        if message["do"] in _REPLACED:
            key = message["do"], message.get("key")
        self._pending.pop(key, None)  # the latest stands at the end
        if len(self._pending) < _MAX_PENDING:
            self._pending[key] = message

    # ---- pictures

    @property
    def is_busy(self) -> bool:
        """Whether the next picture will differ from the last one even if nobody does
        anything."""
        sandbox = self.sandbox
        return bool(
            self._pending
            or sandbox.grip >= 0
            or sandbox.time.lead > 0.0
            or not sandbox.paused
        )

    def advance(self) -> None:
        """Carry out the commands, let the time since the last picture pass, and write
        the next picture's messages.

        If that fails, the scene begins anew, and its message says why.
        """
        try:
            self._carry_out_commands()
            self.sandbox.tick()
            self._write_messages()
        except Exception as error:
            self._begin_anew(described(error))
            self._write_messages()

    def tell(self, message: str) -> None:
        """Show a message to the user."""
        self.sandbox.message = message
        self._write_messages()
        self.news.set()

    def _carry_out_commands(self) -> None:
        commands = self._pending.values()
        self._pending = {}
        for command in commands:
            self.controls.attempt(self._carry_out, *command.values())

    def _carry_out(self, kind: str, *values: Any) -> None:
        part = getattr(self, _COMMANDS[kind][0])
        getattr(part, kind)(*values)

    def _begin_anew(self, reason: str) -> None:
        """Begin the present scene."""
        sandbox = self.sandbox
        self._pending = {}
        try:
            sandbox.begin()
            sandbox.message = f"{reason}; the disk is at the start again"
        except Exception as error:
            sandbox.paused = True
            sandbox.message = f"{reason}: {described(error)}"

    def _write_messages(self) -> None:
        self.number += 1
        scene = self.sandbox.scene
        self._write("scene", self._scene_key(), self._scene)
        # While the scene is computed again, the old curves stay.
        if self.sandbox.time.lead <= 0.0:
            time = self.sandbox.time
            self._write("graphs", self._graphs_key(), lambda: graphs(time))
        state = self._state()
        panel = self._panel()
        self._write("panel", panel, lambda: panel)
        self._write("yaml", scene, self._saved)
        self.messages["state"] = state

    def _saved(self) -> dict[str, str]:
        """Return the scene as a file, which names the outline that is sent with it."""
        scene = self.sandbox.scene
        message = {"text": OwnStart().repeating(scene).to_yaml()}
        if scene.lattice.outline != "none":
            message["name"] = outline_name(scene.lattice)
            message["outline"] = read_text(Path(scene.lattice.outline))
        return message

    def _scene_key(self) -> Any:
        """The scene is sent again if the lattice, the start or the wall's drawing
        changes."""
        scenario = self.sandbox.time.display.segment.scenario
        return (
            id(scenario.lattice.bonds),
            scenario.spoke,
            scenario.view,
            scenario.scene.wall.a,
            scenario.point_force,
        )

    def _graphs_key(self) -> Any:
        """The graphs are sent again if other curves are shown or the curves end; until
        then the page itself adds a point with each state."""
        time = self.sandbox.time
        return (
            time.segment,
            time.display.segment.hit_began,
            time.segment.status,
            self.sandbox.paused,
            time.lead < 0.0,
        )

    def _write(self, kind: str, key: Any, content: Callable[[], Message]) -> None:
        """Write a JSON message if `key`, on which its content depends, has changed."""
        if self._keys.get(kind) != key:
            # in ASCII: names of files may hold what is no Unicode
            self.messages[kind] = json.dumps({"kind": kind} | content())
            self._keys[kind] = key

    def _scene(self) -> Message:
        scenario = self.sandbox.time.display.segment.scenario
        self._triangles = Triangles(scenario.lattice)
        video = self.sandbox.scene.video
        return scene_message(scenario, video, scenario.point_force)

    def _state(self) -> bytes:
        """Return the binary message of a picture: little-endian float32, and the
        caption in UTF-8.

        At first stand the number, t since the hit began [R/c], points, forces, the
        point that the mouse pulls (-1: none), values, the value of full colour and the
        force of the longest arrow [M c^2/R]. Observables (INDEX), graph values
        (CURVES), positions (2n), values and forces (3k) follow.
        """
        sandbox = self.sandbox
        state = sandbox.time.display
        scenario = state.segment.scenario
        lattice = scenario.lattice
        x = state.x
        v = state.v
        video = sandbox.scene.video
        of_springs = video.draw == "springs"
        values = colour_values(
            video.colour, self._triangles, scenario.model.springs, x, v, of_springs
        )
        forces = contact_forces(scenario, x, v)
        scales = self.scales
        scales.update(values[: lattice.disk_points], forces, video.colour)
        t = state.t - state.segment.hit_began
        header = [
            self.number,
            t,
            len(x),
            len(forces),
            sandbox.grip,
            len(values),
            scales.colour,
            scales.force,
        ]
        inertia = self.sandbox.time.start.body.inertia
        curves = curve_values(state.segment, state.row[None], inertia)[0]
        parts = [header, state.row, curves, x.ravel(), values, forces.ravel()]
        floats = np.concatenate(parts).astype("<f4")
        return floats.tobytes() + self._caption(t).encode()

    def _caption(self, t: float) -> str:
        """Return the lines of the read-out: at first the time, at the end the result,
        which begins with *."""
        time = self.sandbox.time
        scenario: Any = time.display.segment.scenario
        clock, *motion = scenario.caption(time.display.values | {"t": t})
        if self.sandbox.at_start:
            motion = []
        measured = time.measured
        if time.lead == 0.0 and measured:
            _, result = measured.scenario.primary(measured.columns)
            symbol = scenario.words.symbol
            digits = ".3g"  # that another lattice leaves
            if symbol == "e":
                digits = ".3f"
            motion = [f"*{symbol} = {result:{digits}}"]
        elif scenario.falls_back:
            motion.append(scenario.bounces(time.segment.columns))
        magnify = self.controls.value("video.magnify")
        if magnify > 1.0:
            clock = f"{clock}, displacements × {magnify:g}"
        return "\n".join([clock, *motion])

    def _panel(self) -> Message:
        sandbox = self.sandbox
        controls = self.controls
        entry = controls.playlist[controls.number]
        words = sandbox.time.display.segment.scenario.words
        load = RANGES[load_key(sandbox.scene)]
        return {
            "message": sandbox.message or self.scales.note,
            "refusals": controls.refusals,
            "status": sandbox.status,
            "warnings": sandbox.warnings,
            "paused": sandbox.paused,
            "slow": sandbox.slow,
            "aimed": sandbox.drawn_throw,
            "name": entry.name,
            "question": entry.question,
            "answer": sandbox.answer,
            "number": controls.number,
            "title": [entry.name, *words.title[1:]],
            "hint": PAST_HINT if sandbox.time.lead < 0.0 else "",
            "atStart": sandbox.at_start,
            "sliders": self._sliders(),
            "choices": self._choices(),
            "seed": sandbox.scene.lattice.seed,
            "collecting": len(sandbox.remaining_loads),
            "results": [one._asdict() for one in sandbox.results],
            "again": self._recomputed(),
            "loadRange": (load.low, load.high),
        }

    def _recomputed(self) -> float:
        """Return the fraction of the way to the state on display that has been computed
        again, or 1."""
        time = self.sandbox.time
        if time.lead <= 0.0:
            return 1.0
        return round(time.segment.now / time.display.t, 2)

    def _sliders(self) -> list[Message]:
        """Return the sliders of the scene.

        `live`: whether the number changes while its slider is dragged. A change that
        takes long waits until the slider is let go.
        """
        sandbox = self.sandbox
        is_large = sandbox.scene.lattice.points > LARGE_LATTICE
        is_slow = sandbox.at_start and (is_large or not sandbox.can_aim)
        sliders = []
        for key, one in self.controls.ranges.items():
            is_light = key in ("speed", "video.magnify")
            live = key != "lattice.points" and (is_light or not is_slow)
            value = self.controls.value(key)
            sliders.append({"key": key, "value": value, "live": live} | one._asdict())
        return sliders

    def _choices(self) -> list[Message]:
        """Return the choices of the present scene."""
        choices = []
        for key, name in CHOICES.items():
            value = self.controls.value(key)
            if value is not None:
                options = self.controls.options(key)
                choices.append(
                    {"key": key, "name": name, "value": value, "options": options}
                )
        return choices


@cache
def _card(entry: Preset) -> Message:
    """Return what the page's list shows of a scene; the numbers of its first state, for
    a small picture, only if the scene is one of the program's."""
    card: Message = {
        "name": entry.name,
        "question": entry.question,
        "group": entry.group,
    }
    if entry.group:
        scene = entry.load()
        card["kind"] = scene.scene
        if scene.lattice.outline != "none":
            card["outline"] = read_text(Path(scene.lattice.outline))
        for key in TABLES["sketched"]:
            card[key.partition(".")[2]] = value_of(scene, key)
    return card
