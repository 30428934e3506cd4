"""Choose integrator and step before a run, and a shorter step if a run shows that the
step was too long.

The step is shortened for one of these reasons:

* The run blew up: to a half, or to the step that the measured force of the wall
  requires. At most 5 times.
* The step exceeds 0.95 of the limit with the measured force: to the step that 1.5 times
  that force requires. At most 8 runs.
* The energy imbalance exceeds 2e-5 at the end or 1e-4 ever: as order 2 requires, by up
  to 4. As long as each run halves the imbalance.
* The estimated error exceeds `time.tolerance`: as the order requires, by 1.15 to 3. At
  most 12 times; see `error_estimate`.
"""

from __future__ import annotations

from functools import partial
from math import ceil, inf, sqrt

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.computation.diagnostics import (
    MAX_CLOSING,
    MAX_WORST,
    BlowUp,
    relative_imbalance,
)
from taichi_disk.experiments.computation.driver import Driver
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.computation.stability import (
    Spectrum,
    TimeStep,
    reset_step,
    step_limit,
)
from taichi_disk.mechanics.integrators import INTEGRATORS, Integrator
from taichi_disk.mechanics.simulation.observables import Columns
from taichi_disk.mechanics.simulation.simulation import MAX_STEPS

# largest automatic step, as a fraction of the stability limit with the measured wall
# force
LIMIT_MARGIN = 0.95
# ratio of the force for which the next step is chosen to the measured force of the wall
FORCE_SAFETY = 1.5
MAX_ATTEMPTS = 8
MAX_BLOW_UPS = 5  # a disk that has dented the wall blows up at any step
# error of e that resets combined with dashpots may cause at an automatic step
RESET_ERROR = 2e-5


class StepControl:
    """Chooses the time steps of a scenario's runs. The first step follows from
    stability, each later one from the run before it.

    `integrator: auto` takes the highest order that the forces allow: in an undamped
    impact, order 4 has a hundredth of the error for 1.15 times the force evaluations.
    Dashpots are implicit if that is less work in all. With a reset boundary, the step
    divides the time between two resets into whole steps.

    `spectrum`: of the scenario's lattice and model. Raises InputError if the user's
    step is beyond the stability limit (unless `force` is set), or if the run would need
    more than MAX_STEPS steps.

    Attributes:
        step: for the next run.
        attempt: number of this run, from 1.
    """

    def __init__(
        self, scenario: Scenario, spectrum: Spectrum, force: bool = False
    ) -> None:
        self.scenario = scenario
        self.spectrum = spectrum
        self.attempt = 1
        self._time = scenario.scene.time
        self._safety = self._time.safety
        self._point_force = scenario.point_force
        self._previous_excess = inf
        self._blow_ups = 0
        self.step = self._choice()
        if self._time.dt != "auto":
            self._check_own_step(force)

    def _check_own_step(self, force: bool) -> None:
        dt = self._time.dt
        name = self.step.integrator.name
        limit = self.step.limit
        if dt > limit and not force:
            automatic = self._safety * limit
            raise InputError(
                f"time.dt: {dt:g} R/c is beyond the stability limit of {name},"
                f" {limit:.6g} R/c for this scene; write a smaller one (or auto:"
                f" {automatic:.6g}), or accept a blow-up with `run --force`"
            )
        max_time = self.scenario.max_time
        shortest = max_time / MAX_STEPS
        if dt < shortest:
            raise InputError(
                f"time.dt: {dt:g} R/c would need {max_time / dt:.2g} steps until the"
                f" time limit of {max_time:.6g} R/c, and at most {MAX_STEPS:,} can be"
                f" counted; write auto, or at least {1.001 * shortest:.4g}"
            )

    def limit(self, integrator: Integrator) -> float:
        """Return the largest stable step [R/c] with the force that is expected."""
        return step_limit(
            self.spectrum, self.scenario.model, integrator, self._point_force
        )

    def _choice(self) -> TimeStep:
        model = self.scenario.model
        candidates = [one for one in INTEGRATORS.values() if one.takes(model)]
        if self._time.integrator != "auto":
            candidates = [INTEGRATORS[self._time.integrator]]
        integrator = min(
            candidates,
            key=lambda one: (
                -one.order,
                one.cost(self.spectrum.points) / self._longest(one),
            ),
        )
        dt = self._time.dt
        if dt == "auto":
            dt = self._longest(integrator)
        return TimeStep(
            integrator=integrator,
            dt=fitted(dt, model.reset_interval),
            limit=self.limit(integrator),
            limit_under=partial(step_limit, self.spectrum, model, integrator),
        )

    def _longest(self, integrator: Integrator) -> float:
        """Return the largest step [R/c] within the safety margin; an automatic step
        also resolves resets."""
        stable = self._safety * self.limit(integrator)
        if self._time.dt != "auto":
            return stable
        error = RESET_ERROR
        if self._time.tolerance != "none":
            error = self._time.tolerance
        resolving = reset_step(self.spectrum, self.scenario.model, integrator, error)
        return min(stable, resolving)

    # ---- the next run

    def shortens(self, driver: Driver) -> bool:
        """Choose a shorter step if the run of `driver`, which has finished or failed,
        shows that it was too long. Return whether there is one."""
        if self._time.dt != "auto" or self.attempt >= MAX_ATTEMPTS:
            return False
        if driver.has_ended:
            return self._shorten_after_end(driver.largest_force, driver.columns)
        if isinstance(driver.failure, BlowUp):
            return self._shorten_after_blow_up(driver.largest_force)
        return False

    def _shorten_after_blow_up(self, largest_force: float) -> bool:
        self._blow_ups += 1
        if self._blow_ups > MAX_BLOW_UPS:
            return False
        return self._shorten_for(largest_force) or self._shorten(0.5)

    def _shorten_after_end(self, largest_force: float, columns: Columns) -> bool:
        # Ordinary scenes keep their step. Hard walls (a from 1,000 on) often need two
        # or three runs, because it cannot be predicted how points rattle between disk
        # and wall.
        if self._shorten_for(largest_force):
            return True
        excess = self._energy_excess(columns)
        if excess <= 1.0:
            return False
        # If the shorter step has not halved the excess, the step is not the cause.
        if excess > 0.5 * self._previous_excess:
            return False
        self._previous_excess = excess
        # order 2: the error falls with the square of the step
        return self._shorten(max(0.25, 0.9 / sqrt(excess)))

    def _energy_excess(self, columns: Columns) -> float:
        """Return the energy imbalance of a run over the one that is allowed."""
        closing, worst = relative_imbalance(self.scenario, columns)
        largest = max(abs(closing) / MAX_CLOSING, worst / MAX_WORST)
        return self.scenario.sensitivity * largest

    def _shorten_for(self, largest_force: float) -> bool:
        margin = max(LIMIT_MARGIN, self._safety)
        if self.step.dt <= margin * self.step.limit_under(largest_force):
            return False
        self._point_force = FORCE_SAFETY * largest_force
        return self._shorten(1.0)

    def _shorten(self, part: float) -> bool:
        # `part` refers to the actual step, which a reset boundary may have shortened
        if part < 1.0:
            self._safety = part * self.step.dt / self.step.limit
        self.step = self._choice()
        self.attempt += 1
        return True


def fitted(dt: float, interval: float) -> float:
    """Return the longest step up to `dt` that divides `interval` [R/c] into whole
    steps, or `dt` if `interval` is 0."""
    if not interval:
        return dt
    # The factor prevents an additional step if dt is a rounded-down whole fraction of
    # the interval.
    return interval / ceil((1.0 - 1e-9) * interval / dt)
