"""Choose integrator and step before a run, and a shorter step if a run shows that the
step was too long.

| reason to shorten | by how much | at most |
|---|---|---|
| the run blew up | to a half, or to the step that the measured force of the wall
requires | 5 times |
| the step exceeds 0.95 of the limit with the measured force | to the step that 1.5
times that force requires | 8 runs | | the energy imbalance exceeds 2e-5 at the end or
1e-4 ever | as order 2 requires, by up to 4 | if each run halves it | | the estimated
error exceeds `time.tolerance` | as the order requires, by 1.15 to 3 | 12 times:
`error_estimate` |
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, sqrt
from typing import Any

from taichi_disk.computation.diagnostics import (
    MAX_CLOSING,
    MAX_WORST,
    relative_imbalance,
)
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, reset_step, step_limit
from taichi_disk.errors import InputError
from taichi_disk.integrators import AUTOMATIC, INTEGRATORS, Integrator
from taichi_disk.simulation.observables import Columns

# largest automatic step, as a fraction of the stability limit with the measured wall
# force
LIMIT_MARGIN = 0.95
# ratio of the force for which the next step is chosen to the measured force of the wall
FORCE_SAFETY = 1.5
MAX_ATTEMPTS = 8
MAX_BLOW_UPS = 5  # a disk that has dented the wall blows up at any step
# error of e that resets combined with dashpots may cause at an automatic step
RESET_ERROR = 2e-5


@dataclass(frozen=True)
class TimeStep:
    """An integrator with its stability limit [R/c] and the chosen step `dt` [R/c]."""

    integrator: Integrator
    limit: float
    dt: float


class StepControl:
    """The time step of one scenario, which is shortened if a run shows that it is too
    long.

    `integrator: auto` takes the highest order that the forces allow: in an undamped
    impact, order 4 has a hundredth of the error for 1.15 times the force evaluations.
    Dashpots are implicit if that is less work in all. With a reset boundary, a whole
    number of steps fits the interval.

    `time`: the scene's section `time`; `spectrum`: of the scenario's lattice and model;
    `attempt`: number of this run, from 1. Raises InputError for a `dt` beyond the
    stability limit, unless `force`.
    """

    def __init__(
        self, scenario: Scenario, time: Any, spectrum: Spectrum, force: bool = False
    ) -> None:
        self.scenario, self.time, self.spectrum, self.attempt = (
            scenario,
            time,
            spectrum,
            1,
        )
        self._safety, self._point_force = time.safety, scenario.point_force
        self._excess, self._blow_ups = inf, 0
        self.step = self._choice()
        if time.dt != "auto" and time.dt > self.step.limit and not force:
            limit, name = self.step.limit, self.step.integrator.name
            raise InputError(
                f"time.dt: {time.dt:g} R/c is beyond the stability limit of {name},"
                f" {limit:.6g} R/c for this scene; write a smaller one (or auto:"
                f" {time.safety * limit:.6g}), or accept a blow-up with `run --force`"
            )

    def limit(self, integrator: Integrator, force: float) -> float:
        return step_limit(self.spectrum, self.scenario.model, integrator, force)

    def _choice(self) -> TimeStep:
        model, points = self.scenario.model, self.spectrum.points
        candidates = [one for one in AUTOMATIC if one.takes(model)]
        if self.time.integrator != "auto":
            candidates = [INTEGRATORS[self.time.integrator]]
        integrator = min(
            candidates,
            key=lambda one: (-one.order, one.cost(points) / self._longest(one)),
        )
        dt = self._longest(integrator) if self.time.dt == "auto" else self.time.dt
        return TimeStep(
            integrator,
            self.limit(integrator, self._point_force),
            fitted(dt, model.reset_interval),
        )

    def _longest(self, integrator: Integrator) -> float:
        """Return the largest step [R/c] within the safety margin; an automatic step
        also resolves resets."""
        stable = self._safety * self.limit(integrator, self._point_force)
        if self.time.dt != "auto":
            return stable
        error = RESET_ERROR if self.time.tolerance == "none" else self.time.tolerance
        return min(
            stable, reset_step(self.spectrum, self.scenario.model, integrator, error)
        )

    # ---- the next run

    def shorten_after_blow_up(self, largest_force: float) -> bool:
        """Choose a shorter step after a blow-up, and return False if that would not
        help."""
        self._blow_ups += 1
        if self._last or self._blow_ups > MAX_BLOW_UPS:
            return False
        return self._shorten_for(largest_force) or self._shorten(0.5)

    def shorten_after_run(self, largest_force: float, columns: Columns) -> bool:
        """Choose a shorter step after a finished run with the series `columns` and
        return True, or return False."""
        # Ordinary scenes keep their step. Hard walls (a from 1,000 on) often need two
        # or three runs, because it cannot be predicted how points rattle between disk
        # and wall.
        if self._last:
            return False
        if self._shorten_for(largest_force):
            return True
        closing, worst = relative_imbalance(self.scenario, columns)
        excess = self.scenario.sensitivity * max(
            abs(closing) / MAX_CLOSING, worst / MAX_WORST
        )
        # If a shorter step does not help, the step is not the cause.
        if excess <= 1.0 or excess > 0.5 * self._excess:
            return False
        self._excess = excess
        # order 2: the error falls with the square of the step
        return self._shorten(max(0.25, 0.9 / sqrt(excess)))

    @property
    def _last(self) -> bool:
        return self.time.dt != "auto" or self.attempt >= MAX_ATTEMPTS

    def _shorten_for(self, largest_force: float) -> bool:
        if self.step.dt <= max(LIMIT_MARGIN, self._safety) * self.limit(
            self.step.integrator, largest_force
        ):
            return False
        self._point_force = FORCE_SAFETY * largest_force
        return self._shorten(1.0)

    def _shorten(self, part: float) -> bool:
        # `part` refers to the actual step, which a reset boundary may have shortened
        if part < 1.0:
            self._safety = part * self.step.dt / self.step.limit
        self.step, self.attempt = self._choice(), self.attempt + 1
        return True


def fitted(dt: float, interval: float) -> float:
    """Return the longest step up to `dt` that divides `interval` [R/c] into whole
    steps, or `dt` if `interval` is 0."""
    # The factor prevents an additional step if dt is a rounded-down whole fraction of
    # the interval.
    return interval / ceil((1.0 - 1e-9) * interval / dt) if interval else dt
