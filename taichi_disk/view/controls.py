"""What panel and keys can do, in one place: each control is a number or a key, whoever moves it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from math import log10
from pathlib import Path

from taichi_disk.errors import TaichiDiskError
from taichi_disk.render.colouring import COLOURINGS
from taichi_disk.scene import AbsorbingWallScene, CompressionScene, Show
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.impact import Impact
from taichi_disk.view.colouring import Scale
from taichi_disk.view.mouse import Mouse
from taichi_disk.view.sandbox import Sandbox

SCENE_NAMES = ("compression", "exponential_wall", "absorbing_wall")
BOUNDARIES = ("reset", "pinned", "dashpot")
SHOWS: tuple[Show, ...] = ("both", "springs", "points")
_LEAST_ETA = -1.0  # log10 at the slider's left end, which stands for none


class Controls:
    """Acts on a sandbox; files go into the folder `out`.

    `recording` is turned by the key and carried out by the window, as is the wish for a picture.
    """

    def __init__(self, sandbox: Sandbox, out: Path) -> None:
        self.sandbox, self.mouse, self.out = sandbox, Mouse(sandbox), out
        self.colouring_number = self.show_number = 0
        self.recording = self.picture_wanted = False
        self.scale = Scale(1e-12)
        self.reset_scale()

    # ---- numbers

    @property
    def log_eta(self) -> float:
        eta = self.sandbox.scene.material.eta_star
        return max(log10(eta), _LEAST_ETA) if eta else _LEAST_ETA

    def set_log_eta(self, value: float) -> None:
        self.sandbox.set("material.eta_star", _rounded(value) if value > _LEAST_ETA + 0.02 else 0.0)

    @property
    def _push(self) -> tuple[str, str, float]:
        scene = self.sandbox.scene
        if isinstance(scene, CompressionScene):
            return "compression.pressure", "P", scene.compression.pressure
        return "impact.velocity", "v", scene.impact.velocity

    @property
    def push(self) -> float:
        """The velocity of an impact [c], the force of a compression [M c^2/R]."""
        return self._push[2]

    @property
    def push_symbol(self) -> str:
        return self._push[1]

    @property
    def push_range(self) -> tuple[float, float]:
        return (-4.0, -1.0) if self.push_symbol == "P" else (-3.0, -0.5)

    @property
    def log_push(self) -> float:
        return log10(self.push)

    def set_log_push(self, value: float) -> None:
        self.sandbox.set(self._push[0], _rounded(value))

    @property
    def log_hardness(self) -> float:
        return log10(self.sandbox.scene.wall.a)

    def set_log_hardness(self, value: float) -> None:
        self.sandbox.set("wall.a", _rounded(value))

    @property
    def log_speed(self) -> float:
        return log10(self.sandbox.speed)

    def set_log_speed(self, value: float) -> None:
        self.sandbox.speed = _rounded(min(max(value, -2.0), 2.0))

    @property
    def scene_number(self) -> int:
        return SCENE_NAMES.index(self.sandbox.scene.scene)

    def set_scene_number(self, value: int) -> None:
        self.sandbox.switch(SCENE_NAMES[value])
        self.reset_scale()

    @property
    def boundary_number(self) -> int | None:
        scene = self.sandbox.scene
        return BOUNDARIES.index(scene.wall.boundary) if isinstance(scene, AbsorbingWallScene) else None

    def set_boundary_number(self, value: int) -> None:
        self.sandbox.set("wall.boundary", BOUNDARIES[value])

    def set_colouring_number(self, value: int) -> None:
        self.colouring_number = value
        self.reset_scale()

    def set_show_number(self, value: int) -> None:
        self.show_number = value

    def reset_scale(self) -> None:
        """Begin the scale of colours again: strains of an impact reach about v/c, speeds v, under a load about P."""
        push = self.push
        points = self.sandbox.scene.lattice.points
        starts = {"strain": push, "force": 0.1 * push, "speed": push, "kinetic": 0.5 * push**2 / points}
        self.scale = Scale(starts[COLOURINGS[self.colouring_number]])

    # ---- keys

    def labels(self) -> Iterator[tuple[str, str]]:
        """(key, what it does now) of every button."""
        yield "space", "go on" if self.sandbox.paused else "pause"
        yield "s", "single step"
        yield "r", "restart"
        if self.sandbox.motion.blown:
            yield "m", "restart with half the step"
        if not isinstance(self.sandbox.scene, CompressionScene):
            yield "h", "hit again"
        yield "w", "write the scene"
        yield "v", "stop recording" if self.recording else "record a film"
        yield "p", "picture"

    def press(self, key: str) -> None:
        """Do what a key stands for; an unknown one does nothing. What fails is told in the sandbox's message."""
        action = self._keys().get(key)
        if action is None:
            return
        try:
            action()
        except TaichiDiskError as error:
            self.sandbox.message = str(error)

    def _keys(self) -> dict[str, Callable[[], None]]:
        sandbox = self.sandbox

        def turn_on(number: int | None, count: int, change: Callable[[int], None]) -> Callable[[], None]:
            return lambda: change((number + 1) % count) if number is not None else None

        def move(value: float, change: Callable[[float], None], by: float) -> Callable[[], None]:
            return lambda: change(value + by)

        low, high = self.push_range
        return {
            "space": self._pause,
            "s": sandbox.single_step,
            "r": sandbox.restart,
            "m": sandbox.restart_with_smaller_step,
            "h": sandbox.hit_again,
            "w": lambda: sandbox.save(self.next_file(".yaml")),
            "v": self._record,
            "p": self._picture,
            "1": lambda: self.set_scene_number(0),
            "2": lambda: self.set_scene_number(1),
            "3": lambda: self.set_scene_number(2),
            "b": turn_on(self.boundary_number, 3, self.set_boundary_number),
            "c": turn_on(self.colouring_number, len(COLOURINGS), self.set_colouring_number),
            "x": turn_on(self.show_number, 3, self.set_show_number),
            "e": move(max(self.log_eta, _LEAST_ETA + 0.05), self.set_log_eta, 0.1),
            "d": move(self.log_eta, self.set_log_eta, -0.1),
            "Up": lambda: self.set_log_push(min(self.log_push + 0.05, high)),
            "Down": lambda: self.set_log_push(max(self.log_push - 0.05, low)),
            "a": lambda: self.set_log_hardness(min(self.log_hardness + 0.1, 4.0)),
            "z": lambda: self.set_log_hardness(max(self.log_hardness - 0.1, 1.0)),
            "Left": move(self.log_speed, self.set_log_speed, -0.1),
            "Right": move(self.log_speed, self.set_log_speed, 0.1),
            "Escape": self.mouse.release,
        }

    def _pause(self) -> None:
        if not self.sandbox.motion.blown:
            self.sandbox.paused = not self.sandbox.paused

    def _record(self) -> None:
        self.recording = not self.recording

    def _picture(self) -> None:
        self.picture_wanted = True

    def next_file(self, suffix: str) -> Path:
        """A name in `out` that is not taken: view-1.yaml, view-2.yaml..."""
        number = 1
        while (path := self.out / f"view-{number}{suffix}").exists():
            number += 1
        return path

    # ---- read-outs

    def readings(self) -> Iterator[str]:
        """Lines of text: where the scene stands."""
        sandbox = self.sandbox
        motion = sandbox.motion
        row = motion.ledger.now()
        yield f"t = {motion.ledger.t:.4f} R/c   step {motion.step.dt:.2e} R/c"
        yield f"v_cm = {row['com_vy']:+.6f} c"
        setup = motion.setup
        if isinstance(setup, Impact):
            e = f"{sandbox.result['restitution']:.6f}" if sandbox.result else "-"
            unloaded = float(setup.lattice.positions[: setup.lattice.disk_points, 1].mean()) - setup.gap
            yield f"e = {e}   xi = {unloaded - (row['com_y'] - row['lowest_y']):+.6f} R"
        else:
            assert isinstance(setup, Compression)
            yield f"xi = {setup.unloaded - (row['com_y'] - row['lowest_y']):.6f} R"
        yield f"contact force = {row['wall_force']:.3e} M c^2/R"
        yield f"energy: kinetic {row['kinetic']:.2e}, elastic {row['elastic']:.2e},"
        yield f"   lost {row['dissipated'] + row['absorbed']:.2e} M c^2"
        if given := motion.ledger.given():
            yield f"   given by hand {given:+.2e} M c^2"
        yield f"energy imbalance {motion.ledger.imbalance() / motion.scale:+.1e}"
        yield "changed by hand: r to restart as saved" if motion.changed else "this is what run computes"
        yield "mouse: turn before impact, pull after it"


def _rounded(log: float) -> float:
    return float(f"{10.0**log:.3g}")
