"""The sandbox without its window: a scene that moves, is changed by hand, goes back in time, and can be saved."""

from __future__ import annotations

from dataclasses import replace
from math import ceil, inf
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, spectrum
from taichi_disk.errors import TaichiDiskError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.output.files import write_text
from taichi_disk.physics import MouseSpring
from taichi_disk.scenes import Scene
from taichi_disk.simulation.observables import INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.history import Checkpoint, Segment, Timeline

# Keys that need no new start.
AT_ONCE = ("material.eta_star", "material.viscosity", "wall.boundary", "compression.pressure")
AIMED = ("impact.velocity", "impact.angle")
AIM = 0.05  # velocity of a throw for each R that it is drawn with [c/R]
PATIENCE = 0.025  # time spent computing between two pictures, at most [s]
SLOW = 0.2  # part of the speed at which a contact passes in slow motion
CONTACT = 0.01  # of M v over the time unit of the springs, about the largest force of an impact, is contact
MAX_RESULTS = 200  # in the table
COLLECTING = 50.0  # simulated time per second of the clock while a curve is collected [R/c per s]


def load_of(scene: Scene) -> float:
    """Return the swept quantity of a scene: speed [c] of an impact, pressure [M c^2/R] of a compression."""
    return float(attrgetter(".".join(scene.abscissa))(scene))


def with_key(scene: Scene, key: str, value: Any) -> Scene:
    """`scene` with one dotted key changed, and with it what has to follow. Raises InputError if the scene refuses."""
    return scene.with_(scene.changes_with(key, value))


class Start(NamedTuple):
    """A scene at t = 0, ready for a hand: its unloaded lattice, the scenario with a mouse spring, its spectrum."""

    body: Lattice
    scenario: Scenario
    spectrum: Spectrum


def start_of(scene: Scene, before: Start | None = None) -> Start:
    """`before`: what it has in common with the scene is not computed again. Raises TaichiDiskError."""
    scene = scene.in_time()
    if before and _of_the_body(scene) != _of_the_body(before.scenario.scene):
        before = None
    body = before.body if before else scene.body()
    scenario = with_mouse(scene, body)
    lattice, springs = scenario.lattice, scenario.model.springs
    if before and np.array_equal(before.scenario.lattice.positions, lattice.positions):
        return Start(body, scenario, before.spectrum)
    # Dashpots may come later: their rates belong to it in any case.
    damped = replace(scenario.model, springs=replace(springs, eta=1.0))
    return Start(body, scenario, spectrum(lattice, damped))


def _of_the_body(scene: Scene) -> Any:
    """All that the unloaded lattice and its spectrum depend on."""
    return attrgetter("material.k_a", *scene.lattice_keys)(scene)


def with_mouse(scene: Scene, body: Lattice) -> Scenario:
    """The scene at t = 0 with a mouse spring that rests; `body`: its unloaded lattice."""
    scenario = scene.scenario(body)
    modulus = scenario.model.springs.modulus
    # A stronger pull than 0.02 of it times R would turn triangles of a fine lattice inside out.
    scenario.model = replace(scenario.model, mouse=MouseSpring(0.2 * modulus, 0.02 * modulus))
    return scenario


