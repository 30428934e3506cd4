"""The sandbox without its window: a scene that moves, is changed by the user, goes back in time, and can be saved."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, inf
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from taichi_disk.errors import TaichiDiskError
from taichi_disk.lattice import Array
from taichi_disk.output.files import write_text
from taichi_disk.scenes import Scene
from taichi_disk.simulation.observables import INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.history import Checkpoint, Segment, Timeline
from taichi_disk.window.start import Start, start_of, with_mouse

IMMEDIATE_KEYS = ("material.eta_star", "material.viscosity", "wall.boundary", "compression.pressure")
THROW_KEYS = ("impact.velocity", "impact.angle")
AIM = 0.05  # velocity of a throw for each R of its arrow [c/R]
PATIENCE = 0.025  # longest time of computing between two pictures [s]
SLOWDOWN = 0.2  # fraction of the speed at which a contact passes in slow motion
CONTACT = 0.01  # fraction of M v over the springs' time unit, about the largest force of an impact, that is contact
MAX_RESULTS = 200  # in the table
COLLECTING_PACE = 50.0  # simulated time per second of the clock while a curve is collected [R/c per s]
COLLECTING_SPACING = 20.0  # factor by which stored states are further apart then


def load_key(scene: Scene) -> str:
    """Return the dotted key of the swept quantity: "impact.velocity" or "compression.pressure"."""
    return ".".join(scene.abscissa)


def load_of(scene: Scene) -> float:
    """Return the swept quantity of a scene: speed [c] of an impact, pressure [M c^2/R] of a compression."""
    return float(attrgetter(load_key(scene))(scene))


def with_key(scene: Scene, key: str, value: Any) -> Scene:
    """Return `scene` with a dotted key changed, and the keys that have to follow. Raises InputError if it refuses."""
    return scene.with_(scene.changes_with(key, value))


class Result(NamedTuple):
    """One finished experiment.

    Attributes:
        value: restitution e, or compression xi [R].
        scene: the scene that was computed.
        points: number of the disk's mass points.
        numbers: all results by name.
        disturbance: "" if the user did not interfere, else "hit again" or "disturbed".
    """

    value: float
    scene: Any
    points: int
    numbers: dict[str, float]
    disturbance: str


class Sandbox:
    """`ti.init` must have been called. Needs no display.

    Attributes:
        scene: the scene as `save` would write it.
        start: the scene at t = 0.
        starts: number of starts so far.
        time: the states since the start.
        speed: simulated time per second of the clock [R/c per s].
        slow: whether contacts pass in slow motion.
        paused: whether `advance` lets no time pass.
        message: the last event, for the user.
        results: the last experiments that came to their end, the newest last.
        collected: loads for which a curve still needs results, the next one first: see `collect`.
        dragged: the point tied to the mouse and the mouse's position [R], or None.
        aimed: velocity [c] and angle [rad] of the throw that is being drawn, or None.
    """

    start: Start
    starts, speed, slow = 0, 1.0, False

    def __init__(self, scene: Scene, kernels: KernelCache) -> None:
        """Raises TaichiDiskError."""
        self.kernels, self.scene = kernels, scene
        self.results: list[Result] = []
        self.begin()

    # ---- the start

    def begin(self, scene: Scene | None = None) -> None:
        """Go to t = 0 of `scene` (default: the present scene) and pause: the motion from there is that of `run`.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        start = start_of(scene or self.scene, getattr(self, "start", None))
        self.time = Timeline(Segment(start.scenario, self.kernels, start.spectrum))
        self.start, self.scene, self.starts = start, start.scenario.scene, self.starts + 1
        self.paused, self.message, self._due = True, "", 0.0
        self.collected: list[float] = []
        self.dragged: tuple[int, tuple[float, float]] | None = None
        self.aimed: tuple[float, float] | None = None

    # ---- the present state

    @property
    def segment(self) -> Segment:
        """The segment that moves."""
        return self.time.last

    @property
    def seen(self) -> Checkpoint:
        """The state on display."""
        return self.time.seen

    @property
    def at_start(self) -> bool:
        """Whether nothing has moved yet, and the user has not interfered."""
        return self.segment.state.step == 0 and not self.segment.label

    @property
    def is_thrown(self) -> bool:
        return self.segment.scenario.is_thrown

    @property
    def status(self) -> str:
        """Whether the state on display is that of `taichi-disk run`, for the user."""
        if self.time.behind:
            return "computing again"
        return "disturbed" if self.seen.is_disturbed else "same as taichi-disk run"

    @property
    def imbalance(self) -> float:
        """Error of the energy balance since the last change, relative to the kinetic energy or the load's work."""
        return float(self.segment.imbalance / self.segment.reference_energy)

    @property
    def warnings(self) -> list[str]:
        """The notes that `run` would print with the result of this scene."""
        scenario = self.segment.scenario
        return self.scene.notes(scenario.lattice.disk_points) if scenario.step_dependent else []

    @property
    def pace(self) -> float:
        """Simulated time per second of the clock now [R/c per s]."""
        scenario: Any = self.segment.scenario
        if self.collected:
            return COLLECTING_PACE
        if not (self.slow and scenario.is_thrown):
            return self.speed
        force = CONTACT * scenario.velocity / scenario.model.springs.time_unit
        return self.speed * (SLOWDOWN if self.segment.row[INDEX["wall_force"]] > force else 1.0)

    # ---- time

    def advance(self, seconds: float, patience: float = PATIENCE) -> int:
        """Let `seconds` of the clock pass and return the number of steps made.

        It is smaller than due if computing the steps would take longer than `patience` [s], and unrelated to
        `seconds` while the scene is computed again with a shorter step.
        """
        segment = self.segment
        if self.time.behind:
            return self._go(ceil(self.time.behind / segment.step.dt), patience)
        if self.paused or segment.status == "failed":
            return 0
        self._due += seconds * self.pace / segment.step.dt
        made = self._go(int(self._due), patience)
        self._due = min(max(self._due - made, 0.0), 1.0)
        return made

    def _go(self, steps: int, patience: float) -> int:
        segment = self.segment
        before, made = segment.status, self.time.go(steps, patience)
        if segment.status == "restarted":
            self.message = f"computed again with a shorter step, {segment.step.dt:.2g} R/c"
        elif segment.status == "failed":
            self.paused, self.collected = True, []
            self.message = f"{segment.failure} (go back to the start or back in time, or change something)"
        elif segment.status == "finished" != before:
            self._finish(segment)
        return made

    def _finish(self, segment: Segment) -> None:
        """Enter the result into the table, and begin the next experiment of a curve that is being collected."""
        scenario = segment.scenario
        numbers = scenario.result(segment.columns)
        value = next(iter(numbers.values()))
        result = Result(value, scenario.scene, scenario.lattice.disk_points, numbers, segment.label)
        self.results = [*self.results, result][-MAX_RESULTS:]
        self.paused = True
        unit = next(iter(scenario.labels.values()))[1]
        text = f"{scenario.end_words}: {scenario.symbol} = {value:.6f} {unit}".rstrip()
        self.message = f"{text}, {segment.label}" if segment.label else text
        self.collect(self.collected[1:])

    def collect(self, loads: list[float]) -> None:
        """Run the present scene with each of `loads` (speeds [c] or pressures [M c^2/R]) in turn; [] ends that.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        if loads:
            self.begin(with_key(self.scene, load_key(self.scene), loads[0]))
            self.time.spacing *= COLLECTING_SPACING
            self.paused = False
        self.collected = loads

    def clear(self) -> None:
        """Empty the table of results."""
        self.results = []

    def pause(self) -> None:
        """Pause, or go on from the state on display."""
        if self.paused and self.segment.status == "failed" and not self.time.past:
            return
        self.paused, self.collected = not self.paused, []
        if not self.paused:
            self._settle()
            self.message = ""

    def scrub(self, t: float) -> None:
        """Show the stored state nearest to the time `t` [R/c], and pause."""
        if self._hold_still():
            self.time.look_at(t)

    def step(self, count: int) -> None:
        """Show the state `count` checkpoints later, or earlier if negative, and pause; after the last, time goes on."""
        if self._hold_still() and not self.time.look_beside(count):
            self._go(self.time.due, inf)

    def _hold_still(self) -> bool:
        self.let_go()
        if self.time.behind:
            return False
        self.paused, self._due, self.collected = True, 0.0, []
        return True

    def _settle(self) -> None:
        """Make the state on display the present: all later states are forgotten."""
        seen = self.seen
        if self.time.past:
            self.time.cut()
            self.scene = replace(seen.segment.scenario.scene, video=self.scene.video)
            if seen.pulled:  # the pull of the mouse cannot be repeated
                self._carry_on(self.scene, "disturbed")

    # ---- changes by the user

    def set(self, key: str, value: Any) -> None:
        """Change one key of the scene ("material.eta_star"); immediately, if the lattice stays the same.

        A value that the scene refuses changes nothing and is explained in `message`.
        """
        try:
            scene = with_key(self.scene, key, value)
            if scene == self.scene:
                return
            if key.startswith("video."):
                self.scene = scene
            elif self.at_start or key not in (*IMMEDIATE_KEYS, *THROW_KEYS):
                self.begin(scene)
            elif key in THROW_KEYS:
                self.scene = scene
                self.message = "a new velocity or angle takes effect at the next hit or start"
            else:
                self.collected = []
                self.let_go()
                self._settle()
                self._carry_on(with_key(self.scene, key, value), "disturbed")
                self.message = ""
        except TaichiDiskError as error:
            self.message = str(error)

    def hit_again(self) -> None:
        """Send the disk at the wall with the velocity of the scene; its vibration continues.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        if not self.is_thrown:
            return
        if not self.at_start:
            scene: Any = self.scene
            self.let_go()
            self._settle()
            v, impact, body = self.segment.present.v, scene.impact, self.start.body
            disk = v[: body.disk_points]
            disk += (impact.along, -impact.towards) - body.mean(disk)
            self._carry_on(scene, "hit again", v)
            self.message = f"sent back with v = {impact.velocity:g} c"
        self.paused = False

    def _carry_on(self, scene: Scene, label: str, hit: Array | None = None) -> None:
        """Begin another segment; `hit`: velocities (n, 2) [c] of a further hit.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        last, start, now = self.segment, self.start, self.segment.present
        scenario = with_mouse(scene, start.body)
        scenario.go_on_from(now.x, now.v if hit is None else hit)
        if last.status != "failed":  # a time step set by the user would be refused for the force of a blow-up
            peak = last.simulation.peak_point_force(now.snapshot)
            scenario.point_force = max(scenario.point_force, peak)
        self.time.follow(Segment(scenario, self.kernels, start.spectrum, now.t, last.hit + (hit is not None), label))
        self.scene, self._due, self.dragged = scene, 0.0, None
        if last.status in ("failed", "finished"):
            self.paused = False

    # ---- the mouse

    def turn(self, angle: float, final: bool = True) -> None:
        """Turn the disk by `angle` [rad] from its place in the scene, at the start of an impact.

        `final` changes `impact.turn` of the scene; otherwise the turned disk is only shown.
        """
        scene: Any = self.scene
        if not (self.at_start and self.is_thrown):
            return
        turn = np.angle(np.exp(1j * (scene.impact.turn + angle)))
        scene = scene.with_({"impact.turn": float(f"{turn:.4f}")})
        if final:
            self.begin(scene)
        else:
            snapshot, body = self.seen.snapshot, self.start.body
            x, disk = with_mouse(scene, body).lattice.positions, slice(body.disk_points)
            x[disk] += self.segment.present.x[disk].mean(axis=0) - x[disk].mean(axis=0)
            snapshot = replace(snapshot, vectors=np.stack([x, *snapshot.vectors[1:]]))
            self.time.seen = replace(self.seen, snapshot=snapshot)

    def aim(self, dx: float, dy: float) -> None:
        """Draw the throw along (dx, dy) [R] at the start of an impact: AIM c for each R, never upwards."""
        if self.at_start and self.is_thrown:
            velocity, angle = max(AIM * np.hypot(dx, dy), 1e-3), np.clip(np.arctan2(dx, -dy), -1.5, 1.5)
            self.aimed = float(f"{velocity:.3g}"), float(f"{angle:.3g}")

    def throw(self) -> None:
        """Apply the velocity and the angle of the drawn throw to the scene."""
        for key, value in zip(THROW_KEYS, self.aimed or (), strict=False):
            self.set(key, value)
        self.aimed = None

    def pull(self, x: float, y: float) -> None:
        """Tie the disk's point nearest to (x, y) [R] to the mouse there, or move the mouse of the tied point.

        An earlier state on display becomes the present.
        """
        self._settle()
        if self.segment.status == "failed" or self.time.behind:
            return
        disk = self.segment.present.x[: self.start.body.disk_points]
        point = self.dragged[0] if self.dragged else int(np.hypot(disk[:, 0] - x, disk[:, 1] - y).argmin())
        self.dragged = point, (x, y)
        self.segment.pull(*self.dragged)

    def let_go(self) -> None:
        """Untie the point, after which the scene can end again, and forget a throw that is being drawn."""
        self.aimed = None
        if self.dragged:
            self.dragged = None
            if self.segment.status != "failed":
                self.segment.pull(-1, (0.0, 0.0))
                self._carry_on(self.scene, "disturbed")

    # ---- files

    def save(self, path: Path) -> None:
        """Write the scene; `run` repeats bit for bit what is seen after a start. Raises SimulationError."""
        write_text(path, self.scene.to_yaml())
        self.message = f"saved {path}{', without the changes on the way' if self.seen.is_disturbed else ''}"
