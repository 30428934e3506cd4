"""What a person can do: one table of actions for keys and buttons, and the panels of sliders, buttons and read-outs."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

import numpy as np

from taichi_disk.config.sections import Boundary, Colour, Draw, Theme
from taichi_disk.errors import TaichiDiskError
from taichi_disk.scenes import Scene
from taichi_disk.scenes.impact import ImpactScenario
from taichi_disk.simulation.observables import INDEX
from taichi_disk.window.sandbox import Sandbox, push_of
from taichi_disk.window.scene_view import PANEL, SceneView

MORE, MANY = 1.12, 1.5  # times as much, with each press of a key; times as many points
REPEATED = ("Left", "Right", "Up", "Down", "e", "d", "a", "z", "s", "f", "i", "u")  # while they are held
LEAST = {"material.eta_star": 0.1, "material.viscosity": 1e-4}  # viscosity that keys reach before 0
# What keys and sliders change: what is written beside the slider, how many of its units are 1, from where to where.
RANGES: dict[str, tuple[str, int, float, float]] = {
    "material.eta_star": ("eta* [e d]", 1, 0.0, 100.0),
    "material.viscosity": ("1000 eta [e d]", 1000, 0.0, 0.1),
    "impact.velocity": ("v/c", 1, 1e-3, 0.1),
    "impact.angle": ("angle", 1, -1.5, 1.5),
    "impact.spin": ("spin", 1, -0.5, 0.5),
    "wall.friction": ("friction", 1, 0.0, 1.0),
    "compression.pressure": ("1000 P", 1000, 1e-4, 0.05),
    "wall.a": ("wall a [a z]", 1, 10.0, 3000.0),
    "lattice.points": ("points [j k]", 1, 100, 5000),
}
THROWN = ("impact.angle", "impact.spin", "wall.friction")  # of some scenes
HEIGHTS = (("Experiment", 376), ("Time", 98), ("Look", 216), ("Numbers", 0))  # pixels; the last takes what is left
LARGE = 5000  # points, from which on a new start takes longer than a picture may
_GREEN, _ORANGE, _GREY = (0.45, 0.85, 0.55), (1.0, 0.65, 0.25), (0.62, 0.66, 0.72)
Action = Callable[[], None]
Entry = tuple[str, Callable[[], Scene]]  # a scene by name, read when it is wanted


class Controls:
    """Acts on a sandbox and its view; files go into the folder `out`.

    GGUI hears letters, arrows, space, Tab, Return, BackSpace and Escape, but no digits, signs and function keys.

    Attributes:
        recording, picture_wanted, closing, keys_shown: what the window has to carry out.
        number: of the scene in the playlist.
        cursor: where the mouse is (column, row) [px].
        actions: what each key does.
        reference: keys, and what they do.
    """

    def __init__(self, sandbox: Sandbox, view: SceneView, playlist: list[Entry], out: Path) -> None:
        self.sandbox, self.view, self.playlist, self.out = sandbox, view, playlist, out
        self.recording = self.picture_wanted = self.closing = self.keys_shown = False
        self.number, self.cursor = 0, (0.0, 0.0)
        table: list[tuple[str, str, tuple[Action, ...]]] = [
            ("space", "drop, pause, go on", (sandbox.pause,)),
            ("r", "back to the start", (sandbox.begin,)),
            ("h", "hit again", (sandbox.hit_again,)),
            ("Left Right", "back and forth in time", (partial(sandbox.step, -1), partial(sandbox.step, 1))),
            ("s f", "time slower, faster", _both(lambda factor: self.set_speed(factor * sandbox.speed))[::-1]),
            ("y", "slow motion in contact", (partial(_toggle, sandbox, "slow"),)),
            ("e d", "viscosity up, down", _both(lambda factor: self._more(self.dashpot_key, factor))),
            ("Up Down", "velocity, or load P", _both(lambda factor: self._more(self.push_key, factor))),
            ("a z", "wall harder, softer", _both(partial(self._more, "wall.a"))),
            ("j k", "fewer, more points", _both(partial(self._more, "lattice.points"), MANY)[::-1]),
            ("l", "another lattice", (lambda: sandbox.set("lattice.seed", sandbox.scene.lattice.seed + 1),)),
            ("b n", "scene before, after this one", (partial(self.play, -1), partial(self.play, 1))),
            ("x", "boundary of the elastic wall", (partial(self._next, "wall.boundary", Boundary),)),
            ("c", "what colours show", (partial(self._next, "video.colour", Colour),)),
            ("o", "field, springs, both, points", (partial(self._next, "video.draw", Draw),)),
            ("t", "light or dark", (partial(self._next, "video.theme", Theme),)),
            ("i u", "closer, farther", _both(lambda factor: view.zoom(factor, self.cursor))),
            ("g", "go to the contact", (view.contact,)),
            ("Return", "follow the disk", (view.follow,)),
            ("BackSpace", "see everything", (view.home,)),
            ("v", "begin or end a film", (partial(_toggle, self, "recording"),)),
            ("p", "picture", (partial(_toggle, self, "picture_wanted"),)),
            ("w", "write the scene", (lambda: sandbox.save(self.next_file(".yaml")),)),
            ("Tab", "these keys", (partial(_toggle, self, "keys_shown"),)),
            ("Escape", "let go of the disk", (sandbox.let_go,)),
            ("q", "close the window", (partial(_toggle, self, "closing"),)),
        ]
        self.reference = [(keys, what) for keys, what, _ in table]
        self.actions = {key: one for keys, _, each in table for key, one in zip(keys.split(), each, strict=True)}

    def press(self, key: str) -> None:
        """Do what a key stands for; an unknown one does nothing. What fails is in the sandbox's message."""
        try:
            self.actions.get(key, lambda: None)()
        except TaichiDiskError as error:
            self.sandbox.message = str(error)

    # ---- values

    @property
    def push_key(self) -> str:
        """The velocity of an impact [c], the force of a compression [M c^2/R]."""
        return ".".join(self.sandbox.scene.abscissa)

    @property
    def dashpot_key(self) -> str:
        """eta*, or the viscosity, which stays with the body when its number of points changes."""
        return f"material.{self.sandbox.scene.material.dashpots[0]}"

    def value(self, key: str) -> Any:
        """Of a dotted key of the scene; None where there is none."""
        section, name = key.split(".")
        return getattr(getattr(self.sandbox.scene, section), name, None)

    def set(self, key: str, value: float) -> None:
        """Change a number of the scene; three digits are enough."""
        self.sandbox.set(key, type(self.value(key))(float(f"{value:.3g}")))

    def set_speed(self, speed: float) -> None:
        """Simulated time per second of the clock [R/c per s]."""
        self.sandbox.speed = float(f"{min(max(speed, 0.01), 100.0):.3g}")

    def _more(self, key: str, factor: float) -> None:
        """A number times a factor, in its range or no farther out."""
        value, (_, _, low, high) = self.value(key), RANGES[key]
        new = min(max(value * factor, low), max(high, value))
        if new < LEAST.get(key, 0.0):
            new = LEAST[key] if factor > 1.0 else 0.0
        self.set(key, new)

    def _next(self, key: str, choice: Any) -> None:
        values, value = get_args(choice), self.value(key)
        if value in values:
            self.sandbox.set(key, values[(values.index(value) + 1) % len(values)])

    # ---- scenes and files

    def play(self, way: int) -> None:
        """Begin with the scene so many places on in the playlist; the look stays. Raises TaichiDiskError."""
        self.number = (self.number + way) % len(self.playlist)
        (name, load), sandbox = self.playlist[self.number], self.sandbox
        sandbox.begin(replace(load(), video=sandbox.scene.video))
        sandbox.message = f"{self.number + 1} of {len(self.playlist)}: {name}"

    def next_file(self, suffix: str) -> Path:
        """A name in `out` that is not taken: view-1.yaml, view-2.yaml..."""
        number = 1
        while os.path.exists(path := self.out / f"view-{number}{suffix}"):  # no, where nothing can be looked up
            number += 1
        return path


