"""What a scene has passed through since its start: stretches of time between changes by hand, and their states."""

from __future__ import annotations

from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Array
from taichi_disk.simulation.driver import Driver
from taichi_disk.simulation.observables import COLUMNS
from taichi_disk.simulation.scenario import Scenario
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.simulation.stability import Spectrum
from taichi_disk.simulation.state import Snapshot

MOST = 1280  # states kept of one stretch; then every second is let go, so that 640 are left
EXACT = 16  # every so many states there is a snapshot, four times as large as what is drawn
SPACING, LARGE = 8e-3, 5000  # between two states, of the disk's own time; twice that of more points
STRETCHES, BYTES = 200, 4e8  # kept at most; what all their states may take


@dataclass(frozen=True, eq=False)
class Moment:
    """One state.

    Attributes:
        stretch: that it belongs to.
        step: number of its step in there.
        t: time of the sandbox [R/c].
        x, v: (n, 2) positions [R] and velocities [c]; in single precision where it is remembered.
        row: (columns,) the observables.
        exact: from which the simulation goes on bitwise; of some remembered ones only.
    """

    stretch: Stretch
    step: int
    t: float
    x: NDArray[Any]
    v: NDArray[Any]
    row: Array
    exact: Snapshot | None

    @property
    def by_hand(self) -> bool:
        """Whether hands had a part in it."""
        return bool(self.stretch.label) or self.step > self.stretch.pulled_from

    @property
    def values(self) -> dict[str, float]:
        """The observables by their names."""
        return dict(zip(COLUMNS, map(float, self.row), strict=True))


class Stretch(Driver):
    """The time between two changes by hand: the driver of `run`, with a memory.

    Attributes:
        began: time of the sandbox at its start [R/c].
        hit: number of the hit that it belongs to.
        label: what hands have done: "", "hit again", "by hand".
        gift: energy that the change before it gave at once [M c^2].
        seen: the latest time that was reached in any attempt [R/c].
        moments: that are remembered.
        spacing: steps between two of them; it doubles whenever there are MOST.
    """

    def __init__(
        self,
        scenario: Scenario,
        time: Any,
        kernels: KernelCache,
        spectrum: Spectrum,
        *,
        began: float = 0.0,
        hit: int = 1,
        label: str = "",
    ) -> None:
        """Raises InputError for a step by hand that is too long."""
        super().__init__(scenario, time, kernels, spectrum, endless=True)
        self.began, self.hit, self.label = began, hit, label
        self.gift, self.seen = 0.0, 0.0
        self._begin_memory()

    def _begin_memory(self) -> None:
        spacing = SPACING if len(self.scenario.lattice.positions) <= LARGE else 2.0 * SPACING
        self.spacing = max(1, round(spacing * self.scenario.scene.material.k_a**-0.5 / self.step.dt))
        self.moments: list[Moment] = []
        self._remember()

    def _remember(self) -> None:
        now = self.state
        if self.status == "failed" or (now.step % self.spacing and now is not self.end):
            return
        if self.moments and now.step <= self.moments[-1].step:
            return
        if len(self.moments) >= MOST:
            self.spacing *= 2  # the states that are left stand on the new grid
            half = enumerate(self.moments[::2])
            self.moments = [replace(one, exact=None) if k % EXACT else one for k, one in half]
        moment, exact = self.present, None if len(self.moments) % EXACT else now
        x, v = moment.x.astype(np.float32), moment.v.astype(np.float32)
        self.moments.append(replace(moment, x=x, v=v, exact=exact))

    @property
    def now(self) -> float:
        """Time of the sandbox [R/c]."""
        return self.began + self.state.step * self.step.dt

    @property
    def present(self) -> Moment:
        """The last moment that is good."""
        state, simulation = self.state, self.simulation
        x, v = simulation.positions(state), simulation.velocities(state)
        return Moment(self, state.step, self.now, x, v, self.row, state)

    @property
    def behind(self) -> float:
        """How far this is behind what was seen before all began again with a shorter step [R/c]."""
        return 0.0 if self.status == "failed" else max(0.0, self.seen - self.time)

    def go(self, steps: int, seconds: float) -> int:
        """Make `steps` steps, or fewer: not much longer than `seconds` of the clock, and not past the scene's end.

        Returns how many were made in this attempt.
        """
        until, made = perf_counter() + seconds, 0
        while made < steps and self.status != "failed":
            before, number = self.status, self.simulation.step_number
            due = min(steps - made, self.spacing - number % self.spacing)
            self.advance(max(until - perf_counter(), 0.0), due)
            made += max(self.simulation.step_number - number, 0)
            if self.status == "restarted":
                self._begin_memory()
            self._remember()
            if self.status == "finished" != before:
                self.seen = self.time
            if self.status not in ("running", before) or perf_counter() >= until:
                break
        self.seen = max(self.seen, self.time)
        return made

    def return_to(self, moment: Moment) -> bool:
        """Go back to a remembered moment, bitwise as it was, and forget what came after it.

        Returns False, with nothing done, where the mouse had pulled before: that cannot be made again.
        """
        if self.pulled_from < moment.step:
            return False
        self.moments = [one for one in self.moments if one.step <= moment.step]
        exact = next(one for one in reversed(self.moments) if one.exact)
        assert exact.exact
        self.back_to(exact.exact, exact.row)
        while self.simulation.step_number < moment.step:
            self.advance(steps=moment.step - self.simulation.step_number)
        self.seen = self.time
        return True


