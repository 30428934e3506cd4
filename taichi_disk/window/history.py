"""The states since the start: from each of them the simulation continues bitwise, across all changes by the user."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from math import inf
from time import perf_counter

import numpy as np

from taichi_disk.computation.diagnostics import EnergyBalance
from taichi_disk.computation.driver import Driver, Status
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum
from taichi_disk.lattice import Array
from taichi_disk.simulation.observables import INDEX, within
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.simulation.stepping import Snapshot

SPACING = 1.5e-2  # first time between two stored states, over the springs' time unit
MAX_STATES, MAX_BYTES = 1280, 1.7e9  # stored states and their memory; then every second one is dropped


class Segment(Driver):
    """The time between two changes by the user. It can continue after the scene's end, and go back to an earlier state.

    Attributes:
        began: time at its start [R/c].
        hit: number of the hit, from 1.
        label: the change at its start: "", "hit again" or "disturbed".
        pulled_from: number of the step at which the mouse began to pull, inf if it did not; after it, the segment
            neither ends nor begins again with a shorter step.
        reference_energy: kinetic energy at the start, or about the work of the load [M c^2].
    """

    def __init__(
        self, scenario: Scenario, kernels: KernelCache, modes: Spectrum, began: float = 0, hit: int = 1, label: str = ""
    ) -> None:
        self.began, self.hit, self.label = began, hit, label
        self.reference_energy = scenario.reference_energy
        super().__init__(scenario, scenario.scene.time, kernels, modes)

    def _begin(self) -> None:
        super()._begin()
        self._last, self.pulled_from = 2**31 - 1, inf

    def advance(self, seconds: float = inf, steps: int | None = None) -> Status:
        """Advance as a `Driver`, but without `max_time`; after the end, the status stays "finished"."""
        is_over = self.status == "finished"
        self.can_end = not is_over and self.pulled_from == inf
        if is_over:
            self.status = "running"
        super().advance(seconds, steps)
        if is_over and self.status == "running":
            self.status = "finished"
        return self.status

    @property
    def now(self) -> float:
        """Time since the start [R/c]."""
        return self.began + self.state.step * self.step.dt

    @property
    def present(self) -> Checkpoint:
        """The last valid state."""
        return Checkpoint(self, self.now, self.row, self.state, self.state.step > self.pulled_from)

    @property
    def imbalance(self) -> float:
        """Error of the energy balance [M c^2]."""
        return float(self._balance.imbalance(self.row[None])[0])

    def back_to(self, checkpoint: Checkpoint) -> None:
        """Continue from an earlier state of this attempt, of which the mouse has pulled none; forget all later ones."""
        snapshot = checkpoint.snapshot
        self.simulation = self._simulation()
        self.simulation.restore(snapshot)
        self.count = 1 + snapshot.step // self.stride
        inside = within(self.rows[1:], self._bounds)
        self._quiet = min(int(np.argmin(np.append(inside[::-1], False))), self._needed - 1)
        self._balance = EnergyBalance(self.rows[0])
        self._balance.first_lost(self.rows)
        self.state, self.row, self.failure = snapshot, checkpoint.row, None
        self.pulled_from = 0 if checkpoint.pulled else inf
        is_over = self.end is not None and snapshot.step >= self.end.step
        self.status, self.end = ("finished", self.end) if is_over else ("running", None)

    def pull(self, point: int, target: tuple[float, float]) -> None:
        """Tie a point (-1: no point) to the mouse at `target` [R] from now on; the model needs a `mouse`."""
        self.pulled_from = min(self.pulled_from, self.simulation.step_number)
        jump = self.simulation.set_mouse_target(point, target)
        self.row = self.row.copy()
        self.row[INDEX["load"]] += jump
        self._balance.give(jump)
        self.state = self.simulation.snapshot()


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A state that can be displayed or resumed.

    Attributes:
        segment: the run segment that the state was taken from.
        t: time since the start [R/c].
        row: (columns,) the observables.
        snapshot: the simulation's state.
        pulled: whether the mouse had pulled in this segment.
    """

    segment: Segment
    t: float
    row: Array
    snapshot: Snapshot
    pulled: bool

    @property
    def x(self) -> Array:
        """Positions (n, 2) [R]."""
        return self.snapshot.vectors[0]

    @property
    def v(self) -> Array:
        """Velocities (n, 2) [c]."""
        step = self.segment.step
        return self.snapshot.velocities(step.integrator, step.dt, self.segment.scenario.lattice)

    @property
    def is_disturbed(self) -> bool:
        """Whether the user has interfered before this state."""
        return self.pulled or bool(self.segment.label)

    @property
    def values(self) -> dict[str, float]:
        """The observables by their names."""
        return dict(zip(INDEX, map(float, self.row), strict=True))


