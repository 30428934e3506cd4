"""Choose integrator and step before a run, and a shorter step if a run proves this one too long.

| reason to shorten | by how much | at most |
|---|---|---|
| the run blew up | by half, or to what the measured force of the wall asks | 5 times |
| the step exceeds 0.95 of the limit with the measured force | to what 1.5 times that force asks | 8 runs in all |
| the energy imbalance exceeds 2e-5 at the end or 1e-4 ever | as order 2 asks, by 4 at most | while each run halves it |
| the estimated error exceeds `time.tolerance` | as the order asks, by 1.15 to 3 | 12 times: `error_estimate` |
"""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, sqrt
from typing import Any

from taichi_disk.computation.diagnostics import MAX_CLOSING, MAX_WORST, relative_imbalance
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, reset_step, step_limit
from taichi_disk.errors import InputError
from taichi_disk.integrators import AUTOMATIC, INTEGRATORS, Integrator
from taichi_disk.simulation.observables import Columns

LIMIT_MARGIN = 0.95  # of the limit that the measured force of the wall leaves: a longer automatic step is made again
FORCE_SAFETY = 1.5  # over the measured force of the wall: the next step is chosen for this one
ATTEMPTS = 8  # runs in all
BLOW_UPS = 5  # after which no shorter step is tried: where a wall is dented none helps
RESET_ERROR = 2e-5  # of e, that resets may cause at an automatic step beside dashpots


@dataclass(frozen=True)
class TimeStep:
    """How time advances: `limit` is the stability limit of `integrator` [R/c], `dt` the step taken [R/c]."""

    integrator: Integrator
    limit: float
    dt: float


class StepControl:
    """The time step of one scenario, made shorter as its runs prove that necessary.

    `integrator: auto` takes the highest order that the forces allow: order 4 gives an undamped impact a hundredth of
    the error for 1.15 times the forces. Dashpots are solved for if that reaches the end with less work. A reset
    boundary shortens the step until a whole number of steps fits the interval.

    Args:
        time: the scene's section `time`.
        spectrum: of the scenario's lattice and model.

    Attributes:
        step: to be taken in the present attempt.
        attempt: how often a step has been chosen.

    Raises InputError for a `dt` beyond the stability limit, unless `force`.
    """

    def __init__(self, scenario: Scenario, time: Any, spectrum: Spectrum, force: bool = False) -> None:
        self.scenario, self.time, self.spectrum, self.attempt = scenario, time, spectrum, 1
        self._safety, self._point_force = time.safety, scenario.point_force
        self._excess, self._blow_ups = inf, 0
        self.step = self._choice()
        if time.dt != "auto" and time.dt > self.step.limit and not force:
            limit, name = self.step.limit, self.step.integrator.name
            raise InputError(
                f"time.dt: {time.dt:g} R/c is beyond the stability limit of {name}, {limit:.6g} R/c for this scene; "
                f"write a smaller one (or auto: {time.safety * limit:.6g}), or see it blow up with `run --force`"
            )

    def limit(self, integrator: Integrator, force: float) -> float:
        """Of stable steps [R/c], with `force`, the wall's largest on a point [M c^2/R]."""
        return step_limit(self.spectrum, self.scenario.model, integrator, force)

    def _choice(self) -> TimeStep:
        name, model = self.time.integrator, self.scenario.model
        if name == "auto":
            candidates = [one for one in AUTOMATIC if one.takes(model)]
            name = min(
                candidates, key=lambda one: (-one.order, one.cost(self.spectrum.points) / self._longest(one))
            ).name
        integrator = INTEGRATORS[name]
        dt = self._longest(integrator) if self.time.dt == "auto" else self.time.dt
        return TimeStep(integrator, self.limit(integrator, self._point_force), fitted(dt, model.reset_interval))

    def _longest(self, integrator: Integrator) -> float:
        """Step that is safely stable [R/c] and, unless the scene has its own, resolves what resets stir up."""
        stable = self._safety * self.limit(integrator, self._point_force)
        if self.time.dt != "auto":
            return stable
        error = RESET_ERROR if self.time.tolerance == "none" else self.time.tolerance
        return min(stable, reset_step(self.spectrum, self.scenario.model, integrator, error))

    # ---- the next run

    def shorten_after_blow_up(self, peak: float) -> bool:
        """Choose a shorter step after a blow-up; False where that would not help.

        `peak` is the largest measured force of the wall on one point [M c^2/R].
        """
        self._blow_ups += 1
        if self._last or self._blow_ups > BLOW_UPS:
            return False
        return self._shorten_for(peak) or self._shorten(0.5)

    def shorten_after_run(self, peak: float, columns: Columns) -> bool:
        """Choose a shorter step after a run to the end, which gave `columns`; False where the step may stand.

        Ordinary scenes need none. Hard walls (a from 1,000 on) often do, two or three runs: how a point rattles between
        disk and wall is not foreseen.
        """
        if self._last:
            return False
        if self._shorten_for(peak):
            return True
        closing, worst = relative_imbalance(self.scenario, columns)
        excess = self.scenario.sensitivity * max(abs(closing) / MAX_CLOSING, worst / MAX_WORST)
        # Where a shorter step does not help, it is not the step that is at fault.
        if excess <= 1.0 or excess > 0.5 * self._excess:
            return False
        self._excess = excess
        return self._shorten(max(0.25, 0.9 / sqrt(excess)))  # order 2: the error falls with the square

    @property
    def _last(self) -> bool:
        """Whether no other step is to be tried."""
        return self.time.dt != "auto" or self.attempt >= ATTEMPTS

    def _shorten_for(self, peak: float) -> bool:
        """Choose a step for a harder wall if this one is too near to the limit that the force `peak` leaves."""
        if self.step.dt <= max(LIMIT_MARGIN, self._safety) * self.limit(self.step.integrator, peak):
            return False
        self._point_force = FORCE_SAFETY * peak
        return self._shorten(1.0)

    def _shorten(self, part: float) -> bool:
        if part < 1.0:  # of the step taken, which a reset boundary may have made shorter than was asked for
            self._safety = part * self.step.dt / self.step.limit
        self.step, self.attempt = self._choice(), self.attempt + 1
        return True


def fitted(dt: float, interval: float) -> float:
    """The longest step up to `dt` of which a whole number fits `interval` [R/c]; `dt` where that is 0."""
    # Less a little, or a whole part of the interval that was rounded down would give the next one.
    return interval / ceil((1.0 - 1e-9) * interval / dt) if interval else dt
