"""What has been seen since the start: states from which the simulation goes on bitwise, across all changes by hand."""

from __future__ import annotations

from bisect import bisect_left
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from taichi_disk.lattice import Array
from taichi_disk.simulation.driver import Driver
from taichi_disk.simulation.observables import COLUMNS
from taichi_disk.simulation.stepping import Snapshot

SPACING = 1.5e-2  # time between two remembered states at first, of the disk's own time
MOST, BYTES = 1280, 1.7e9  # states remembered, and what they may take; then every second is let go


@dataclass(eq=False)
class Stretch:
    """The time between two changes by hand.

    Attributes:
        driver: that of `run`.
        began: time at its start [R/c].
        hit: number of the hit that it belongs to.
        label: what hands have done: "", "hit again", "by hand".
    """

    driver: Driver
    began: float = 0.0
    hit: int = 1
    label: str = ""

    @property
    def now(self) -> float:
        """Time since the start [R/c]."""
        return self.began + self.driver.state.step * self.driver.step.dt

    @property
    def present(self) -> Moment:
        """The last moment that is good."""
        driver, state = self.driver, self.driver.state
        return Moment(self, self.now, driver.row, state, state.step > driver.pulled_from)


@dataclass(frozen=True, eq=False)
class Moment:
    """One state.

    Attributes:
        stretch: that it belongs to.
        t: time since the start [R/c].
        row: (columns,) the observables.
        exact: from which the stretch goes on bitwise.
        pulled: whether the mouse has pulled in this stretch.
    """

    stretch: Stretch
    t: float
    row: Array
    exact: Snapshot
    pulled: bool

    @property
    def x(self) -> Array:
        """(n, 2) positions [R]."""
        return self.exact.vectors[0]

    @property
    def v(self) -> Array:
        """(n, 2) velocities [c]."""
        driver = self.stretch.driver
        return self.exact.velocities(driver.step.integrator, driver.step.dt, driver.scenario.lattice.masses[0])

    @property
    def by_hand(self) -> bool:
        """Whether hands had a part in it."""
        return self.pulled or bool(self.stretch.label)

    @property
    def values(self) -> dict[str, float]:
        """The observables by their names."""
        return dict(zip(COLUMNS, map(float, self.row), strict=True))


class Timeline:
    """What is remembered since the last start, and what there is to see.

    Attributes:
        last: the stretch that moves.
        moments: that are remembered, the latest last.
        moment: what there is to see: the present, something past, or the latest that was reached while all is computed
            again with a shorter step.
    """

    def __init__(self, first: Stretch) -> None:
        self.moments: list[Moment] = []
        self._spacing = SPACING * first.driver.scenario.scene.material.k_a**-0.5
        self.follow(first)

    def follow(self, stretch: Stretch) -> None:
        """Go on with another one."""
        self.last = stretch
        self._remember()
        self.look()

    def of_hit(self, hit: int) -> list[Stretch]:
        """The stretches of one hit, as far as they are remembered."""
        known = dict.fromkeys([*(one.stretch for one in self.moments), self.last])
        return [one for one in known if one.hit == hit]

    # ---- time

    @property
    def past(self) -> bool:
        """Whether what is seen is before the present."""
        return self.moment.t < self.last.now

    @property
    def behind(self) -> float:
        """How far the present is behind what is seen [R/c]."""
        return max(0.0, self.moment.t - self.last.now)

    @property
    def due(self) -> int:
        """Steps until another state is to be remembered."""
        dt = self.last.driver.step.dt
        return round((self.moments[-1].t + max(self._spacing, dt) - self.last.now) / dt)

    def go(self, steps: int, seconds: float) -> int:
        """Make `steps` steps, or fewer: not much longer than `seconds` of the clock, and not past the scene's end.

        Returns how many were made.
        """
        driver, until, made = self.last.driver, perf_counter() + seconds, 0
        while made < steps and driver.status != "failed":
            before, number = driver.status, driver.simulation.step_number
            driver.advance(max(until - perf_counter(), 0.0), min(steps - made, self.due))
            made += max(driver.simulation.step_number - number, 0)
            if driver.status == "restarted":
                self.moments = [one for one in self.moments if one.stretch is not self.last]
            self._remember()
            if driver.status not in ("running", before) or perf_counter() >= until:
                break
        if not self.behind or driver.status in ("finished", "failed"):
            self.look()
        return made

    def _remember(self) -> None:
        if self.moments and self.due > 0:
            return
        now = self.last.present
        self.moments.append(now)
        if len(self.moments) >= min(MOST, BYTES / now.exact.vectors.nbytes):
            self.moments = self.moments[::2]
            self._spacing = (self.moments[-1].t - self.moments[0].t) / (len(self.moments) - 1)

    # ---- what is seen

    def look(self) -> None:
        """See the present."""
        self.moment = self.last.present

    def look_at(self, t: float) -> None:
        """See the state that is remembered nearest to the time `t` [R/c]."""
        self._see(int(np.abs(np.array([one.t for one in self.moments]) - t).argmin()))

    def look_beside(self, count: int) -> bool:
        """See the state `count` places later, or earlier if negative. Returns False at the end of what is known."""
        at = bisect_left(self.moments, self.moment.t, key=lambda one: one.t) + count
        if at >= len(self.moments):
            self.look()
            return False
        self._see(max(at, 0))
        return True

    def _see(self, at: int) -> None:
        self.moment = self.moments[at]
        if not self.past:
            self.look()

    def cut(self) -> None:
        """Make the past moment that is seen the present: all after it is forgotten."""
        seen = self.moment
        del self.moments[self.moments.index(seen) + 1 :]
        self.last = seen.stretch
        self.last.driver.back_to(seen.exact, seen.row)
        if seen.pulled:
            self.last.driver.pulled_from = 0
        self.look()
