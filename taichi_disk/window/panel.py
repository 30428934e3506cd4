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
from taichi_disk.window.changes import push_of
from taichi_disk.window.controls import RANGES, Controls
from taichi_disk.window.stage import PANEL

HEIGHTS = (("Experiment", 306), ("Time", 98), ("Look", 216), ("Numbers", 0))  # pixels; the last takes what is left
LARGE = 5000  # points, from which on a new start takes longer than a picture may
_GREEN, _ORANGE, _GREY = (0.45, 0.85, 0.55), (1.0, 0.65, 0.25), (0.62, 0.66, 0.72)
Wish = Callable[[], None]


class Panel:
    """Four sections at the window's left. What a hand moves is done by `carry_out`, between two pictures."""

    def __init__(self, gui: Any, controls: Controls, size: tuple[int, int]) -> None:
        """`size`: of the window when it was opened [px]. GGUI gives places and sizes in parts of that."""
        self._gui, self._controls, self._sandbox = gui, controls, controls.sandbox
        self._size = size
        self._wishes: dict[str, tuple[float, Wish]] = {}  # by key or slider: the value that is wished for, and how
        self._home, self._height = 0, 0

    def go_home(self) -> None:
        """Put the panels where they belong."""
        self._home += 1

    def show(self, height: int) -> None:
        """In a window of so many pixels."""
        if height != self._height:
            self._height = height
            self.go_home()
        top, (wide, high) = 0, self._size
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
        if not (held and (slow or RANGES["lattice.points"][0] in self._wishes)):
            wishes, self._wishes = self._wishes, {}
            for _, wish in wishes.values():
                wish()

    # ---- sections

    def _experiment(self) -> None:
        controls, sandbox = self._controls, self._sandbox
        scene = sandbox.scene
        self._gui.text(f"{controls.number + 1} of {len(controls.playlist)}  {scene.scene}")
        self._button("next scene", "n")
        for key in ("material.eta_star", controls.push_key, "wall.a", "lattice.points"):
            label, unit, low, high = RANGES[key]
            change = partial(self._change, key, unit)
            self._slide(label, unit * controls.value(key), unit * low, unit * high, change)
        self._button("drop" if sandbox.at_start else "go on" if sandbox.paused else "pause", "space")
        self._button("back to the start", "r")
        if sandbox.is_impact:
            self._button("hit again", "h")
        self._button(f"another lattice than {scene.lattice.seed}", "l")
        if boundary := controls.value("wall.boundary"):
            self._button(f"boundary: {boundary}", "x")
        self._button("write the scene", "w")

    def _time(self) -> None:
        sandbox = self._sandbox
        self._gui.text(f"[Left Right] to rewind, {len(sandbox.time.moments)} states", _GREY)
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
        row, step = sandbox.moment.row, sandbox.driver.step
        write(f"v {row[INDEX['com_vy']]:+.5f} c, force {row[INDEX['wall_force']]:.3g} Mc²/R")
        write(f"energy imbalance {sandbox.imbalance:+.1e}")
        write(f"{step.integrator.name}, step {step.dt:.3g} R/c", _GREY)
        if sandbox.time.behind:
            write("computing again...", _ORANGE)
        elif sandbox.moment.by_hand:
            write("changed by hand: r to start again", _ORANGE)
        else:
            write("this is what run computes", _GREEN)
        if sandbox.results:
            write("result      v, P eta*      a", _GREY)
        for one in reversed(sandbox.results):
            scene, name = one.scenario.scene, "e =" if isinstance(one.scenario, ImpactScenario) else "xi="
            numbers = f"{one.value:8.5f}{push_of(scene):6.3g}{scene.material.eta_star:5.3g}{scene.wall.a:7.5g}"
            write(f"{name}{numbers} {one.label}")

    # ---- widgets

    def _button(self, what: str, key: str) -> None:
        if self._gui.button(f"{what}  [{key}]"):
            self._wishes[key] = 0.0, partial(self._controls.press, key)

    def _tick(self, what: str, value: bool, key: str) -> None:
        if self._gui.checkbox(f"{what} [{key}]", value) != value:
            self._wishes[key] = 0.0, partial(self._controls.press, key)

    def _change(self, key: str, unit: float, value: float) -> None:
        self._controls.set(key, value / unit)

    def _slide(self, label: str, value: float, low: float, high: float, change: Callable[[float], None]) -> None:
        # The label names the slider for ImGui: it may not change while it is dragged. It works in single precision.
        shown, _ = self._wishes.get(label, (value, None))
        slide = self._gui.slider_int if isinstance(value, int) else self._gui.slider_float
        new = slide(label, shown, low, max(high, value))
        if np.float32(new) != np.float32(shown):
            self._wishes[label] = new, partial(change, new)