class Timeline:
    """The stretches since the last start, one after the other, and what of them is looked at.

    Attributes:
        stretches: from the first that is remembered to the one that moves.
        moment: what there is to see.
    """

    def __init__(self, first: Stretch) -> None:
        self.stretches = [first]
        self.look()

    @property
    def last(self) -> Stretch:
        """The one that moves."""
        return self.stretches[-1]

    @property
    def past(self) -> bool:
        """Whether the moment that is seen is not the present."""
        return self._at is not None

    @property
    def known(self) -> list[Moment]:
        """All that is remembered."""
        return [moment for stretch in self.stretches for moment in stretch.moments]

    def of_hit(self, hit: int) -> list[Stretch]:
        """The stretches of one hit."""
        return [one for one in self.stretches if one.hit == hit]

    def append(self, stretch: Stretch) -> None:
        """Go on with another one; what is too long ago is forgotten."""
        self.stretches.append(stretch)
        each = (16 + 64 / EXACT) * len(stretch.scenario.lattice.positions)
        while len(self.stretches) > STRETCHES or each * sum(len(one.moments) for one in self.stretches[:-1]) > BYTES:
            del self.stretches[0]
        self.look()

    def look(self) -> None:
        """See the present."""
        self._at: int | None = None
        self.moment = self.last.present

    def look_at(self, t: float) -> None:
        """See the state that is remembered nearest to the time `t` [R/c]."""
        known = self.known
        self._see(known, int(np.abs(np.array([one.t for one in known]) - t).argmin()))

    def look_beside(self, count: int) -> bool:
        """See the state `count` places later, or earlier if negative. Returns False at the end of what is known."""
        known, at = self.known, self._at
        if at is None:  # the present is the last state, or lies behind it
            at = len(known) - (known[-1].t >= self.moment.t)
        if at + count >= len(known):
            self.look()
            return False
        self._see(known, max(at + count, 0))
        return True

    def _see(self, known: list[Moment], at: int) -> None:
        moment = known[at]
        if moment.t >= self.last.now:
            self.look()
        else:
            self._at = at
            self.moment = replace(moment, x=moment.x.astype(float), v=moment.v.astype(float))

    def cut(self) -> bool:
        """Make what is seen the present: all after it is forgotten.

        Returns False where it cannot be computed again, because the mouse had a part in it: then the last stretch has
        still to be followed by one that begins with what is seen.
        """
        moment = self.moment
        if not self.past:
            return True
        del self.stretches[self.stretches.index(moment.stretch) + 1 :]
        if not moment.stretch.return_to(moment):
            return False
        self.look()
        return True
