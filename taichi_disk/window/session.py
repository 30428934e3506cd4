"""A sandbox behind its pages: what they ask for is done between two states, what they show is put into messages.

A page draws the last state and the last text of each kind, so that one that is slow misses states and nothing else.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any, get_args

import numpy as np
from numpy.typing import NDArray

from taichi_disk.fields import Triangles
from taichi_disk.render.palette import full_scale, round_near
from taichi_disk.simulation.observables import INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.web.drawing import colour_values, contact_forces, scene_message
from taichi_disk.window.controls import CHOICES, LARGE, MAGNIFY, SPEED, Controls, Entry
from taichi_disk.window.graphs import CURVES, Graphs
from taichi_disk.window.sandbox import PATIENCE, Result, Sandbox, load_of

LONGEST = 0.1  # a picture that took longer does not make the next step longer [s]
_PICTURE = 1.0 / 32.0  # what computing and sending may take together [s]
_LOOK = 5  # pictures between two looks at whether the scales still hold what they show
_QUIET = 6  # pictures that still change when nothing moves any more: scales grow
_MOST_PENDING = 64  # commands between two pictures that do not replace each other
MOST_POINTS = 20_000  # that a page may ask for: more take minutes to build
HEADER = struct.Struct("<IIdIIiI4f")  # see `Session._state`
_LATEST = ("set", "speed", "scrub", "turn", "aim", "pull")  # commands of which the latest counts


class Session:
    """`ti.init` must have been called. Needs no display and no Vulkan.

    Attributes:
        sandbox, controls: the disk, and what can be done.
        texts: the JSON messages of each kind, "hello", "scene", "graphs", "yaml" and "panel", as they stand.
        number: of the last state.
        state: the last state, the binary message of a picture.
    """

    def __init__(self, playlist: list[Entry], kernels: KernelCache) -> None:
        """Raises TaichiDiskError for a scene that cannot be built."""
        self.sandbox = Sandbox(playlist[0].load(), kernels)
        self.controls = Controls(self.sandbox, playlist)
        self.scales, self.graphs = Scales(self.sandbox), Graphs(self.sandbox)
        self.texts: dict[str, str] = {}
        self.number, self.state = 0, b""
        self._pending: dict[Any, dict[str, Any]] = {}
        self._heard = 0
        self._keys: dict[str, Any] = {}
        self._triangles: Triangles | None = None
        self._last, self._sending, self._quiet = perf_counter(), 0.0, 0
        scenes = [one[:2] for one in playlist]
        self._write(
            "hello", {"columns": [*INDEX], "playlist": scenes, "curves": CURVES, "keys": self.controls.reference}
        )
        self.advance()

    # ---- what pages say

    def hear(self, message: dict[str, Any]) -> None:
        """Keep a command, as `commands.understood` gives it, for the next picture."""
        kind, self._quiet = message["do"], 0
        self._heard += 1
        key = (kind, message.get("key")) if kind in _LATEST else self._heard
        self._pending.pop(key, None)  # the latest stands at the end
        if len(self._pending) < _MOST_PENDING:
            self._pending[key] = message

    def _act(self, message: dict[str, Any]) -> None:
        sandbox, controls, kind = self.sandbox, self.controls, message["do"]
        if kind == "set":
            value = message["value"]
            value = min(value, MOST_POINTS) if message["key"] == "lattice.points" else value
            controls.set(message["key"], value)
        elif kind == "scrub":
            sandbox.scrub(sandbox.time.of_hit(sandbox.seen.segment.hit)[0].began + message["t"])
        elif kind == "turn":
            sandbox.turn(message["angle"], for_good=bool(message["final"]))
        elif kind == "release":
            sandbox.aimed = None
            sandbox.let_go()
        elif kind == "clear":
            sandbox.results = []
        elif kind == "play":
            if 0 <= message["number"] < len(controls.playlist):
                controls.play(int(message["number"]))
        else:
            acts: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
                "press": (controls.press, ("key",)),
                "speed": (controls.set_speed, ("value",)),
                "aim": (sandbox.aim, ("dx", "dy")),
                "throw": (sandbox.throw, ()),
                "pull": (sandbox.pull, ("x", "y")),
                "rescale": (self.scales.reset, ()),
                "collect": (controls.collect, ()),
            }
            act, names = acts[kind]
            act(*(message[name] for name in names))

    def let_go(self, pause: bool) -> None:
        """Let go of the disk, whose player has left; `pause`: nobody else is there."""
        self._pending.clear()
        self.sandbox.aimed = None
        self.sandbox.let_go()
        if pause and not self.sandbox.paused:
            self.sandbox.pause()
        self._quiet = 0

    # ---- pictures

    @property
    def busy(self) -> bool:
        """Whether the next picture will be another one, though nobody does anything."""
        return bool(self._pending) or self._quiet < _QUIET

    def advance(self) -> None:
        """Do what is pending, let time pass since the picture before, and make the messages of the next one."""
        pending, self._pending = self._pending, {}
        for message in pending.values():
            self.controls.attempt(partial(self._act, message))
        now, sandbox = perf_counter(), self.sandbox
        passed = min(now - self._last, LONGEST)
        self._last = now
        # Time goes on even where sending takes longer than it should.
        sandbox.advance(passed, max(min(_PICTURE - self._sending, PATIENCE), 0.5 * self._sending))
        self._sending = 0.9 * self._sending + 0.1 * max(passed - (perf_counter() - now), 0.0)
        moves = sandbox.time.behind or sandbox.dragged or not sandbox.paused
        self._quiet = 0 if moves else self._quiet + 1
        self.number += 1
        self._write_scene()
        self._write_graphs()
        self._write_yaml()
        self.state = self._state()
        self._write_panel()

    def _write(self, kind: str, content: dict[str, Any]) -> None:
        """Keep a text, unless it is the one that pages have."""
        text = json.dumps({"kind": kind} | content, ensure_ascii=False)
        if self.texts.get(kind) != text:
            self.texts[kind] = text

    def _write_scene(self) -> None:
        """Once for each lattice, start and look of the wall."""
        scenario, video = self.sandbox.seen.segment.scenario, self.sandbox.scene.video
        bonds, view = scenario.lattice.bonds, scenario.view
        key = (id(bonds), scenario.spoke, view, scenario.scene.wall.a, scenario.point_force)
        if self._keys.get("scene") != key:
            if not self._triangles or self._triangles.lattice.bonds is not bonds:
                self._triangles = Triangles(scenario.lattice)
            self._keys["scene"] = key
            self._write("scene", scene_message(scenario, video) | {"start": self.sandbox.starts})

    def _write_graphs(self) -> None:
        """Whenever the curves are others, and when they are complete; with each state pages add a point to them."""
        sandbox = self.sandbox
        last, seen = sandbox.segment, sandbox.seen
        key = sandbox.starts, seen.segment.hit, id(last), last.attempt, last.status, sandbox.paused, sandbox.time.past
        if self._keys.get("graphs") != key:
            self._keys["graphs"] = key
            self._write("graphs", self.graphs.message())

    def _write_yaml(self) -> None:
        if self._keys.get("yaml") is not self.sandbox.scene:
            self._keys["yaml"] = self.sandbox.scene
            self._write("yaml", {"text": self.sandbox.scene.to_yaml()})

    def _state(self) -> bytes:
        """Return the binary message of a picture, little-endian.

        HEADER holds the number, commands heard, t since the hit began [R/c], points, forces, the point that the mouse
        pulls (-1: none), values, the value of full colour, the force of the longest arrow [M c^2/R], the energy
        imbalance and the pace [R/c per s]. Observables (INDEX), graph values (CURVES), positions (2n), values and
        forces (3k) follow as float32, and the caption in UTF-8.
        """
        sandbox, seen, video = self.sandbox, self.sandbox.seen, self.sandbox.scene.video
        scenario, triangles = seen.segment.scenario, self._triangles
        assert triangles
        springs, wall, x, v = scenario.model.springs, scenario.model.wall, seen.x, seen.v
        values = colour_values(video.colour, triangles, springs, x, v, video.draw == "springs")
        forces = contact_forces(wall, scenario.lattice, springs, x, v)
        if self.number % _LOOK == 1:
            self.scales.update(values[: scenario.lattice.disk_points], forces)
        t = seen.t - sandbox.time.of_hit(seen.segment.hit)[0].began
        pulled = sandbox.dragged[0] if sandbox.dragged else -1
        numbers = self.scales.colour, self.scales.force, sandbox.imbalance, 0.0 if sandbox.paused else sandbox.pace
        header = HEADER.pack(self.number, self._heard, t, len(x), len(forces), pulled, len(values), *numbers)
        curves = self.graphs.values(seen.row[None])[0]
        floats = np.concatenate([seen.row, curves, x.ravel(), values, forces.ravel()]).astype("<f4")
        caption = "\n".join(scenario.caption(seen.values | {"t": t}))
        return header + floats.tobytes() + caption.encode()

    # ---- the panel

    def _write_panel(self) -> None:
        sandbox, controls = self.sandbox, self.controls
        segment, entry = sandbox.segment, controls.playlist[controls.number]
        slow = sandbox.at_start and (sandbox.scene.lattice.points > LARGE or not sandbox.is_thrown)
        sliders = [
            {"key": key, "value": controls.value(key), "live": not slow and key != "lattice.points"} | one._asdict()
            for key, one in controls.ranges.items()
        ]
        sliders.append({"key": "speed", "value": sandbox.speed, "live": True} | SPEED._asdict())
        sliders.append({"key": "video.magnify", "value": controls.magnification, "live": True} | MAGNIFY._asdict())
        choices = [
            {"key": key, "name": name, "value": controls.value(key), "options": get_args(options)}
            for key, (name, options) in CHOICES.items()
            if controls.value(key) is not None
        ]
        self._write(
            "panel",
            {
                "number": controls.number,
                "name": entry.name,
                "sentence": entry.sentence,
                "title": [*sandbox.seen.segment.scenario.title()],
                "message": sandbox.message,
                "hint": self._hint(),
                "status": self._status(),
                "warnings": sandbox.warnings,
                "solver": f"{segment.step.integrator.name}, step {segment.step.dt:.3g} R/c",
                "paused": sandbox.paused,
                "atStart": sandbox.at_start,
                "slow": sandbox.slow,
                "sliders": sliders,
                "choices": choices,
                "seed": sandbox.scene.lattice.seed,
                "aimed": sandbox.aimed,
                "collecting": len(sandbox.collected),
                "results": [result_row(one) for one in sandbox.results],
            },
        )

    def _hint(self) -> str:
        sandbox = self.sandbox
        if sandbox.time.past:
            return "this is past: Go on continues from here"
        if sandbox.message or not sandbox.at_start:
            return ""
        return "drag the disk to turn it, or from beside it to aim" if sandbox.is_thrown else ""

    def _status(self) -> str:
        if self.sandbox.time.behind:
            return "computing again"
        return "disturbed" if self.sandbox.seen.by_hand else "same as taichi-disk run"


def result_row(one: Result) -> dict[str, Any]:
    """Return the line of the table for a result: the numbers that were set, and those that were found."""
    scene: Any = one.scene
    impact, friction = getattr(scene, "impact", None), getattr(scene.wall, "friction", None)
    return {
        "result": "e" if impact else "ξ",
        "value": one.value,
        "load": load_of(scene),
        "angle": impact and impact.angle,
        "spin": impact and impact.spin,
        "friction": friction,
        "eta_star": scene.material.eta(one.points) * one.points,
        "a": scene.wall.a,
        "points": one.points,
        "contact_time": one.numbers.get("contact_time"),
        "disturbance": one.disturbance,
    }


class Scales:
    """What full colour and the longest arrow stand for: they grow, and begin again with each hit and quantity.

    Attributes:
        colour: value of full colour, of fringes the stress from one to the next; in units of the quantity.
        force: of the wall on a point, of the longest arrow [M c^2/R].
    """

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox
        self._key: Any = None
        self._fresh = False
        self.colour = self.force = 1.0

    def update(self, values: NDArray[Any], forces: NDArray[Any]) -> None:
        """Let the scales hold the disk's `values` (N,) and the wall's `forces` (k, 3)."""
        sandbox = self._sandbox
        scenario, name = sandbox.seen.segment.scenario, sandbox.scene.video.colour
        key = sandbox.starts, sandbox.seen.segment.hit, name
        if key != self._key:
            if key[:2] != (self._key or ())[:2]:
                self.force = round_near(0.5 * scenario.point_force)
            self._key, load = key, load_of(scenario.scene)  # before anything is known
            self.colour = round_near(0.25 * load**2 / len(values) if name == "kinetic" else 0.05 * load)
        least = 0.0 if self._fresh else self.colour
        self._fresh, self.colour = False, max(least, full_scale(values.astype(np.float64), name))
        largest = float(np.hypot(forces[:, 1], forces[:, 2]).max(initial=0.0))
        if largest > self.force:
            self.force = round_near(1.2 * largest)

    def reset(self) -> None:
        """Take the scale of colours from what is seen next alone."""
        self._fresh = True
