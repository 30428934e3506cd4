"""What a person can do, by keys and buttons alike: one table of actions."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

from taichi_disk.config.sections import Boundary, Colour, Draw, Theme
from taichi_disk.errors import TaichiDiskError
from taichi_disk.window.app import Entry
from taichi_disk.window.sandbox import Sandbox
from taichi_disk.window.stage import Stage

MORE, MANY = 1.12, 1.5  # times as much, with each press of a key; times as many points
REPEATED = ("Left", "Right", "Up", "Down", "e", "d", "a", "z", "s", "f", "i", "u")  # while they are held
LEAST_ETA = 0.1  # viscosity that keys reach before 0
# What keys and sliders change: what is written beside the slider, how many of its units are 1, from where to where.
RANGES: dict[str, tuple[str, int, float, float]] = {
    "material.eta_star": ("eta* [e d]", 1, 0.0, 100.0),
    "impact.velocity": ("v/c", 1, 1e-3, 0.1),
    "compression.pressure": ("1000 P", 1000, 1e-4, 0.05),
    "wall.a": ("wall a [a z]", 1, 10.0, 3000.0),
    "lattice.points": ("points [j k]", 1, 100, 5000),
}
Action = Callable[[], None]


class Controls:
    """Acts on a sandbox and its stage; files go into the folder `out`.

    GGUI hears letters, arrows, space, Tab, Return, BackSpace and Escape, but no digits, signs and function keys.

    Attributes:
        recording, picture_wanted, closing, keys_shown: what the window has to carry out.
        number: of the scene in the playlist.
        cursor: where the mouse is (column, row) [px].
        actions: what each key does.
        reference: keys, and what they do.
    """

    def __init__(self, sandbox: Sandbox, stage: Stage, playlist: list[Entry], out: Path) -> None:
        self.sandbox, self.stage, self.playlist, self.out = sandbox, stage, playlist, out
        self.recording = self.picture_wanted = self.closing = self.keys_shown = False
        self.number, self.cursor = 0, (0.0, 0.0)
        table: list[tuple[str, str, tuple[Action, ...]]] = [
            ("space", "drop, pause, go on", (sandbox.pause,)),
            ("r", "back to the start", (sandbox.begin,)),
            ("h", "hit again", (sandbox.hit_again,)),
            ("Left Right", "back and forth in time", (partial(sandbox.step, -1), partial(sandbox.step, 1))),
            ("s f", "time slower, faster", _both(self._faster)[::-1]),
            ("y", "slow motion in contact", (partial(_toggle, sandbox, "slow"),)),
            ("e d", "viscosity eta* up, down", _both(partial(self._more, "material.eta_star"))),
            ("Up Down", "velocity, or load P", _both(partial(self._more, ""))),
            ("a z", "wall harder, softer", _both(partial(self._more, "wall.a"))),
            ("j k", "fewer, more points", _both(partial(self._more, "lattice.points"), MANY)[::-1]),
            ("l", "another lattice", (lambda: sandbox.set("lattice.seed", sandbox.scene.lattice.seed + 1),)),
            ("b n", "scene before, after this one", (partial(self.play, -1), partial(self.play, 1))),
            ("x", "boundary of the elastic wall", (partial(self._next, "wall.boundary", Boundary),)),
            ("c", "what colours show", (partial(self._next, "video.colour", Colour),)),
            ("o", "field, springs, both, points", (partial(self._next, "video.draw", Draw),)),
            ("t", "light or dark", (partial(self._next, "video.theme", Theme),)),
            ("i u", "closer, farther", _both(self._zoom)),
            ("g", "go to the contact", (stage.contact,)),
            ("Return", "follow the disk", (stage.follow,)),
            ("BackSpace", "see everything", (stage.home,)),
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
        """Do what a key stands for; an unknown one does nothing. What fails is told in the sandbox's message."""
        try:
            self.actions.get(key, lambda: None)()
        except TaichiDiskError as error:
            self.sandbox.message = str(error)

    # ---- values

    @property
    def push_key(self) -> str:
        """The velocity of an impact [c], the force of a compression [M c^2/R]."""
        return ".".join(self.sandbox.scene.abscissa)

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

    def _faster(self, factor: float) -> None:
        self.set_speed(factor * self.sandbox.speed)

    def _zoom(self, factor: float) -> None:
        self.stage.zoom(factor, self.cursor)

    def _more(self, key: str, factor: float) -> None:
        """A number ("": the push) times a factor, in its range or no farther out."""
        key = key or self.push_key
        value, (_, _, low, high) = self.value(key), RANGES[key]
        new = min(max(value * factor, low), max(high, value))
        if key == "material.eta_star" and new < LEAST_ETA:
            new = LEAST_ETA if factor > 1.0 else 0.0
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
