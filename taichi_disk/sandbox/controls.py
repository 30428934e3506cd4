"""The user's controls of the sandbox: a table of actions and their keys, one of
numbers, one of choices."""

from __future__ import annotations

import re
import traceback
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import yaml

from taichi_disk.base.errors import InputError, TaichiDiskError
from taichi_disk.base.files import write_text
from taichi_disk.base.text_files import read_text
from taichi_disk.experiments.config.sections import SLIDERS
from taichi_disk.experiments.scenes import Scene
from taichi_disk.sandbox.sandbox import Sandbox, load_key, value_of

# by which keys change a value, and the number of points
FACTORS = (1.12, 1 / 1.12)
POINT_FACTORS = (1 / 1.5, 1.5)
# smallest values above 0 to which keys change a viscosity
MIN_VISCOSITY = {"material.eta_star": 0.1, "material.viscosity": 1e-4}
# largest number that can be typed, for which the compiled kernels have room
MAX_POINTS = 12_000
MAX_VELOCITY = 1.0  # largest speed of a throw that can be typed [c]
MIN_SPEED = 0.01  # [R/c per s]
MAX_SPEED = 100.0  # [R/c per s]
# experiments of a collected curve, and their largest load over the least
CURVE_POINTS = 8
CURVE_RATIO = 30.0


class Range(NamedTuple):
    """A number that can be changed: its name, symbol, unit and keys, its meaning, and
    the ends of its slider."""

    name: str
    symbol: str
    unit: str
    keys: str
    meaning: str
    low: float
    high: float


TABLES = yaml.safe_load(read_text(Path(__file__).with_name("controls.yaml")))
RANGES = {
    key: Range(*row, *SLIDERS.get(key, ())) for key, row in TABLES["ranges"].items()
}
CHOICES = TABLES["choices"]
REPEATING_KEYS = TABLES["repeating"]
SVG = '<svg xmlns="http://www.w3.org/2000/svg"><path d="{}"/></svg>\n'


class Preset(NamedTuple):
    """A scene of the list: its name, a question or its origin, the function that reads
    the scene, its group, and the speed of time with which it begins [R/c per s], with
    contacts in slow motion; None: as they were before."""

    name: str
    question: str
    load: Callable[[], Scene]
    group: str = ""
    pace: float | None = None


def described(error: Exception) -> str:
    """Return the message for the user; an error of the program itself is printed, too,
    so that it can be reported."""
    if isinstance(error, TaichiDiskError):
        return str(error)
    traceback.print_exception(type(error), error, error.__traceback__)
    return (
        f"this has failed by an error of the program, {type(error).__name__}: {error}"
    )


