"""The sandbox without its page or window: a scene that moves, is changed by the user,
and goes back in time."""

from __future__ import annotations

from collections import namedtuple
from dataclasses import replace
from math import ceil, exp, inf
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.experiments.computation.diagnostics import warnings
from taichi_disk.experiments.scenes import Scene
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.simulation.observables import INDEX
from taichi_disk.mechanics.statics.equilibrium import turned
from taichi_disk.sandbox.history import (
    DISTURBED,
    HIT_AGAIN,
    PULLED,
    Segment,
    Start,
    Timeline,
    start_of,
)

IMMEDIATE_KEYS = (
    "material.eta_star",
    "material.viscosity",
    "wall.boundary",
    "compression.pressure",
)
THROW_KEYS = ("impact.velocity", "impact.angle")
AIM_SCALE = 0.05  # velocity of a throw for each R of its arrow [c/R]
# longest time that passes between two pictures, however late a picture comes [s]
MAX_PASSED = 0.1
MAX_COMPUTING_TIME = 0.025  # longest time of computing between two pictures [s]
SLOWDOWN = 0.2  # fraction of the speed at which a contact passes in slow motion
# smallest wall force in a contact, over M v per time unit of the springs (about its
# peak)
CONTACT_FORCE = 0.01
# time of the clock in which slow motion begins or ends, about [s]
PACE_TIME = 0.12
MAX_RESULTS = 200  # most rows of the table of results
# simulated time per second of the clock while a curve is collected [R/c per s]
COLLECTING_PACE = 50.0
COLLECTING_SPACING = 20.0  # factor by which stored states are further apart then


def load_key(scene: Scene) -> str:
    """Return the dotted key of the swept quantity: "impact.velocity" or
    "compression.pressure"."""
    return ".".join(scene.abscissa)


def value_of(scene: Scene, key: str) -> Any:
    """Return the value of a dotted key, or None if the scene has no such key."""
    section, name = key.split(".")
    return getattr(getattr(scene, section, None), name, None)


def with_key(scene: Scene, key: str, value: Any) -> Scene:
    """Return `scene` with a dotted key changed, and the keys that have to follow.
    Raises InputError if it refuses."""
    return scene.with_(scene.changes_with(key, value))


class Experiment(
    namedtuple(
        "Experiment",
        "result value load angle spin friction eta_star a points contact_time"
        " disturbance turn seed wall",
    )
):
    """One finished experiment, a row of the table of results; None stands for a number
    that its scene does not have.

    Attributes:
        result: "e" or "ξ".
        value: restitution e, or compression ξ [R].
        load: speed [c] or pressure [M c^2/R].
        angle, spin, friction: of the throw [rad], [c/R], and of the wall.
        eta_star, a, points: viscosity, hardness of the wall [1/R], number of the disk's
            mass points.
        contact_time: [R/c]; None, too, if the user interfered during the hit.
        disturbance: "" if the user did not interfere, else HIT_AGAIN or DISTURBED.
        turn, seed: initial rotation of the disk [rad], seed of its random points.
        wall: "rigid", or the boundary of the elastic wall.
    """


# keys of the settings in a row
_SETTINGS = {
    "angle": "impact.angle",
    "spin": "impact.spin",
    "turn": "impact.turn",
    "friction": "wall.friction",
    "a": "wall.a",
    "seed": "lattice.seed",
}


def experiment_of(segment: Segment) -> Experiment:
    """Return the row of the table for a segment that has come to its end."""
    scenario = segment.scenario
    scene = scenario.scene
    points = scenario.lattice.disk_points
    _, value = scenario.primary(segment.columns)
    contact_time = scenario.result(segment.columns).get("contact_time")
    if segment.label == DISTURBED:
        contact_time = None  # a part of the contact may lie before the segment
    settings = {name: value_of(scene, key) for name, key in _SETTINGS.items()}
    return Experiment(
        result=scenario.words.symbol,
        value=value,
        load=value_of(scene, load_key(scene)),
        eta_star=scene.material.eta(points) * points,
        points=points,
        contact_time=contact_time,
        disturbance=segment.label,
        wall=value_of(scene, "wall.boundary") or "rigid",
        **settings,
    )


