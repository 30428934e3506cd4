"""What a person can do: one table of actions, keys and buttons, one of numbers to change; files that are written."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, get_args

from taichi_disk.config.sections import Boundary, Colour, Draw, Theme
from taichi_disk.errors import TaichiDiskError
from taichi_disk.scenes import Scene
from taichi_disk.window.sandbox import Sandbox
from taichi_disk.window.scene_view import SceneView

MORE, MANY = 1.12, 1.5  # times as much, with each press of a key; times as many points
REPEATED = ("Left", "Right", "Up", "Down", "e", "d", "a", "z", "s", "f", "i", "u")  # while they are held
LEAST = {"material.eta_star": 0.1, "material.viscosity": 1e-4}  # viscosity that keys reach before 0
# What keys and sliders change: what is written at the slider, its keys, from where to where.
RANGES: dict[str, tuple[str, str, float, float]] = {
    "material.eta_star": ("η*", "e d", 0.0, 100.0),
    "material.viscosity": ("η", "e d", 0.0, 0.1),
    "impact.velocity": ("v / c", "↑ ↓", 1e-3, 0.1),
    "impact.angle": ("angle", "", -1.5, 1.5),
    "impact.spin": ("spin", "", -0.5, 0.5),
    "wall.friction": ("friction", "", 0.0, 1.0),
    "compression.pressure": ("P", "↑ ↓", 1e-4, 0.05),
    "wall.a": ("wall a", "a z", 10.0, 3000.0),
    "lattice.points": ("points", "j k", 100, 5000),
}
THROWN = ("impact.angle", "impact.spin", "wall.friction")  # of some scenes
SPEED = ("R/c per second", "s f", 0.05, 5.0)
Action = Callable[[], None]
Entry = tuple[str, Callable[[], Scene]]  # a scene by name, read when it is wanted


class Button(NamedTuple):
    """The key that does the same, whether it is on, what is written on it, and below that what is chosen."""

    key: str
    on: bool
    label: str
    value: str


class Slider(NamedTuple):
    """A number with its name and keys, from where to where, and what gives it another value."""

    label: str
    keys: str
    value: float
    low: float
    high: float
    change: Callable[[float], None]


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
        # Section of the panel, keys, what they do, what is written on their buttons, how it is done.
        self._table: list[tuple[str, str, str, str, tuple[Action, ...]]] = [
            ("Experiment", "space", "drop, pause, go on", "drop", (sandbox.pause,)),
            ("Experiment", "r", "back to the start", "to the start", (sandbox.begin,)),
            ("Experiment", "h", "hit again", "hit again", (sandbox.hit_again,)),
            ("Experiment", "l", "another lattice", "lattice", (self._next_lattice,)),
            ("Experiment", "b n", "scene before, after this one", "scene ◂, scene ▸", _each(self.play, (-1, 1))),
            ("Experiment", "w", "write the scene", "save scene", (lambda: sandbox.save(self.next_file(".yaml")),)),
            ("Experiment", "x", "boundary of the elastic wall", "boundary", (self._next("wall.boundary", Boundary),)),
            ("", "e d", "viscosity up, down", "", _both(lambda factor: self._more(self.dashpot_key, factor))),
            ("", "Up Down", "velocity, or load P", "", _both(lambda factor: self._more(self.push_key, factor))),
            ("", "a z", "wall harder, softer", "", _both(partial(self._more, "wall.a"))),
            ("", "j k", "fewer, more points", "", _both(partial(self._more, "lattice.points"), MANY)[::-1]),
            ("Time", "Left Right", "back and forth in time", "back, forth", _each(sandbox.step, (-1, 1))),
            ("Time", "y", "slow motion in contact", "slow contact", (partial(_toggle, sandbox, "slow"),)),
            ("", "s f", "time slower, faster", "", _both(lambda factor: self.set_speed(factor * sandbox.speed))[::-1]),
            ("Look", "c", "what colours show", "colour", (self._next("video.colour", Colour),)),
            ("Look", "o", "field, springs, both, points", "draw", (self._next("video.draw", Draw),)),
            ("Look", "t", "light or dark", "theme", (self._next("video.theme", Theme),)),
            ("Look", "i u", "closer, farther", "closer, farther", _both(lambda factor: view.zoom(factor, self.cursor))),
            ("Look", "BackSpace", "see everything", "see all", (view.home,)),
            ("Look", "g", "go to the contact", "contact", (view.contact,)),
            ("Look", "Return", "follow the disk", "follow", (view.follow,)),
            ("Look", "Tab", "these keys", "all keys", (partial(_toggle, self, "keys_shown"),)),
            ("Look", "p", "picture", "picture", (partial(_toggle, self, "picture_wanted"),)),
            ("Look", "v", "begin or end a film", "film", (partial(_toggle, self, "recording"),)),
            ("", "Escape", "let go of the disk", "", (sandbox.let_go,)),
            ("", "q", "close the window", "", (partial(_toggle, self, "closing"),)),
        ]
        self.reference = [(keys, what) for _, keys, what, _, _ in self._table]
        self.actions = {
            key: one for _, keys, *_, each in self._table for key, one in zip(keys.split(), each, strict=True)
        }

    # ---- the panel

    def buttons(self, section: str) -> list[Button]:
        """Of a section of the panel, as things stand."""
        sandbox, video = self.sandbox, self.sandbox.scene.video
        boundary, film = self.value("wall.boundary"), "end" if self.recording else ""
        absent = ("x",) * (not boundary) + ("h", "y") * (not sandbox.is_impact)
        values = {"l": str(sandbox.scene.lattice.seed), "x": boundary, "v": film}
        values |= {"c": video.colour, "o": video.draw, "t": video.theme}
        on = {"y": sandbox.slow, "v": self.recording, "Return": self.view.follows, "Tab": self.keys_shown}
        labels = {"space": "drop" if sandbox.at_start else "go on" if sandbox.paused else "pause"}
        return [
            Button(key, on.get(key, False), labels.get(key, label), values.get(key, ""))
            for own, keys, _, written, _ in self._table
            if own == section
            for key, label in zip(keys.split(), written.split(", "), strict=True)
            if key not in absent
        ]

    def sliders(self, section: str) -> list[Slider]:
        """The same of its sliders; a value beyond a range widens it."""
        if section == "Time":
            return [Slider(*SPEED[:2], self.sandbox.speed, *SPEED[2:], self.set_speed)]
        keys = (self.dashpot_key, self.push_key, *THROWN, "wall.a", "lattice.points") if section == "Experiment" else ()
        found = []
        for key in [key for key in keys if self.value(key) is not None]:
            (label, own, low, high), value = RANGES[key], self.value(key)
            found.append(Slider(label, own, value, min(low, value), max(high, value), partial(self.set, key)))
        return found

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
        return getattr(getattr(self.sandbox.scene, section, None), name, None)

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

    def _next(self, key: str, choice: Any) -> Action:
        """What gives a word of the scene the next value of its choice."""

        def act() -> None:
            values, value = get_args(choice), self.value(key)
            if value in values:
                self.sandbox.set(key, values[(values.index(value) + 1) % len(values)])

        return act

    def _next_lattice(self) -> None:
        self.sandbox.set("lattice.seed", self.sandbox.scene.lattice.seed + 1)

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


def _each(act: Callable[[Any], None], values: tuple[Any, Any]) -> tuple[Action, Action]:
    return partial(act, values[0]), partial(act, values[1])


def _both(act: Callable[[float], None], factor: float = MORE) -> tuple[Action, Action]:
    """More and less."""
    return _each(act, (factor, 1.0 / factor))


def _toggle(owner: object, name: str) -> None:
    setattr(owner, name, not getattr(owner, name))