def _both(act: Callable[[float], None], factor: float = MORE) -> tuple[Action, Action]:
    """More and less."""
    return partial(act, factor), partial(act, 1.0 / factor)


def _toggle(owner: object, name: str) -> None:
    setattr(owner, name, not getattr(owner, name))


class Panel:
    """Four sections at the window's left. What a hand moves is done by `carry_out`, between two pictures.

    ImGui lets a panel be dragged away by any row of text, and GGUI places it only when its name is first seen. So after
    each press on them, and in a window of another height, they get new names (what follows ## is not shown), and are at
    home again.
    """

    def __init__(self, gui: Any, controls: Controls, size: tuple[int, int]) -> None:
        """`size`: of the window when it was opened [px]. GGUI gives places and sizes in parts of that."""
        self._gui, self._controls, self._sandbox = gui, controls, controls.sandbox
        self._size = size
        self._pending: dict[str, tuple[float, Action]] = {}  # by key or slider: the value that it is to have, and how
        self._home = 0

    def go_home(self) -> None:
        """Put the panels where they belong."""
        self._home += 1

    def show(self, height: int) -> None:
        """In a window of so many pixels."""
        top, (wide, high), new = 0, self._size, f"##{self._home}, {height}"
        contents = self._experiment, self._time, self._look, self._numbers
        for (name, rows), content in zip(HEIGHTS, contents, strict=True):
            rows = rows or max(height - top, 60)
            with self._gui.sub_window(name + new, 0.0, top / high, PANEL / wide, rows / high):
                content()
            top += rows
        if self._controls.keys_shown:
            with self._gui.sub_window("Keys" + new, (PANEL + 30) / wide, 112 / high, 330 / wide, 500 / high):
                for key, what in self._controls.reference:
                    self._gui.text(f"{key:<12}{what}")

    def carry_out(self, pressed: bool) -> None:
        """Do what is pending. What takes long to build waits until no button of the mouse is `pressed`."""
        sandbox = self._sandbox
        slow = sandbox.at_start and (sandbox.scene.lattice.points > LARGE or not sandbox.is_impact)
        if not (pressed and (slow or RANGES["lattice.points"][0] in self._pending)):
            pending, self._pending = self._pending, {}
            for _, act in pending.values():
                act()

    # ---- sections

    def _experiment(self) -> None:
        controls, sandbox = self._controls, self._sandbox
        scene = sandbox.scene
        self._gui.text(f"{controls.number + 1} of {len(controls.playlist)}  {scene.scene}")
        self._button("next scene", "n")
        keys = (controls.dashpot_key, controls.push_key, *THROWN, "wall.a", "lattice.points")
        for key in [key for key in keys if controls.value(key) is not None]:
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
        self._gui.text(f"[Left Right] to rewind, {len(sandbox.time.checkpoints)} states", _GREY)
        self._slide("R/c per s", sandbox.speed, 0.05, 5.0, self._controls.set_speed)
        if sandbox.is_impact:
            self._tick("slow in contact", sandbox.slow, "y")

    def _look(self) -> None:
        controls, video = self._controls, self._sandbox.scene.video
        self._button(f"colour: {video.colour}", "c")
        self._button(f"draw: {video.draw}", "o")
        self._button(f"theme: {video.theme}", "t")
        self._tick("follow the disk", controls.view.follows, "Return")
        self._button("go to the contact", "g")
        self._button("see everything", "BackSpace")
        self._button("end the film" if controls.recording else "record a film", "v")
        self._button("all keys", "Tab")

    def _numbers(self) -> None:
        write, sandbox, key = self._gui.text, self._sandbox, self._controls.dashpot_key
        row, step = sandbox.seen.row, sandbox.segment.step
        write(f"v {row[INDEX['com_vy']]:+.5f} c, force {row[INDEX['wall_force']]:.3g} Mc²/R")
        write(f"energy imbalance {sandbox.imbalance:+.1e}")
        write(f"{step.integrator.name}, step {step.dt:.3g} R/c", _GREY)
        if sandbox.time.behind:
            write("computing again...", _ORANGE)
        elif sandbox.seen.by_hand:
            write("changed by hand: r to start again", _ORANGE)
        else:
            write("this is what run computes", _GREEN)
        if sandbox.results:
            write(f"result      v, P {RANGES[key][0].split(' [')[0]}      a", _GREY)
        for one in reversed(sandbox.results):
            scene, name = one.scenario.scene, "e =" if isinstance(one.scenario, ImpactScenario) else "xi="
            points = one.scenario.lattice.disk_points
            eta = scene.material.eta(points) * (points if key == "material.eta_star" else RANGES[key][1])
            numbers = f"{one.value:8.5f}{push_of(scene):6.3g}{eta:5.3g}{scene.wall.a:7.5g}"
            write(f"{name}{numbers} {one.label}")

    # ---- widgets

    def _button(self, what: str, key: str) -> None:
        if self._gui.button(f"{what}  [{key}]"):
            self._pending[key] = 0.0, partial(self._controls.press, key)

    def _tick(self, what: str, value: bool, key: str) -> None:
        if self._gui.checkbox(f"{what} [{key}]", value) != value:
            self._pending[key] = 0.0, partial(self._controls.press, key)

    def _change(self, key: str, unit: float, value: float) -> None:
        self._controls.set(key, value / unit)

    def _slide(self, label: str, value: float, low: float, high: float, change: Callable[[float], None]) -> None:
        # The label names the slider for ImGui: it may not change while it is dragged. It works in single precision.
        shown, _ = self._pending.get(label, (value, None))
        slide = self._gui.slider_int if isinstance(value, int) else self._gui.slider_float
        new = slide(label, shown, min(low, value), max(high, value))
        if np.float32(new) != np.float32(shown):
            self._pending[label] = new, partial(change, new)