class Sandbox:
    """A scene that a user plays with. `ti.init` must have been called; no display is
    needed.

    Attributes:
        scene: the present scene, as it would be saved.
        starts: number of starts so far.
        time: the states since the start.
        speed: simulated time per second of the clock [R/c per s].
        slow: whether contacts pass in slow motion.
        paused: whether `advance` lets no time pass.
        message: the last event, for the user.
        answer: one sentence on the last experiment that came to its end.
        results: the last experiments that came to their end, the newest last.
        remaining_loads: loads for which a curve still needs results, the next one
            first: see `collect`.
        grip: number of the point tied to the mouse, or -1.
        drawn_throw: velocity [c] and angle [rad] of the throw that is being drawn, or
            None.
    """

    starts = 0
    answer = ""
    speed = 1.0
    slow = False
    _clock = 0.0
    _load_before = 0.0
    _slowed = 1.0

    def __init__(self, scene: Scene) -> None:
        """Begin with `scene`. Raises TaichiDiskError."""
        self.scene = scene
        self.results: list[Experiment] = []
        self._warnings: list[str] = []
        self.begin()

    def begin(self, scene: Scene | None = None) -> None:
        """Go to t = 0 of `scene` (default: the present scene) and pause; from there the
        disk moves as in `run`.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        scene = scene or self.scene
        self.time = Timeline(self._start(scene))
        self.scene = replace(self.time.start.scenario.scene, video=scene.video)
        self.starts = self.starts + 1
        self.paused = True
        self.message = ""
        self._due = 0.0
        self._slowed = 1.0
        self.remaining_loads: list[float] = []
        self.grip = -1
        self.drawn_throw: tuple[float, float] | None = None

    def _start(self, scene: Scene, body: Lattice | None = None) -> Start:
        """Return how a scene starts, with a given lattice or its own."""
        if self.starts and self.time.start.is_of(scene):
            return self.time.start
        return start_of(scene, body)

    # ---- the present state

    @property
    def at_start(self) -> bool:
        """Whether nothing has moved yet, and the user has not interfered."""
        return self.time.segment.state.step == 0 and not self.time.segment.label

    @property
    def can_aim(self) -> bool:
        """Whether the disk can be turned, and its throw drawn."""
        return self.at_start and self.time.segment.scenario.is_thrown

    @property
    def status(self) -> str:
        """Text for the user: whether the state on display is the same as in
        `taichi-disk run`."""
        if self.time.lead > 0.0:
            return "computing again"
        return (
            DISTURBED if self.time.display.segment.label else "same as taichi-disk run"
        )

    @property
    def warnings(self) -> list[str]:
        """The notes that `run` would print with this scene and, at its end, the
        warnings."""
        segment = self.time.segment
        lattice = segment.scenario.lattice
        notes = [*lattice.notes, *self.scene.notes(lattice.disk_points)]
        if segment.status == "finished":
            notes += self._warnings
        return notes

    @property
    def _slowing(self) -> float:
        """Factor of the speed now: in slow motion a contact has a smaller one."""
        scenario: Any = self.time.segment.scenario
        if not (self.slow and scenario.is_thrown):
            return 1.0
        time_unit = scenario.model.springs.time_unit
        contact = CONTACT_FORCE * scenario.velocity / time_unit
        force = self.time.segment.row[INDEX["wall_force"]]
        return SLOWDOWN if force > contact else 1.0

    # ---- time

    def tick(self) -> None:
        """Let the time since the last tick pass, at most MAX_PASSED."""
        before = self._clock
        self._clock = perf_counter()
        self.advance(min(self._clock - before, MAX_PASSED))

    def advance(self, seconds: float, max_seconds: float = MAX_COMPUTING_TIME) -> int:
        """Let `seconds` of the clock pass and return the number of steps made.

        Fewer steps are made if they would take longer than `max_seconds` [s]. While the
        scene is computed again with a shorter step, `seconds` has no influence.
        """
        segment = self.time.segment
        if self.remaining_loads and segment.status == "finished":
            self._collect_next()
            return 0
        if self.time.lead > 0.0:
            return self._go(ceil(self.time.lead / segment.step.dt), max_seconds)
        if self.paused or segment.status == "failed":
            return 0
        self._due += seconds * self._eased_pace(seconds) / segment.step.dt
        made = self._go(int(self._due), max_seconds)
        self._due = min(max(self._due - made, 0.0), 1.0)
        return made

    def _eased_pace(self, seconds: float) -> float:
        """Return the pace `seconds` of the clock later; slow motion begins and ends
        smoothly."""
        late = exp(-seconds / PACE_TIME)
        self._slowed += (1.0 - late) * (self._slowing - self._slowed)
        if self.remaining_loads:
            return COLLECTING_PACE
        return self.speed * self._slowed

    def _go(self, steps: int, max_seconds: float) -> int:
        """Make steps and report the end of the scene, a failure or a shorter step."""
        segment = self.time.segment
        before = segment.status
        made = self.time.go(steps, max_seconds)
        if self.time.segment is not segment:
            dt = self.time.segment.step.dt
            self.message = f"computed again with a shorter step, {dt:.2g} R/c"
        elif segment.status == "failed":
            self.paused = True
            self.remaining_loads = []
            self.message = (
                f"{segment.failure} (go back to the start or back in time, or change"
                " something)"
            )
        elif segment.status == "finished" and before != "finished":
            self._finish(segment)
        return made

    def _finish(self, segment: Segment) -> None:
        """Enter the result into the table, unless it was known before the user changed
        something."""
        goes_on = self.remaining_loads or segment.scenario.falls_back
        self.paused = not goes_on
        if self.time.measured is not segment:
            return
        columns = segment.columns
        self.results = [*self.results, experiment_of(segment)][-MAX_RESULTS:]
        self.message = ""
        self._warnings = warnings(segment.scenario, columns)
        self.answer = segment.scenario.conclusion(columns)
        if segment.label == DISTURBED:  # a part of the energies may lie before
            self.answer = "You have disturbed it: this is not the result of a throw."

    def _collect_next(self) -> None:
        loads = self.remaining_loads[1:]
        if loads:
            self.collect(loads)
        else:
            key = load_key(self.scene)
            self.begin(with_key(self.scene, key, self._load_before))
            self.message = "the curve is complete; the disk is at the start again"

    def collect(self, loads: list[float]) -> None:
        """Run the present scene with each of `loads` (speeds [c] or pressures [M
        c^2/R]) in turn.

        After the last load the disk is at the start again, with the load that it had
        before.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        key = load_key(self.scene)
        load_before = value_of(self.scene, key)
        if self.remaining_loads:
            load_before = self._load_before
        self.begin(with_key(self.scene, key, loads[0]))
        self.time.spacing *= COLLECTING_SPACING
        self.paused = False
        self._load_before = load_before
        self.remaining_loads = loads

    def stop_collecting(self) -> None:
        """Leave out the loads that remain."""
        self.remaining_loads = []
        if self.time.segment.status == "finished":
            self.paused = True  # as at the end of any other throw

    def remove(self, number: float) -> None:
        """Remove the row `number` of the table of results, counted from the oldest."""
        self.results = [row for k, row in enumerate(self.results) if k != number]

    def clear(self) -> None:
        """Empty the table of results."""
        self.results = []

    def pause(self) -> None:
        """Pause, or go on from the state on display."""
        if (
            self.paused
            and self.time.segment.status == "failed"
            and self.time.lead >= 0.0
        ):
            return
        self.paused = not self.paused
        self.remaining_loads = []
        if not self.paused:
            self._settle()

    def scrub(self, t: float) -> None:
        """Pause, and show the first state stored `t` [R/c] or later after the hit on
        display began."""
        self._look_at(self.time.display.segment.hit_began + t)

    def step(self, count: int) -> None:
        """Show the state `count` checkpoints later, or earlier if negative, and pause;
        after the last, time goes on."""
        if not self._look_at(self.time.display.t, count):
            self._go(self.time.due, inf)

    def _look_at(self, t: float, later: int = 0) -> bool:
        """Pause, and show a state and return as `Timeline.look_at` does. While the
        scene is computed again, only end a pull and return True."""
        self.release()
        if self.time.lead > 0.0:
            return True
        self.paused = True
        self.remaining_loads = []
        return self.time.look_at(t, later)

    def _settle(self) -> None:
        """Make an earlier state on display the present: all later states are
        forgotten."""
        if self.time.lead < 0.0:
            self.time.cut()
            self.scene = replace(
                self.time.segment.scenario.scene, video=self.scene.video
            )
            # the pull of the mouse cannot be repeated
            if self.time.segment.label == PULLED:
                self._carry_on(self.scene, DISTURBED)

    # ---- changes by the user

    def set(self, key: str, value: Any) -> None:
        """Change one key of the scene ("material.eta_star"); immediately, if the
        lattice stays the same.

        Raises TaichiDiskError if the scene refuses the value, and then leaves
        everything as it was.
        """
        scene = with_key(self.scene, key, value)
        if scene == self.scene:
            return
        if key.startswith("video."):
            self.scene = scene
        elif key in THROW_KEYS:
            self._take_throw(scene)
        elif self.at_start or key not in IMMEDIATE_KEYS:
            self.begin(scene)
        else:
            self.remaining_loads = []
            self._settle()
            self._carry_on(with_key(self.scene, key, value), DISTURBED)
            self.message = ""

    def hit_again(self) -> None:
        """Send the disk at the wall with the velocity of the scene; its vibration
        continues.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        if not self.time.segment.scenario.is_thrown:
            return
        if not self.at_start:
            self._settle()
            scene: Any = self.scene
            v = self.time.segment.present.v
            impact = scene.impact
            body = self.time.start.body
            disk = v[: body.disk_points]
            disk += (impact.along, -impact.towards) - body.mean(disk)
            self._carry_on(scene, HIT_AGAIN, v)
            self.message = f"sent back with v = {impact.velocity:g} c"
        self.paused = False

    def _carry_on(
        self, scene: Scene, label: str, velocities: Array | None = None
    ) -> None:
        """Begin another segment; time goes on even if the end of the scene or a blow-up
        had stopped it.

        A new velocity or angle of the scene takes effect at the next hit only.
        """
        status = self.time.segment.status
        scene_of_hit = scene
        if label != HIT_AGAIN:
            for key in THROW_KEYS:
                value = value_of(self.time.segment.scenario.scene, key)
                if value is not None:
                    scene_of_hit = with_key(scene_of_hit, key, value)
        start = self._start(scene_of_hit, self.time.start.body)
        self.time.carry_on(start, label, velocities)
        self.scene = scene
        self.grip = -1
        self.paused = self.paused and status not in ("failed", "finished")

    # ---- the mouse

    def turn(self, angle: float, final: bool = True) -> None:
        """Turn the disk by `angle` [rad] from its orientation in the scene, at the
        start of an impact.

        `final` changes `impact.turn` of the scene; otherwise the turned disk is only
        shown.
        """
        if not self.can_aim:
            return
        if final:
            turn = np.angle(np.exp(1j * (value_of(self.scene, "impact.turn") + angle)))
            self.begin(self.scene.with_({"impact.turn": float(f"{turn:.4f}")}))
        else:
            now = self.time.segment.present
            n = self.time.start.body.disk_points
            vectors = now.snapshot.vectors.copy()
            vectors[0, :n] = turned(now.x[:n], angle)
            self.time.display = replace(
                now, snapshot=replace(now.snapshot, vectors=vectors)
            )

    def aim(self, dx: float, dy: float) -> None:
        """Draw the throw along (dx, dy) [R] at the start of an impact: AIM_SCALE c for
        each R, never upwards."""
        if self.can_aim:
            velocity = max(AIM_SCALE * np.hypot(dx, dy), 1e-3)
            angle = np.clip(np.arctan2(dx, -dy), -1.5, 1.5)
            self.drawn_throw = float(f"{velocity:.3g}"), float(f"{angle:.3g}")

    def throw(self) -> None:
        """Apply the velocity and the angle of the drawn throw to the scene. Raises
        TaichiDiskError."""
        if not self.drawn_throw:
            return
        scene = self.scene
        for key, value in zip(THROW_KEYS, self.drawn_throw, strict=True):
            scene = with_key(scene, key, value)
        self._take_throw(scene)
        self.drawn_throw = None

    def _take_throw(self, scene: Scene) -> None:
        """Take a scene with another velocity or angle."""
        if self.at_start:
            self.begin(scene)
            return
        self.scene = scene
        self.message = "a new velocity or angle takes effect at the next hit or start"

    def pull(self, x: float, y: float) -> None:
        """Tie the disk's point nearest to (x, y) [R] to the mouse there, or move the
        mouse of the tied point.

        An earlier state on display becomes the present.
        """
        self._settle()
        if self.time.segment.status == "failed" or self.time.lead > 0.0:
            return
        if self.grip < 0:
            self._carry_on(self.scene, PULLED)
            points = self.time.start.body.disk_points
            away = self.time.segment.present.x[:points] - (x, y)
            self.grip = int(np.hypot(*away.T).argmin())
        self.time.segment.pull(self.grip, (x, y))

    def release(self) -> None:
        """Untie the point, after which the scene can end again, and forget a throw that
        is being drawn."""
        self.drawn_throw = None
        if self.grip >= 0 and self.time.segment.status != "failed":
            self._carry_on(self.scene, DISTURBED)
        self.grip = -1
