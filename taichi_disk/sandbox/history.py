"""The states since the start: from each of them the simulation continues bitwise,
across all changes by the user."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass, replace
from math import inf
from time import perf_counter
from typing import NamedTuple

import numpy as np

from taichi_disk.experiments.computation.driver import Driver, Status
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.computation.stability import Spectrum
from taichi_disk.experiments.computation.step_control import StepControl
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.setup import body_of, spectrum_of
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import MouseSpring
from taichi_disk.mechanics.simulation.observables import INDEX, of_kind
from taichi_disk.mechanics.simulation.simulation import MAX_STEPS
from taichi_disk.mechanics.simulation.stepping import Snapshot

# first time between two stored states, over the springs' time unit
STORE_SPACING = 1.5e-2
# changes by the user
HIT_AGAIN = "hit again"
DISTURBED = "disturbed"
PULLED = "pulled"
LOSSES = [INDEX[name] for name in of_kind("loss")]
NOTHING_LOST = np.zeros(len(LOSSES))
# stored states of a timeline, and their memory; then every second one is dropped
MAX_STATES = 1280
MAX_BYTES = 1.7e9
MAX_SPACING = 2.0  # largest spacing of stored states, over the usual one


class Segment(Driver):
    """The time between two changes by the user. It can continue after the scene's end,
    and go back to an earlier state.

    Attributes:
        control: chooses the step of this segment.
        label: the change at which the segment began: "", HIT_AGAIN, DISTURBED or
            PULLED. While the mouse pulls a point, the scene does not end and does not
            begin again with a shorter step.
        began: time at which the segment began [R/c].
        hit_began: time at which the last start or further hit began [R/c].
        lost_before: (losses,) what that hit had lost when the segment began [M c^2].
    """

    def __init__(
        self,
        control: StepControl,
        label: str = "",
        began: float = 0.0,
        hit_began: float = 0.0,
        lost_before: Array = NOTHING_LOST,
    ) -> None:
        super().__init__(control.scenario, control.step)
        self.last_step = MAX_STEPS  # there is no time limit
        self.control = control
        self.label = label
        self.began = began
        self.hit_began = hit_began
        self.lost_before = lost_before

    def advance(self, seconds: float = inf, steps: int = MAX_STEPS) -> Status:
        """Advance as a `Driver` does; the disk still moves after the end, and the
        status stays "finished"."""
        self.can_end = self.end is None and self.label != PULLED
        if self.status == "finished":
            self.status = "running"
        super().advance(seconds, steps)
        if self.end and self.status == "running":
            self.status = "finished"
        return self.status

    @property
    def now(self) -> float:
        """Time since the start [R/c]."""
        return self.began + self.state.step * self.step.dt

    @property
    def present(self) -> Checkpoint:
        """The last valid state."""
        return Checkpoint(self, self.now, self.row, self.state)

    def begun_again(self) -> Segment | None:
        """Return this segment at its start with a shorter step, if the step was too
        long; otherwise None."""
        if not (self.can_end and self.control.shortens(self)):
            return None
        return Segment(
            control=self.control,
            label=self.label,
            began=self.began,
            hit_began=self.hit_began,
            lost_before=self.lost_before,
        )


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A state that can be displayed or resumed.

    Attributes:
        segment: the segment that the state was taken from.
        t: time since the start [R/c].
        row: (columns,) the observables.
        snapshot: the simulation's state.
    """

    segment: Segment
    t: float
    row: Array
    snapshot: Snapshot

    @property
    def x(self) -> Array:
        """Positions (n, 2) [R]."""
        return self.snapshot.vectors[0]

    @property
    def v(self) -> Array:
        """Velocities (n, 2) [c]."""
        step = self.segment.step
        return self.snapshot.velocities(
            step.integrator, step.dt, self.segment.scenario.lattice
        )

    @property
    def values(self) -> dict[str, float]:
        """The observables by their names."""
        return dict(zip(INDEX, map(float, self.row), strict=True))


class Start(NamedTuple):
    """How a scene starts: the scene at t = 0 with a mouse spring that pulls no point,
    its unloaded lattice, and the spectrum of the springs."""

    scenario: Scenario
    body: Lattice
    spectrum: Spectrum

    def is_of(self, scene: Scene) -> bool:
        """Whether a scene starts like this; how it is drawn plays no role."""
        own: Scene = self.scenario.scene
        return replace(scene.in_time(), video=own.video) == own


def start_of(scene: Scene, body: Lattice | None = None) -> Start:
    """Compute how a scene starts, with a given unloaded lattice or its own. Raises
    TaichiDiskError."""
    scene = scene.in_time()
    if body is None:
        body = body_of(scene)
    scenario = scene.scenario(body)
    springs = scenario.model.springs
    # A force above 0.02 modulus R would turn triangles of a fine lattice inside out.
    mouse = MouseSpring(0.2 * springs.modulus, 0.02 * springs.modulus)
    model = replace(scenario.model, mouse=mouse)
    # Include the damping rates of dashpots, which the user may switch on later.
    damped = replace(model, springs=replace(springs, eta=1.0))
    spectrum = spectrum_of(scene, scenario.lattice, damped)
    return Start(replace(scenario, model=model), body, spectrum)


