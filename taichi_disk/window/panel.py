"""The panels of sliders, buttons and read-outs. They decide nothing: they say what a hand has moved.

ImGui lets a panel be dragged away by any row of text, and GGUI places it only when its name is first seen. So after
each press on them the panels get new names (what follows ## is not shown), and are at home again.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from taichi_disk.scenes.impact import ImpactScenario
from taichi_disk.simulation.observables import INDEX
from taichi_disk.window.controls import Controls
from taichi_disk.window.stage import PANEL, SIZE

HEIGHTS = (("Experiment", 306), ("Time", 120), ("Look", 216), ("Numbers", 0))  # pixels; the last takes what is left
LARGE = 5000  # points, from which on a new start takes longer than a picture may
_GREEN, _ORANGE, _GREY = (0.45, 0.85, 0.55), (1.0, 0.65, 0.25), (0.62, 0.66, 0.72)
_PUSHES = {"impact.velocity": ("v/c", 1.0, 0.001, 0.1), "compression.pressure": ("1000 P", 1e3, 0.1, 50.0)}
_POINTS = "points [j k]"
Wish = Callable[[], None]


class Panel:
    """Four sections at the window's left. What a hand moves is done by `carry_out`, between two pictures."""

    def __init__(self, gui: Any, controls: Controls) -> None:
        self._gui, self._controls, self._sandbox = gui, controls, controls.sandbox
        self._wishes: dict[str, tuple[float, Wish]] = {}  # by key or slider: the value that is wished for, and how
        self._home, self._height = 0, 0

    def go_home(self) -> None:
        """Put the panels where they belong."""
        self._home += 1

    def show(self, height: int) -> None:
        """In a window of so many pixels. GGUI counts in parts of the size that the window had at first."""
        if height != self._height:
            self._height = height
            self.go_home()
        top, (wide, high) = 0, SIZE
        contents = self._experiment, self._time, self._look, self._numbers
        for (name, rows), content in zip(HEIGHTS, contents, strict=True):
            rows = rows or max(height - top, 60)
            with self._gui.sub_window(f"{name}##{self._home}", 0.0, top / high, PANEL / wide, rows / high):
                content()
            top += rows
        if self._controls.keys_shown:
            with self._gui.sub_window(f"Keys##{self._home}", (PANEL + 30) / wide, 112 / high, 330 / wide, 500 / high):
                for key, what in self._controls.reference:
                    self._gui.text(f"{key:<12}{what}")

    def carry_out(self, held: bool) -> None:
        """Do what was wished for. What takes long to build waits until no button of the mouse is `held`."""
        sandbox = self._sandbox
        slow = sandbox.at_start and (sandbox.scene.lattice.points > LARGE or not sandbox.is_impact)
        if not (held and (slow or _POINTS in self._wishes)):
            wishes, self._wishes = self._wishes, {}
            for _, wish in wishes.values():
                wish()

    # ---- sections

    def _experiment(self) -> None:
        controls, sandbox = self._controls, self._sandbox
        scene = sandbox.scene
        self._gui.text(f"{controls.number + 1} of {len(controls.playlist)}  {scene.scene}")
        self._button("next scene", "n")
        self._slider("eta* [e d]", "material.eta_star", 1.0, 0.0, 100.0)
        name, *scale = _PUSHES[controls.push_key]
        self._slider(name, controls.push_key, *scale)
        self._slider("wall a [a z]", "wall.a", 1.0, 10.0, 3000.0)
        self._slider(_POINTS, "lattice.points", 1.0, 100, 5000)
        self._button("drop" if sandbox.at_start else "go on" if sandbox.paused else "pause", "space")
        self._button("back to the start", "r")
        if sandbox.is_impact:
            self._button("hit again", "h")
        if sandbox.stretch.status == "failed":
            self._button("start with half the step", "m")
        self._button(f"another lattice than {scene.lattice.seed}", "l")
        if boundary := controls.value("wall.boundary"):
            self._button(f"boundary: {boundary}", "x")
        self._button("write the scene", "w")

    def _time(self) -> None:
        sandbox = self._sandbox
        first, last = sandbox.time.stretches[0].began, sandbox.stretch.now
        self._slide("t, to rewind", sandbox.moment.t, first, max(last, first + 1e-3), sandbox.scrub)
        self._gui.text(f"[Left Right]  {len(sandbox.time.known)} states", _GREY)
        self._slide("R/c per s", sandbox.speed, 0.05, 5.0, self._controls.set_speed)
        if sandbox.is_impact:
            self._tick("slow in contact", sandbox.slow, "y")

    def _look(self) -> None:
        controls, video = self._controls, self._sandbox.scene.video
        self._button(f"colour: {video.colour}", "c")
        self._button(f"draw: {video.draw}", "o")
        self._button(f"theme: {video.theme}", "t")
        self._tick("follow the disk", controls.stage.follows, "Return")
        self._button("go to the contact", "g")
        self._button("see everything", "BackSpace")
        self._button("end the film" if controls.recording else "record a film", "v")
        self._button("all keys", "Tab")

    def _numbers(self) -> None:
        write, sandbox = self._gui.text, self._sandbox
        row, step = sandbox.moment.row, sandbox.stretch.step
        write(f"v_cm {row[INDEX['com_vy']]:+.5f} c, force {row[INDEX['wall_force']]:.3g} Mc²/R")
        write(f"energy imbalance {sandbox.imbalance:+.1e}")
        if sandbox.given:
            write(f"energy given by hand {sandbox.given:+.1e} Mc²")
        write(f"{step.integrator.name}, step {step.dt:.3g} R/c", _GREY)
        if sandbox.stretch.behind > 0.0:
            write("computing again...", _ORANGE)
        elif sandbox.moment.by_hand:
            write("changed by hand: r to start again", _ORANGE)
        else:
            write("this is what run computes", _GREEN)
        if sandbox.results:
            write("result      v, P eta*      a", _GREY)
        for one in reversed(sandbox.results):
            scenario, scene = one.scenario, one.scenario.scene
            impact = isinstance(scenario, ImpactScenario)
            name, push = ("e =", scenario.velocity) if impact else ("xi=", scenario.pressure)
            numbers = f"{one.value:8.5f}{push:6.3g}{scene.material.eta_star:5.3g}{scene.wall.a:7.5g}"
            write(f"{name}{numbers} {one.label}")

    # ---- widgets

    def _button(self, what: str, key: str) -> None:
        if self._gui.button(f"{what}  [{key}]"):
            self._wishes[key] = 0.0, partial(self._controls.press, key)

    def _tick(self, what: str, value: bool, key: str) -> None:
        if self._gui.checkbox(f"{what} [{key}]", value) != value:
            self._wishes[key] = 0.0, partial(self._controls.press, key)

    def _slider(self, label: str, key: str, unit: float, low: float, high: float) -> None:
        """Of a key of the scene, shown in `unit`s."""
        value = self._controls.value(key)
        slide, value = (self._gui.slider_int, value) if isinstance(value, int) else (None, unit * value)
        self._slide(label, value, low, high, lambda new: self._controls.set(key, new / unit), slide)

    def _slide(
        self, label: str, value: float, low: float, high: float, change: Callable[[float], None], slide: Any = None
    ) -> None:
        # The label names the slider for ImGui: it may not change while it is dragged. It works in single precision.
        shown, _ = self._wishes.get(label, (value, None))
        new = (slide or self._gui.slider_float)(label, shown, low, max(high, value))
        if np.float32(new) != np.float32(shown):
            self._wishes[label] = new, partial(change, new)