class Controls:
    """The actions, numbers and choices of a sandbox.

    Attributes:
        number: place of the scene in `playlist`.
        refusals: number of commands that ended with an error.
        actions: the action of each key.
        reference: groups of keys and the meaning of each group, for a list of keys.
    """

    def __init__(self, sandbox: Sandbox, playlist: list[Preset]) -> None:
        self.sandbox = sandbox
        self.playlist = playlist
        self.number = 0
        self.refusals = 0
        self._folder = TemporaryDirectory()  # of bodies that the user has drawn
        self._drawings = 0
        self._take_pace()
        self.actions: dict[str, Callable[[], None]] = {}
        self.reference: list[tuple[str, str]] = []
        add = self.add
        scale = self._scale
        add("space", "throw, pause, go on", sandbox.pause)
        add("r", "back to the start", sandbox.begin)
        add("h", "hit again", sandbox.hit_again)
        add("Left Right", "back and forth in time", sandbox.step, -1, 1)
        add("s m", "time slower, faster", partial(scale, "speed"), *FACTORS[::-1])
        add(
            "y",
            "slow motion in contact",
            lambda: setattr(sandbox, "slow", not sandbox.slow),
        )
        add(
            "e d",
            "viscosity up, down",
            lambda factor: scale(self.dashpot_key, factor),
            *FACTORS,
        )
        add(
            "Up Down",
            "speed or load up, down",
            lambda factor: scale(load_key(sandbox.scene), factor),
            *FACTORS,
        )
        add("a z", "wall harder, softer", partial(scale, "wall.a"), *FACTORS)
        add(
            "j k",
            "fewer, more mass points",
            partial(scale, "lattice.points"),
            *POINT_FACTORS,
        )
        add(
            "l",
            "another random lattice",
            lambda: sandbox.set("lattice.seed", sandbox.scene.lattice.seed + 1),
        )
        add("x", "boundary of the elastic wall", self._next, "wall.boundary")
        add(
            "b n",
            "scene before, after this one",
            lambda step: self.play(self.number + step),
            -1,
            1,
        )
        add("c", "quantity shown by colours", self._next, "video.colour")
        add("o", "field, springs, both, points", self._next, "video.draw")
        add("t", "light or dark", self._next, "video.theme")
        add("Escape", "let go of the disk", sandbox.release)

    def add(
        self, keys: str, meaning: str, act: Callable[..., None], *values: Any
    ) -> None:
        """Let each of `keys` call `act` with the value at its place in `values`; a
        single key needs no value."""
        self.reference.append((keys, meaning))
        if not values:
            self.actions[keys] = act
            return
        for key, value in zip(keys.split(), values, strict=True):
            self.actions[key] = partial(act, value)

    def press(self, key: str) -> None:
        """Do the action of a key; an unknown key does nothing."""
        self.attempt(self.actions.get(key, lambda: None))

    def attempt(self, act: Callable[..., Any], *values: Any) -> None:
        """Call `act` with `values`; an error becomes the sandbox's message."""
        try:
            act(*values)
        except Exception as error:
            self.sandbox.message = described(error)
            self.refusals += 1

    # ---- values

    @property
    def dashpot_key(self) -> str:
        """The key that sets the dashpots: eta*, or the viscosity, which a change of the
        number of points keeps."""
        return f"material.{self.sandbox.scene.material.dashpots[0]}"

    @property
    def ranges(self) -> dict[str, Range]:
        """The numbers of the present scene by their keys; a value outside its range
        widens the range."""
        ranges = {}
        for key, usual in RANGES.items():
            if key.startswith("material.") and key != self.dashpot_key:
                continue
            value = self.value(key)
            if key == "impact.gravity" and not value:
                continue  # a scene without it has other keys that gravity excludes
            if value is not None:
                low = min(usual.low, value)
                high = max(usual.high, value)
                ranges[key] = usual._replace(low=low, high=high)
        return ranges

    def value(self, key: str) -> Any:
        """Return the value of "speed" or of a dotted key of the scene, or None if the
        scene has no such key."""
        if key == "speed":
            return self.sandbox.speed
        value = value_of(self.sandbox.scene, key)
        # the largest displacement is not known here
        return 1.0 if value == "auto" else value

    def options(self, key: str) -> tuple[str, ...]:
        """Return the values of a choice that the scene has."""
        section, name = key.split(".")
        return self.sandbox.scene.sections()[section].schema()[name].words

    def set(self, key: str, value: Any) -> None:
        """Change a number or a choice; a key that the scene does not have is ignored.
        Raises TaichiDiskError."""
        self.sandbox.message = ""  # why a number before was refused
        now = self.value(key)
        if key == "speed":
            self.sandbox.speed = float(f"{min(max(value, MIN_SPEED), MAX_SPEED):.3g}")
        elif key == "lattice.points":
            self._set_points(value)
        elif isinstance(now, (int, float)):
            if key == "impact.velocity" and value > MAX_VELOCITY:
                raise InputError(
                    f"v = {value:g} c is no speed of this model: its springs cross far"
                    f" below c; type at most {MAX_VELOCITY:g}"
                )
            self.sandbox.set(key, type(now)(float(f"{value:.6g}")))
        elif now is not None:
            self.sandbox.set(key, value)

    def outline(self, path: str) -> None:
        """Take the body that the user has drawn, a `path` of an SVG. Raises
        TaichiDiskError."""
        if not re.fullmatch("M[-0-9.L ]+Z", path):
            return
        self._drawings += 1
        file = Path(self._folder.name, f"drawn-{self._drawings}.svg")
        write_text(file, SVG.format(path))
        self.sandbox.set("lattice.outline", str(file))

    def _set_points(self, value: float) -> None:
        most = max(MAX_POINTS, self.sandbox.scene.lattice.points)
        self.sandbox.set("lattice.points", int(min(value, most)))
        if value > most:
            self.sandbox.message = (
                f"N is {most}, not {value:.0f}: larger disks are for `taichi-disk run`"
            )

    def _scale(self, key: str, factor: float) -> None:
        """Multiply the value of `key` by `factor`, clipped to its slider range."""
        scaled = self.value(key) * factor
        clipped = min(max(scaled, RANGES[key].low), self.ranges[key].high)
        new = float(f"{clipped:.3g}")
        least = MIN_VISCOSITY.get(key, 0.0)
        if new < least and factor > 1.0:
            new = least
        elif new < least:
            new = 0.0
        self.set(key, new)

    def _next(self, key: str) -> None:
        """Change a choice to the next of its values, or to the first after the last, if
        the scene has it."""
        value = self.value(key)
        if value is not None:
            values = self.options(key)
            self.sandbox.set(key, values[(values.index(value) + 1) % len(values)])

    # ---- scenes

    def play(self, number: float) -> None:
        """Begin the scene `number` modulo the playlist's length; keep the drawing
        options. Raises TaichiDiskError."""
        number = int(number) % len(self.playlist)
        scene = self.playlist[number].load()
        # On an elastic wall displacements may not be magnified.
        self.sandbox.begin(
            replace(
                scene,
                video=replace(self.sandbox.scene.video, magnify=scene.video.magnify),
            )
        )
        self.number = number
        self._take_pace()

    def _take_pace(self) -> None:
        """Let time pass as the scene of the list suggests."""
        pace = self.playlist[self.number].pace
        if pace is not None:
            self.sandbox.speed = pace
            self.sandbox.slow = True

    def collect(self) -> None:
        """Collect a curve of results over the range of speeds or loads, or stop
        collecting. Raises TaichiDiskError."""
        sandbox = self.sandbox
        if sandbox.remaining_loads:
            sandbox.stop_collecting()
        else:
            high = RANGES[load_key(sandbox.scene)].high
            loads = np.geomspace(high, high / CURVE_RATIO, CURVE_POINTS)
            sandbox.collect([float(f"{load:.2g}") for load in loads])