class Timeline:
    """The states since the last start.

    Attributes:
        start: how the scene started.
        segment: the segment that moves.
        spacing: time between two stored states [R/c]; storing one takes longer than a
            few steps.
        checkpoints: the stored states, the latest last.
        display: the state on display: the present, an earlier state, or the latest
            state reached before the scene began again with a shorter step.
    """

    def __init__(self, start: Start) -> None:
        """Begin at t = 0. Raises TaichiDiskError if the scene cannot be computed."""
        self.start = start
        self.checkpoints: list[Checkpoint] = []
        self.spacing = STORE_SPACING * start.scenario.model.springs.time_unit
        self._follow(Segment(StepControl(start.scenario, start.spectrum)))

    def carry_on(self, start: Start, label: str, velocities: Array | None) -> None:
        """Begin another segment from the present state, or with other `velocities` (n,
        2) [c]. `start`: how the changed scene would start with this lattice.

        Raises TaichiDiskError, and then leaves everything as it was.
        """
        last = self.segment
        now = self.segment.present
        scenario = start.scenario
        point_force = scenario.point_force
        # a time step set by the user would be refused for the force of a blow-up
        if last.status != "failed":
            peak = last.simulation.peak_point_force(now.snapshot)
            point_force = max(point_force, peak)
        scenario = replace(
            scenario,
            lattice=replace(scenario.lattice, positions=now.x),
            velocities=now.v if velocities is None else velocities,
            point_force=point_force,
        )
        hit_began = last.hit_began
        lost_before = last.lost_before + now.row[LOSSES]
        if label == HIT_AGAIN:
            hit_began = now.t
            lost_before = NOTHING_LOST
        segment = Segment(
            control=StepControl(scenario, self.start.spectrum),
            label=label,
            began=now.t,
            hit_began=hit_began,
            lost_before=lost_before,
        )
        last.let_go()
        self._follow(segment)

    def _follow(self, segment: Segment) -> None:
        self.segment = segment
        self._store()
        self.display = segment.present

    # ---- time

    @property
    def hit_segments(self) -> list[Segment]:
        """The segments of the hit on display that have a stored state or are moving."""
        known = dict.fromkeys(
            [*(one.segment for one in self.checkpoints), self.segment]
        )
        return [one for one in known if one.hit_began == self.display.segment.hit_began]

    @property
    def measured(self) -> Segment | None:
        """The segment in which the hit on display came to its end, if it has."""
        return next((one for one in self.hit_segments if one.end), None)

    @property
    def lead(self) -> float:
        """Time by which the state on display is later than the present [R/c], negative
        if it is earlier."""
        return self.display.t - self.segment.now

    @property
    def due(self) -> int:
        """Steps until the next state is stored."""
        dt = self.segment.step.dt
        later = self.checkpoints[-1].t + self._spacing
        return round((later - self.segment.now) / dt)

    @property
    def _spacing(self) -> float:
        """Time between two stored states now [R/c]."""
        return max(self.spacing, self.segment.step.dt)

    def go(self, steps: int, seconds: float) -> int:
        """Make at most `steps` steps, within about `seconds` of the clock and up to the
        scene's end.

        Returns the number of steps made.
        """
        segment = self.segment
        until = perf_counter() + seconds
        start = segment.state.step
        end = start + steps
        while segment.state.step < end and segment.status != "failed":
            before = segment.status
            portion = end - segment.state.step
            # a launch takes longer than a few steps
            if portion * segment.step.dt > MAX_SPACING * self._spacing:
                portion = min(portion, self.due)
            segment.advance(until - perf_counter(), portion)
            if segment.status not in ("running", before):
                shorter = segment.begun_again()
                if shorter is not None:
                    self._replace(shorter)
                    return 0
            self._store()
            if segment.status not in ("running", before) or perf_counter() >= until:
                break
        if self.lead <= 0.0 or segment.status in ("finished", "failed"):
            self.display = segment.present
        return max(segment.state.step - start, 0)

    def _replace(self, segment: Segment) -> None:
        """Continue with `segment`, the present segment at its start; the state on
        display stays until that is reached again."""
        self.checkpoints = [
            one for one in self.checkpoints if one.segment is not self.segment
        ]
        self.segment = segment
        self._store()
        if self.lead <= 0.0:
            self.display = segment.present

    def _store(self) -> None:
        if self.checkpoints and self.due > 0:
            return
        now = self.segment.present
        self.checkpoints.append(now)
        most = min(MAX_STATES, MAX_BYTES / now.snapshot.vectors.nbytes)
        if len(self.checkpoints) >= max(most, 3.0):
            self.checkpoints = self.checkpoints[::2]
            self.spacing *= 2.0

    # ---- the state on display

    def look_at(self, t: float, later: int) -> bool:
        """Show the first state stored at or after the time `t` [R/c], or the stored
        state `later` places further.

        If there is none, show the present and return False.
        """
        self.display = self.segment.present
        place = max(bisect_left(self.checkpoints, t, key=lambda one: one.t) + later, 0)
        if place >= len(self.checkpoints):
            return False
        if self.checkpoints[place].t < self.segment.now:
            self.display = self.checkpoints[place]
        return True

    def cut(self) -> None:
        """Make the earlier state on display the present: all later states are
        forgotten."""
        del self.checkpoints[self.checkpoints.index(self.display) + 1 :]
        self.segment = self.display.segment
        self.segment.back_to(self.display.snapshot, self.display.row)
        self.display = self.segment.present
