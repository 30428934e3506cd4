"""What a user can do in the sandbox: one table of actions and keys, one of numbers, one of choices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple, get_args

from taichi_disk.config.sections import Boundary, Colour, Dashpot, Draw, Theme
from taichi_disk.errors import TaichiDiskError
from taichi_disk.scenes import Scene
from taichi_disk.window.sandbox import Sandbox

MORE, MANY = 1.12, 1.5  # factors of one press of a key: of a value, of the number of points
REPEATED = ("Left", "Right", "Up", "Down", "e", "d", "a", "z", "s", "f", "i", "u")  # while they are held
LEAST = {"material.eta_star": 0.1, "material.viscosity": 1e-4}  # viscosity that keys reach before 0
LARGE = 5000  # points, from which on a new start takes longer than a picture may
CURVE, CURVE_SPAN = 8, 30.0  # experiments of a collected curve, and the ratio of their largest load to the least
Action = Callable[[], None]


class Range(NamedTuple):
    """A number of the scene: its name, unit and keys, the ends of its slider, and what it means."""

    name: str
    unit: str
    keys: str
    low: float
    high: float
    meaning: str


RANGES = {
    "material.eta_star": Range("viscosity η*", "", "e d", 0.0, 100.0, "dashpots, as a multiple of m c/R; 0: none"),
    "material.viscosity": Range("viscosity η", "Mc/R", "e d", 0.0, 0.1, "dashpot constant of one spring; 0: none"),
    "impact.velocity": Range("speed v", "c", "Up Down", 1e-3, 0.1, "of the throw"),
    "impact.angle": Range("angle", "rad", "", -1.5, 1.5, "between the throw and the normal of the wall"),
    "impact.spin": Range("spin", "c/R", "", -0.5, 0.5, "at the start, counter-clockwise"),
    "wall.friction": Range("friction μ", "", "", 0.0, 1.0, "Coulomb's coefficient of the wall"),
    "compression.pressure": Range("load P", "Mc²/R", "Up Down", 1e-4, 0.05, "force that presses the disk on the wall"),
    "wall.a": Range("wall hardness a", "1/R", "a z", 10.0, 3000.0, "steepness of the wall's potential"),
    "lattice.points": Range("mass points N", "", "j k", 100, 5000, "of the disk"),
}
SPEED = Range("speed of time", "R/c per s", "s f", 0.05, 5.0, "simulated time that one second shows")
MAGNIFY = Range("displacements ×", "", "", 1.0, 20.0, "drawn so many times as large as they are")
CHOICES: dict[str, tuple[str, Any]] = {
    "wall.boundary": ("boundary of the wall", Boundary),
    "material.dashpot": ("dashpots", Dashpot),
    "video.colour": ("colours show", Colour),
    "video.draw": ("drawn as", Draw),
    "video.theme": ("background", Theme),
}


class Entry(NamedTuple):
    """A scene of the list: its name, one sentence of what to look for, and how it is read when it is wanted."""

    name: str
    sentence: str
    load: Callable[[], Scene]


class Controls:
    """Acts on a sandbox.

    Attributes:
        number: of the scene in the playlist.
        actions: what each key does.
        reference: keys, and what they do.
    """

    def __init__(self, sandbox: Sandbox, playlist: list[Entry]) -> None:
        self.sandbox, self.playlist, self.number = sandbox, playlist, 0
        self.actions: dict[str, Action] = {}
        self.reference: list[tuple[str, str]] = []
        for keys, what, actions in (
            ("space", "drop, pause, go on", (sandbox.pause,)),
            ("r", "back to the start", (sandbox.begin,)),
            ("h", "hit again", (sandbox.hit_again,)),
            ("Left Right", "back and forth in time", _each(sandbox.step, (-1, 1))),
            ("s f", "time slower, faster", _both(lambda factor: self.set_speed(factor * sandbox.speed))[::-1]),
            ("y", "slow motion in contact", (self._toggle_slow,)),
            ("e d", "viscosity up, down", _both(lambda factor: self._more(self.dashpot_key, factor))),
            ("Up Down", "speed or load up, down", _both(lambda factor: self._more(self.load_key, factor))),
            ("a z", "wall harder, softer", _both(partial(self._more, "wall.a"))),
            ("j k", "fewer, more mass points", _both(partial(self._more, "lattice.points"), MANY)[::-1]),
            ("l", "another random lattice", (self._next_lattice,)),
            ("x", "boundary of the elastic wall", (partial(self._next, "wall.boundary"),)),
            ("b n", "scene before, after this one", _each(self.step_through, (-1, 1))),
            ("c", "what the colours show", (partial(self._next, "video.colour"),)),
            ("o", "field, springs, both, points", (partial(self._next, "video.draw"),)),
            ("t", "light or dark", (partial(self._next, "video.theme"),)),
            ("Escape", "let go of the disk", (sandbox.let_go,)),
        ):
            self.add(keys, what, *actions)

    def add(self, keys: str, what: str, *actions: Action) -> None:
        """Let each of `keys` do one of `actions`."""
        self.reference.append((keys, what))
        self.actions |= dict(zip(keys.split(), actions, strict=True))

    def press(self, key: str) -> None:
        """Do what a key stands for; an unknown one does nothing. What fails is in the sandbox's message."""
        self.attempt(self.actions.get(key, lambda: None))

    def attempt(self, act: Action) -> None:
        """Do what may fail with a message for the user."""
        try:
            act()
        except TaichiDiskError as error:
            self.sandbox.message = str(error)

    # ---- values

    @property
    def load_key(self) -> str:
        """The key that results are compared over: the speed of an impact [c], the load of a compression [M c^2/R]."""
        return ".".join(self.sandbox.scene.abscissa)

    @property
    def dashpot_key(self) -> str:
        """eta*, or the viscosity, which stays with the body when its number of points changes."""
        return f"material.{self.sandbox.scene.material.dashpots[0]}"

    @property
    def magnification(self) -> float:
        """How many times as large as they are displacements are drawn; the largest of a run is not known here."""
        factor = self.sandbox.scene.video.magnify
        return 1.0 if factor == "auto" else factor

    @property
    def ranges(self) -> dict[str, Range]:
        """The numbers of the present scene by their keys; a value beyond its range widens that."""
        found = {}
        for key, one in RANGES.items():
            value = self.value(key)
            unused = key.startswith("material.") and key != self.dashpot_key
            if value is not None and not unused:
                found[key] = one._replace(low=min(one.low, value), high=max(one.high, value))
        return found

    def value(self, key: str) -> Any:
        """The value of a dotted key of the scene, or None if the scene has no such key."""
        section, name = key.split(".")
        return getattr(getattr(self.sandbox.scene, section, None), name, None)

    def set(self, key: str, value: Any) -> None:
        """Change a number or a choice of the scene; a key that the scene does not have is ignored."""
        now = self.value(key)
        if isinstance(now, (int, float)):
            self.sandbox.set(key, type(now)(float(f"{value:.6g}")))
        elif now is not None:
            self.sandbox.set(key, value)

    def set_speed(self, speed: float) -> None:
        """Simulated time per second of the clock [R/c per s]."""
        self.sandbox.speed = float(f"{min(max(speed, 0.01), 100.0):.3g}")

    def _more(self, key: str, factor: float) -> None:
        """A number times a factor, in its range or no farther out."""
        value, one = self.value(key), RANGES[key]
        new = float(f"{min(max(value * factor, one.low), max(one.high, value)):.3g}")
        if new < LEAST.get(key, 0.0):
            new = LEAST[key] if factor > 1.0 else 0.0
        self.set(key, new)

    def _next(self, key: str) -> None:
        """Take the next value of a choice, if the scene has that choice."""
        values, value = get_args(CHOICES[key][1]), self.value(key)
        if value in values:
            self.sandbox.set(key, values[(values.index(value) + 1) % len(values)])

    def _next_lattice(self) -> None:
        self.sandbox.set("lattice.seed", self.sandbox.scene.lattice.seed + 1)

    def _toggle_slow(self) -> None:
        self.sandbox.slow = not self.sandbox.slow

    # ---- scenes

    def step_through(self, way: int) -> None:
        """Begin with the scene so many places on in the playlist. Raises TaichiDiskError."""
        self.play((self.number + way) % len(self.playlist))

    def play(self, number: int) -> None:
        """Begin with a scene of the playlist; what colours show stays. Raises TaichiDiskError."""
        sandbox = self.sandbox
        scene = self.playlist[number].load()
        # Displacements may not be drawn larger on an elastic wall.
        video = replace(sandbox.scene.video, magnify=scene.video.magnify)
        sandbox.begin(replace(scene, video=video))
        self.number = number

    def collect(self) -> None:
        """Collect a curve of results over the range of speeds or loads, or stop collecting. Raises TaichiDiskError."""
        high = RANGES[self.load_key].high
        loads = [float(f"{high * CURVE_SPAN ** (-k / (CURVE - 1)):.2g}") for k in range(CURVE)]
        self.sandbox.collect([] if self.sandbox.collected else loads)


def _each(act: Callable[[Any], None], values: tuple[Any, Any]) -> tuple[Action, Action]:
    return partial(act, values[0]), partial(act, values[1])


def _both(act: Callable[[float], None], factor: float = MORE) -> tuple[Action, Action]:
    """More and less."""
    return _each(act, (factor, 1.0 / factor))
