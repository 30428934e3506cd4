"""What has been seen since the start: states from which the simulation goes on bitwise, across all changes by hand."""

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

SPACING = 1.5e-2  # time between two remembered states at first, of the disk's own time
MOST, BYTES = 1280, 1.7e9  # states remembered, and what they may take; then every second is let go


class Segment(Driver):
    """The time between two changes by hand. It goes on after the scene's end, and back; a mouse may pull in it.

    Attributes:
        began: time at its start [R/c].
        hit: number of the hit that it belongs to.
        label: what hands have done: "", "hit again", "by hand".
        pulled_from: number of the step at which the mouse began to pull; from then on no retries and no end. inf: none.
    """

    def __init__(
        self, scenario: Scenario, kernels: KernelCache, modes: Spectrum, began: float = 0, hit: int = 1, label: str = ""
    ) -> None:
        self.began, self.hit, self.label = began, hit, label
        super().__init__(scenario, scenario.scene.time, kernels, modes)

    def _begin(self) -> None:
        super()._begin()
        self._last, self.pulled_from = 2**31 - 1, inf

    def advance(self, seconds: float = inf, steps: int | None = None) -> Status:
        """As a `Driver`, but `max_time` is no failure, and after the end time goes on: the status stays "finished"."""
        over = self.status == "finished"
        self.can_end = not over and self.pulled_from == inf
        if over:
            self.status = "running"
        super().advance(seconds, steps)
        if over and self.status == "running":
            self.status = "finished"
        return self.status

    @property
    def now(self) -> float:
        """Time since the start [R/c]."""
        return self.began + self.state.step * self.step.dt

    @property
    def present(self) -> Checkpoint:
        """The last state that is good."""
        return Checkpoint(self, self.now, self.row, self.state, self.state.step > self.pulled_from)

    @property
    def imbalance(self) -> float:
        """Energy that has appeared from nowhere [M c^2]."""
        return float(self._balance.imbalance(self.row[None])[0])

    def back_to(self, snapshot: Snapshot, row: Array) -> None:
        """Go back to a `state` of this attempt, with its `row`, before the mouse pulled; all after it is forgotten."""
        self.simulation = self._simulation()
        self.simulation.restore(snapshot)
        self.count = 1 + snapshot.step // self.stride
        inside = within(self.rows[1:], self._bounds)
        self._quiet = min(int(np.argmin(np.append(inside[::-1], False))), self._needed - 1)
        self._balance = EnergyBalance(self.rows[0])
        self._balance.first_lost(self.rows)
        self.state, self.row, self.failure, self.pulled_from = snapshot, row, None, inf
        over = self.end is not None and snapshot.step >= self.end.step
        self.status, self.end = ("finished", self.end) if over else ("running", None)

    def pull(self, point: int, target: tuple[float, float]) -> None:
        """Tie a point (-1: none any more) to the mouse at `target` [R] from now on; the model needs a `mouse`."""
        self.pulled_from = min(self.pulled_from, self.simulation.step_number)
        jump = self.simulation.set_mouse_target(point, target)
        self.row = self.row.copy()
        self.row[INDEX["load"]] += jump
        self._balance.give(jump)
        self.state = self.simulation.snapshot()


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A state to see, and to go on from.

    Attributes:
        segment: that it belongs to.
        t: time since the start [R/c].
        row: (columns,) the observables.
        snapshot: from which the segment goes on bitwise.
        pulled: whether the mouse has pulled in this segment.
    """

    segment: Segment
    t: float
    row: Array
    snapshot: Snapshot
    pulled: bool

    @property
    def x(self) -> Array:
        """(n, 2) positions [R]."""
        return self.snapshot.vectors[0]

    @property
    def v(self) -> Array:
        """(n, 2) velocities [c]."""
        step = self.segment.step
        return self.snapshot.velocities(step.integrator, step.dt, self.segment.scenario.lattice)

    @property
    def by_hand(self) -> bool:
        """Whether hands had a part in it."""
        return self.pulled or bool(self.segment.label)

    @property
    def values(self) -> dict[str, float]:
        """The observables by their names."""
        return dict(zip(INDEX, map(float, self.row), strict=True))


class Timeline:
    """What is remembered since the last start, and what there is to see.

    Attributes:
        last: the segment that moves.
        spacing: time between two remembered states [R/c]; to remember one takes longer than a few steps.
        checkpoints: that are remembered, the latest last.
        seen: what there is to see: the present, something past, or the latest that was reached while all is computed
            again with a shorter step.
    """

    def __init__(self, first: Segment) -> None:
        self.checkpoints: list[Checkpoint] = []
        self.spacing = SPACING * first.scenario.model.springs.time_unit
        self.follow(first)

    def follow(self, segment: Segment) -> None:
        """Go on with another one."""
        self.last = segment
        self._remember()
        self.look()

    def of_hit(self, hit: int) -> list[Segment]:
        """The segments of one hit, as far as they are remembered."""
        known = dict.fromkeys([*(one.segment for one in self.checkpoints), self.last])
        return [one for one in known if one.hit == hit]

    # ---- time

    @property
    def past(self) -> bool:
        """Whether what is seen is before the present."""
        return self.seen.t < self.last.now

    @property
    def behind(self) -> float:
        """How far the present is behind what is seen [R/c]."""
        return max(0.0, self.seen.t - self.last.now)

    @property
    def due(self) -> int:
        """Steps until another state is to be remembered."""
        dt = self.last.step.dt
        return round((self.checkpoints[-1].t + max(self.spacing, dt) - self.last.now) / dt)

    def go(self, steps: int, seconds: float) -> int:
        """Make `steps` steps, or fewer: not much longer than `seconds` of the clock, and not past the scene's end.

        Returns how many were made.
        """
        segment, until, made = self.last, perf_counter() + seconds, 0
        while made < steps and segment.status != "failed":
            before, number = segment.status, segment.simulation.step_number
            segment.advance(max(until - perf_counter(), 0.0), min(steps - made, self.due))
            made += max(segment.simulation.step_number - number, 0)
            if segment.status == "restarted":
                self.checkpoints = [one for one in self.checkpoints if one.segment is not segment]
            self._remember()
            if segment.status not in ("running", before) or perf_counter() >= until:
                break
        if not self.behind or segment.status in ("finished", "failed"):
            self.look()
        return made

    def _remember(self) -> None:
        if self.checkpoints and self.due > 0:
            return
        now = self.last.present
        self.checkpoints.append(now)
        if len(self.checkpoints) >= min(MOST, BYTES / now.snapshot.vectors.nbytes):
            self.checkpoints = self.checkpoints[::2]
            self.spacing = (self.checkpoints[-1].t - self.checkpoints[0].t) / (len(self.checkpoints) - 1)

    # ---- what is seen

    def look(self) -> None:
        """See the present."""
        self.seen = self.last.present

    def look_at(self, t: float) -> None:
        """See the state that is remembered nearest to the time `t` [R/c]."""
        self._see(int(np.abs(np.array([one.t for one in self.checkpoints]) - t).argmin()))

    def look_beside(self, count: int) -> bool:
        """See what is `count` checkpoints later, or earlier if negative. Returns False at the end of what is known."""
        at = bisect_left(self.checkpoints, self.seen.t, key=lambda one: one.t) + count
        if at >= len(self.checkpoints):
            self.look()
            return False
        self._see(max(at, 0))
        return True

    def _see(self, at: int) -> None:
        self.seen = self.checkpoints[at]
        if not self.past:
            self.look()

    def cut(self) -> None:
        """Make the past state that is seen the present: all after it is forgotten."""
        seen = self.seen
        del self.checkpoints[self.checkpoints.index(seen) + 1 :]
        self.last = seen.segment
        self.last.back_to(seen.snapshot, seen.row)
        if seen.pulled:
            self.last.pulled_from = 0
        self.look()