class Result(NamedTuple):
    """One finished experiment.

    Attributes:
        value: restitution e, or compression xi [R].
        scene: what was computed.
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
        scene: as it would be saved.
        start: the scene as it began.
        starts: how often this has begun.
        time: what has passed since the start, and what is seen of it.
        speed: simulated time per second of the clock [R/c per s].
        slow: whether contacts pass in slow motion.
        paused: whether `advance` lets no time pass.
        message: what happened last, for the person at the window.
        results: of the last experiments that came to their end, the newest last.
        collected: loads that a curve still needs, the next one first: see `collect`.
        dragged: the point tied to the mouse and where the mouse is [R], or None.
        aimed: velocity [c] and angle [rad] of the throw that is being drawn, or None.
    """

    def __init__(self, scene: Scene, kernels: KernelCache) -> None:
        """Raises TaichiDiskError."""
        self.kernels, self.speed, self.slow, self.starts = kernels, 1.0, False, 0
        self.results: list[Result] = []
        self.collected: list[float] = []
        self._begin(start_of(scene))

    # ---- the start

    def begin(self, scene: Scene | None = None) -> None:
        """To t = 0 of `scene` (default: the present one), paused: from here on this is what `run` computes.

        Raises TaichiDiskError, with everything left as it was.
        """
        self.collected = []
        self._begin(start_of(scene or self.scene, self.start))

    def _begin(self, start: Start) -> None:
        self.time = Timeline(Segment(start.scenario, self.kernels, start.spectrum))
        self.start, self.scene, self.starts = start, start.scenario.scene, self.starts + 1
        self.paused, self.message, self._due = True, "", 0.0
        self.dragged: tuple[int, tuple[float, float]] | None = None
        self.aimed: tuple[float, float] | None = None

    # ---- what is known

    @property
    def segment(self) -> Segment:
        """The one that moves."""
        return self.time.last

    @property
    def seen(self) -> Checkpoint:
        """What there is to see."""
        return self.time.seen

    @property
    def at_start(self) -> bool:
        """Whether nothing has moved yet, and no hand has touched the disk."""
        return self.segment.state.step == 0 and not self.segment.label

    @property
    def is_thrown(self) -> bool:
        return self.segment.scenario.is_thrown

    @property
    def imbalance(self) -> float:
        """Energy from nowhere since the last change by hand, over the kinetic energy or about the load's work."""
        return float(self.segment.imbalance / self.segment.scenario.reference_energy)

    @property
    def warnings(self) -> list[str]:
        """What `run` would print about the result of this scene."""
        scenario = self.segment.scenario
        return self.scene.notes(scenario.lattice.disk_points) if scenario.step_dependent else []

    @property
    def pace(self) -> float:
        """Simulated time per second of the clock now [R/c per s]."""
        scenario: Any = self.segment.scenario
        if self.collected:
            return COLLECTING
        if not (self.slow and scenario.is_thrown):
            return self.speed
        force = CONTACT * scenario.velocity / scenario.model.springs.time_unit
        return self.speed * (SLOW if self.segment.row[INDEX["wall_force"]] > force else 1.0)

    # ---- time

    def advance(self, seconds: float, patience: float = PATIENCE) -> int:
        """Let `seconds` of the clock pass; returns the steps made.

        They are fewer than due where computing them takes longer than `patience` [s], and others than due while all is
        computed again with a shorter step.
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
            self.paused = True
            self.message = f"{segment.failure} (go back to the start or back in time, or change something)"
            self.collected = []
        elif segment.status == "finished" != before:
            self._finish(segment)
        return made

    def _finish(self, segment: Segment) -> None:
        """Enter the result into the table, and begin the next experiment of a curve that is being collected."""
        scenario = segment.scenario
        numbers = scenario.result(segment.columns)
        value = next(iter(numbers.values()))
        found = Result(value, scenario.scene, scenario.lattice.disk_points, numbers, segment.label)
        self.results = [*self.results, found][-MAX_RESULTS:]
        self.paused = True
        unit = next(iter(scenario.labels.values()))[1]
        text = f"{scenario.end_words}: {scenario.symbol} = {value:.6f} {unit}".rstrip()
        self.message = f"{text}, {segment.label}" if segment.label else text
        self.collected = self.collected[1:]
        if self.collected:
            self._begin_collected()

    def collect(self, loads: list[float]) -> None:
        """Run the present scene with each of `loads` (speeds [c] or pressures [M c^2/R]) in turn; [] ends that.

        Raises TaichiDiskError, with everything left as it was.
        """
        self.collected = loads
        if loads:
            self._begin_collected()

    def _begin_collected(self) -> None:
        scene = with_key(self.scene, ".".join(self.scene.abscissa), self.collected[0])
        self._begin(start_of(scene, self.start))
        self.time.spacing *= 20.0
        self.paused = False

    def pause(self) -> None:
        """Pause, or go on from what there is to see."""
        if self.paused and self.segment.status == "failed" and not self.time.past:
            return
        self.paused, self.collected = not self.paused, []
        if not self.paused:
            self._settle()
            self.message = ""

    def scrub(self, t: float) -> None:
        """Show the state that is remembered nearest to the time `t` [R/c], and pause."""
        if self._hold_still():
            self.time.look_at(t)

    def step(self, count: int) -> None:
        """Show what is `count` checkpoints later, or earlier if negative, and pause; beyond the last, time goes on."""
        if self._hold_still() and not self.time.look_beside(count):
            self._go(self.time.due, inf)

    def _hold_still(self) -> bool:
        self.let_go()
        if self.time.behind:
            return False
        self.paused, self._due, self.collected = True, 0.0, []
        return True

    def _settle(self) -> None:
        """Make what is seen the present: what came after it is forgotten."""
        seen = self.seen
        if self.time.past:
            scene = seen.segment.scenario.scene
            self.time.cut()
            self.scene = replace(scene, video=self.scene.video)
            if seen.pulled:  # the mouse cannot pull again as it did
                self._carry_on(self.scene, "disturbed")

    # ---- changes by hand

    def set(self, key: str, value: Any) -> None:
        """Change one key of the scene ("material.eta_star"); at once where the lattice stays.

        A value that the scene refuses changes nothing and is explained in `message`.
        """
        try:
            scene = with_key(self.scene, key, value)
            if scene == self.scene:
                return
            if key.startswith("video."):
                self.scene = scene
            elif self.at_start or key not in (*AT_ONCE, *AIMED):
                self.begin(scene)
            elif key in AIMED:
                self.scene = scene
                self.message = "the velocity counts from the next hit or start on"
            else:
                self.collected = []
                self.let_go()
                self._settle()
                self._carry_on(with_key(self.scene, key, value), "disturbed")
                self.message = ""
        except TaichiDiskError as error:
            self.message = str(error)

    def hit_again(self) -> None:
        """Send the disk at the wall with the velocity of the scene; what shakes in it goes on shaking.

        Raises TaichiDiskError, with everything left as it was.
        """
        if not self.is_thrown:
            return
        if not self.at_start:
            wanted: Any = self.scene
            self.let_go()
            self._settle()
            v, impact = self.segment.present.v, wanted.impact
            flying = v[: self.start.body.disk_points]
            flying += (impact.along, -impact.towards) - self.start.body.mean(flying)
            self._carry_on(wanted, "hit again", v)
            self.message = f"sent back with v = {impact.velocity:g} c"
        self.paused = False

    def _carry_on(self, scene: Scene, label: str, hit: Array | None = None) -> None:
        """Begin another segment; `hit`: the velocities (n, 2) of another hit [c].

        Raises TaichiDiskError, with everything left as it was.
        """
        last, start, now = self.segment, self.start, self.segment.present
        scenario = with_mouse(scene, start.body)
        scenario.go_on_from(now.x, now.v if hit is None else hit)
        if last.status != "failed":  # after a blow-up a step by hand would be refused for the force that it has led to
            peak = last.simulation.peak_point_force(now.snapshot)
            scenario.point_force = max(scenario.point_force, peak)
        self.time.follow(Segment(scenario, self.kernels, start.spectrum, now.t, last.hit + (hit is not None), label))
        self.scene, self._due, self.dragged = scene, 0.0, None
        if last.status in ("failed", "finished"):  # any change gives a new life
            self.paused = False

    # ---- the mouse

    def turn(self, angle: float, for_good: bool = True) -> None:
        """At the start of an impact, turn the disk by `angle` [rad] from where the scene has it: `impact.turn` changes.

        Else it is only shown so.
        """
        scene: Any = self.scene
        if not (self.at_start and self.is_thrown):
            return
        turn = np.angle(np.exp(1j * (scene.impact.turn + angle)))
        scene = scene.with_({"impact.turn": float(f"{turn:.4f}")})
        if for_good:
            self.begin(scene)
        else:
            snapshot, x = self.seen.snapshot, with_mouse(scene, self.start.body).lattice.positions
            disk = slice(self.start.body.disk_points)
            x[disk] += self.segment.present.x[disk].mean(axis=0) - x[disk].mean(axis=0)
            snapshot = replace(snapshot, vectors=np.stack([x, *snapshot.vectors[1:]]))
            self.time.seen = replace(self.seen, snapshot=snapshot)

    def aim(self, dx: float, dy: float) -> None:
        """At the start of an impact, draw the throw along (dx, dy) [R]: AIM c for each R, downwards in any case."""
        if self.at_start and self.is_thrown:
            velocity, angle = max(AIM * np.hypot(dx, dy), 1e-3), np.clip(np.arctan2(dx, -dy), -1.5, 1.5)
            self.aimed = float(f"{velocity:.3g}"), float(f"{angle:.3g}")

    def throw(self) -> None:
        """The scene's throw is the one that was drawn from now on."""
        if self.aimed:
            for key, value in zip(AIMED, self.aimed, strict=True):
                self.set(key, value)
        self.aimed = None

    def pull(self, x: float, y: float) -> None:
        """Tie the disk's point nearest to (x, y) [R] to the mouse there, or lead the one that is tied.

        A state that is past becomes the present.
        """
        self._settle()
        if self.segment.status == "failed" or self.time.behind:
            return
        disk = self.segment.present.x[: self.start.body.disk_points]
        point = self.dragged[0] if self.dragged else int(np.hypot(disk[:, 0] - x, disk[:, 1] - y).argmin())
        self.dragged = point, (x, y)
        self.segment.pull(*self.dragged)

    def let_go(self) -> None:
        """Untie the point, if one is tied: from here on the scene can end again."""
        if self.dragged:
            self.dragged = None
            if self.segment.status != "failed":
                self.segment.pull(-1, (0.0, 0.0))
                self._carry_on(self.scene, "disturbed")

    # ---- out

    def save(self, path: Path) -> None:
        """Write the scene: `run` computes from it, bit for bit, what is seen after a start. Raises SimulationError."""
        write_text(path, self.scene.to_yaml())
        self.message = f"saved {path}{'; what was changed on the way is not in it' if self.seen.by_hand else ''}"