class Timeline:
    """The states since the last start.

    Attributes:
        last: the segment that moves.
        spacing: time between two stored states [R/c]; storing one takes longer than a few steps.
        checkpoints: the stored states, the latest last.
        seen: the state on display: the present, an earlier state, or the latest state reached before the scene began
            again with a shorter step.
    """

    def __init__(self, first: Segment) -> None:
        self.checkpoints: list[Checkpoint] = []
        self.spacing = SPACING * first.scenario.model.springs.time_unit
        self.follow(first)

    def follow(self, segment: Segment) -> None:
        """Continue with another segment."""
        self.last = segment
        self._store()
        self.seen = segment.present

    # ---- time

    @property
    def hit_segments(self) -> list[Segment]:
        """The stored segments of the hit on display."""
        known = dict.fromkeys([*(one.segment for one in self.checkpoints), self.last])
        return [one for one in known if one.hit == self.seen.segment.hit]

    @property
    def hit_began(self) -> float:
        """Time of the start of the hit on display [R/c]."""
        return self.hit_segments[0].began

    @property
    def past(self) -> bool:
        """Whether the state on display is earlier than the present."""
        return self.seen.t < self.last.now

    @property
    def behind(self) -> float:
        """Time by which the present is earlier than the state on display [R/c]."""
        return max(0.0, self.seen.t - self.last.now)

    @property
    def due(self) -> int:
        """Steps until the next state is stored."""
        dt = self.last.step.dt
        return round((self.checkpoints[-1].t + max(self.spacing, dt) - self.last.now) / dt)

    def go(self, steps: int, seconds: float) -> int:
        """Make at most `steps` steps, within about `seconds` of the clock and up to the scene's end.

        Returns the number of steps made.
        """
        segment, until, made = self.last, perf_counter() + seconds, 0
        while made < steps and segment.status != "failed":
            before, number = segment.status, segment.simulation.step_number
            segment.advance(max(until - perf_counter(), 0.0), min(steps - made, self.due))
            made += max(segment.simulation.step_number - number, 0)
            if segment.status == "restarted":
                self.checkpoints = [one for one in self.checkpoints if one.segment is not segment]
            self._store()
            if segment.status not in ("running", before) or perf_counter() >= until:
                break
        if not self.behind or segment.status in ("finished", "failed"):
            self.seen = segment.present
        return made

    def _store(self) -> None:
        if self.checkpoints and self.due > 0:
            return
        now = self.last.present
        self.checkpoints.append(now)
        if len(self.checkpoints) >= min(MAX_STATES, MAX_BYTES / now.snapshot.vectors.nbytes):
            self.checkpoints = self.checkpoints[::2]
            self.spacing = (self.checkpoints[-1].t - self.checkpoints[0].t) / (len(self.checkpoints) - 1)

    # ---- the state on display

    def look_at(self, t: float) -> None:
        """Show the stored state nearest to the time `t` [R/c]."""
        self._show(int(np.abs(np.array([one.t for one in self.checkpoints]) - t).argmin()))

    def look_beside(self, count: int) -> bool:
        """Show the state `count` checkpoints later, or earlier if negative. Returns False after the last one."""
        place = bisect_left(self.checkpoints, self.seen.t, key=lambda one: one.t) + count
        self._show(max(place, 0))
        return place < len(self.checkpoints)

    def _show(self, place: int) -> None:
        """Show a checkpoint, or the present if none is as late as that."""
        known = self.checkpoints[place : place + 1]
        self.seen = known[0] if known and known[0].t < self.last.now else self.last.present

    def cut(self) -> None:
        """Make the earlier state on display the present: all later states are forgotten."""
        seen = self.seen
        del self.checkpoints[self.checkpoints.index(seen) + 1 :]
        self.last = seen.segment
        self.last.back_to(seen)
        self.seen = self.last.present
