"""A sandbox behind its pages: it carries out their commands between two states and packs the messages they show.

A page draws the last state and the last text of each kind, so a slow page misses states and nothing else.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any, get_args

import numpy as np

from taichi_disk.fields import Triangles
from taichi_disk.simulation.observables import INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.web.drawing import colour_values, contact_forces, scene_message
from taichi_disk.window.controls import CHOICES, RANGES, Controls, Entry
from taichi_disk.window.graphs import CURVES, Graphs
from taichi_disk.window.sandbox import PATIENCE, Result, Sandbox, load_of
from taichi_disk.window.scales import UPDATE_INTERVAL, Scales

MAX_PASSED = 0.1  # longest time between two pictures that passes in the simulation, too [s]
_PICTURE = 1.0 / 32.0  # time that computing and sending may take together [s]
_STILL_PICTURES = 6  # pictures that still change after the last motion, because the scales grow
_MAX_PENDING = 64  # commands between two pictures that do not replace each other
LARGE = 5000  # points; building a larger lattice takes longer than a picture may
HEADER = struct.Struct("<IIdIIiI4f")  # see `Session._state`
PAST_HINT = "earlier state: Go on continues from here"
AIM_HINT = "drag the disk to turn it, or from beside it to aim"
_REPLACED = ("set", "speed", "scrub", "turn", "aim", "pull")  # commands of which only the latest counts


class Session:
    """`ti.init` must have been called. Needs no display and no Vulkan.

    Attributes:
        sandbox, controls: the disk, and what can be done with it.
        texts: the present JSON message of each kind: "hello", "scene", "graphs", "yaml" and "panel".
        number: of the last state.
        state: the last state, the binary message of a picture.
    """

    def __init__(self, playlist: list[Entry], kernels: KernelCache) -> None:
        """Raises TaichiDiskError for a scene that cannot be built."""
        self.sandbox = sandbox = Sandbox(playlist[0].load(), kernels)
        self.controls = controls = Controls(sandbox, playlist)
        self.scales, self.graphs = Scales(sandbox), Graphs(sandbox)
        self.texts: dict[str, str] = {}
        self.number, self.state = 0, b""
        self._acts: dict[str, Callable[..., None]] = {
            **{"press": controls.press, "play": controls.play, "collect": controls.collect, "set": controls.set},
            **{"speed": partial(controls.set, "speed"), "rescale": self.scales.reset, "turn": sandbox.turn},
            **{"aim": sandbox.aim, "throw": sandbox.throw, "pull": sandbox.pull, "release": sandbox.let_go},
            **{"scrub": lambda t: sandbox.scrub(sandbox.time.hit_began + t), "clear": sandbox.clear},
        }
        self._pending: dict[Any, dict[str, Any]] = {}
        self._heard = 0
        self._keys: dict[str, Any] = {}
        self._last, self._sending, self._still = perf_counter(), 0.0, 0
        scenes = [entry[:2] for entry in playlist]
        hello = {"columns": [*INDEX], "playlist": scenes, "curves": CURVES, "keys": controls.reference}
        self._write("hello", 0, lambda: hello)
        self.advance()

    # ---- commands

    def hear(self, message: dict[str, Any]) -> None:
        """Keep a command, as `commands.understood` returns it, until the next picture."""
        kind, self._still = message["do"], 0
        self._heard += 1
        key = (kind, message.get("key")) if kind in _REPLACED else self._heard
        self._pending.pop(key, None)  # the latest stands at the end
        if len(self._pending) < _MAX_PENDING:
            self._pending[key] = message

    def let_go(self, pause: bool) -> None:
        """Let go of the disk, whose player has left; `pause`: nobody else is there."""
        self._pending.clear()
        self.sandbox.let_go()
        if pause and not self.sandbox.paused:
            self.sandbox.pause()
        self._still = 0

    # ---- pictures

    @property
    def is_busy(self) -> bool:
        """Whether the next picture will differ from the last one even if nobody does anything."""
        return bool(self._pending) or self._still < _STILL_PICTURES

    def advance(self) -> None:
        """Carry out the commands, let the time since the last picture pass, and write the next picture's messages."""
        pending, self._pending = self._pending, {}
        for command in pending.values():
            kind, *values = command.values()
            self.controls.attempt(self._acts[kind], *values)
        now, sandbox = perf_counter(), self.sandbox
        passed = min(now - self._last, MAX_PASSED)
        self._last = now
        # Time goes on even if sending takes longer than it should.
        sandbox.advance(passed, max(min(_PICTURE - self._sending, PATIENCE), 0.5 * self._sending))
        self._sending = 0.9 * self._sending + 0.1 * max(passed - (perf_counter() - now), 0.0)
        moves = sandbox.time.behind or sandbox.dragged or not sandbox.paused
        self._still = 0 if moves else self._still + 1
        self.number += 1
        last, seen, time = sandbox.segment, sandbox.seen, sandbox.time
        scenario = seen.segment.scenario
        # A scene for each lattice, start and drawing of the wall; graphs if other curves are shown or the curves are
        # complete: with each state the page adds a point to them.
        look = id(scenario.lattice.bonds), scenario.spoke, scenario.view, scenario.scene.wall.a, scenario.point_force
        curves = sandbox.starts, seen.segment.hit, id(last), last.attempt, last.status, sandbox.paused, time.past
        self._write("scene", look, self._scene)
        self._write("graphs", curves, self.graphs.message)
        self._write("yaml", sandbox.scene, lambda: {"text": sandbox.scene.to_yaml()})
        self.state = self._state()
        panel = self._panel()
        self._write("panel", panel, lambda: panel)

    def _write(self, kind: str, key: Any, content: Callable[[], dict[str, Any]]) -> None:
        """Replace the text of a kind if `key`, on which its content depends, has changed."""
        if self._keys.get(kind) != key:
            self._keys[kind] = key
            self.texts[kind] = json.dumps({"kind": kind} | content(), ensure_ascii=False)

    def _scene(self) -> dict[str, Any]:
        scenario = self.sandbox.seen.segment.scenario
        self._triangles = Triangles(scenario.lattice)
        return scene_message(scenario, self.sandbox.scene.video) | {"start": self.sandbox.starts}

    def _state(self) -> bytes:
        """Return the binary message of a picture, little-endian.

        HEADER holds the number, commands heard, t since the hit began [R/c], points, forces, the point that the mouse
        pulls (-1: none), values, the value of full colour, the force of the longest arrow [M c^2/R], the energy
        imbalance and the pace [R/c per s]. Observables (INDEX), graph values (CURVES), positions (2n), values and
        forces (3k) follow as float32, and the caption in UTF-8.
        """
        sandbox, seen, video = self.sandbox, self.sandbox.seen, self.sandbox.scene.video
        scenario, x, v = seen.segment.scenario, seen.x, seen.v
        springs, wall, lattice = scenario.model.springs, scenario.model.wall, scenario.lattice
        values = colour_values(video.colour, self._triangles, springs, x, v, video.draw == "springs")
        forces = contact_forces(wall, lattice, springs, x, v)
        if self.number % UPDATE_INTERVAL == 1:
            self.scales.update(values[: lattice.disk_points], forces)
        t = seen.t - sandbox.time.hit_began
        pulled = sandbox.dragged[0] if sandbox.dragged else -1
        numbers = self.scales.colour, self.scales.force, sandbox.imbalance, 0.0 if sandbox.paused else sandbox.pace
        header = HEADER.pack(self.number, self._heard, t, len(x), len(forces), pulled, len(values), *numbers)
        curves = self.graphs.values(seen.row[None])[0]
        floats = np.concatenate([seen.row, curves, x.ravel(), values, forces.ravel()]).astype("<f4")
        caption = "\n".join(scenario.caption(seen.values | {"t": t}))
        return header + floats.tobytes() + caption.encode()

    def _panel(self) -> dict[str, Any]:
        sandbox, controls = self.sandbox, self.controls
        segment, thrown, entry = sandbox.segment, sandbox.is_thrown, controls.playlist[controls.number]
        # A change that needs a new start waits for the end of the drag if the start takes long.
        is_slow = sandbox.at_start and (sandbox.scene.lattice.points > LARGE or not thrown)
        waiting = [key for key in RANGES if "." in key and is_slow and key != "video.magnify"] + ["lattice.points"]
        can_aim = thrown and sandbox.at_start and not sandbox.message
        values = {key: controls.value(key) for key in CHOICES}
        return {
            **{name: getattr(sandbox, name) for name in ("message", "status", "warnings", "paused", "slow", "aimed")},
            "name": entry.name,
            "sentence": entry.sentence,
            "number": controls.number,
            "title": [*sandbox.seen.segment.scenario.title()],
            "hint": PAST_HINT if sandbox.time.past else AIM_HINT if can_aim else "",
            "solver": f"{segment.step.integrator.name}, step {segment.step.dt:.3g} R/c",
            "atStart": sandbox.at_start,
            "sliders": [
                {"key": key, "value": controls.value(key), "live": key not in waiting} | one._asdict()
                for key, one in controls.ranges.items()
            ],
            "choices": [
                {"key": key, "name": name, "value": values[key], "options": get_args(options)}
                for key, (name, options) in CHOICES.items()
                if values[key] is not None
            ],
            "seed": sandbox.scene.lattice.seed,
            "collecting": len(sandbox.collected),
            "results": [result_row(one) for one in sandbox.results],
        }


def result_row(result: Result) -> dict[str, Any]:
    """Return the line of the table for a result: its settings and its numbers."""
    scene: Any = result.scene
    impact = getattr(scene, "impact", None)
    return {
        "result": "e" if impact else "ξ",
        "value": result.value,
        "load": load_of(scene),
        "angle": impact and impact.angle,
        "spin": impact and impact.spin,
        "friction": getattr(scene.wall, "friction", None),
        "eta_star": scene.material.eta(result.points) * result.points,
        "a": scene.wall.a,
        "points": result.points,
        "contact_time": result.numbers.get("contact_time"),
        "disturbance": result.disturbance,
    }
