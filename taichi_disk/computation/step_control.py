"""Choosing integrator and step, choosing again where wall, energy or a tolerance prove the step too long; the error."""

from __future__ import annotations

from dataclasses import dataclass
from math import ceil, inf, sqrt
from typing import Any

from taichi_disk.computation.diagnostics import CLOSING, LARGEST, WORST, relative_imbalance, unacceptable
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, resolving_step, step_limit
from taichi_disk.errors import InputError
from taichi_disk.integrators import AUTOMATIC, INTEGRATORS, Integrator
from taichi_disk.simulation.observables import Columns

MARGIN = 0.95  # of the limit that the measured wall stiffness leaves; an automatic step above it is redone
HARDER = 1.5  # than measured: the force of the wall that the next step is chosen for
ATTEMPTS, SEARCH = 8, 12  # runs in all; in search of a tolerance, which may be far from a first coarse step
BLOW_UPS = 5  # after which no shorter step is tried: where a wall is dented none helps
AIM = 0.75  # of the tolerance, at which a step is aimed
RESET_ERROR = 2e-5  # of e, that resets may cause at an automatic step beside dashpots
LEAST, MOST = 1.15, 3.0  # by which a step is shortened for it: a longer leap would trust the power too far

# Of estimated errors; measured on scenes whose truth is known: `python -m tests.validation.estimate_trial`.
COMPARED = 1.25  # by which the step of a second run is shorter
COARSE, FROM = 0.95, 0.75  # of the stability limit, a longer one; the part that the step itself has to be for that
CAUTION = 1.5  # by which the difference is enlarged
UNRESOLVED_PART = 0.5  # of the worst imbalance, which the error may be where a step does not resolve the wall


@dataclass(frozen=True)
class TimeStep:
    """How time advances: `limit` is the stability limit of `integrator` [R/c], `dt` the step taken [R/c]."""

    integrator: Integrator
    limit: float
    dt: float


@dataclass(frozen=True)
class RunRecord:
    """One run: integrator and step [R/c], primary result, worst energy imbalance over the energy scale.

    `coarseness`: the step over the longest one that resolves the wall; `jumps`: whether the contact's force jumped, as
    where points slide from spring to spring of the elastic wall.
    """

    integrator: Integrator
    dt: float
    result: float
    imbalance: float = 0.0
    coarseness: float = 0.0
    jumps: bool = False


def error_estimate(other: RunRecord, run: RunRecord) -> float:
    """Estimated error of `run`, from another run of the same integrator with a longer or shorter step.

    With e(h) = e + C h^p two runs give e by Richardson's extrapolation, and with it the error of each. Two results
    cannot tell whether e(h) is that power, so more is taken for the error. While a step crosses much of the wall's
    decay length 1/a at the speed of the impact, the error stands at a plateau that differences do not show. There it is
    not taken for less than a part of the worst energy imbalance. Where the force jumps, errors fall with h itself.
    """
    growth = (other.dt / run.dt) ** (1 if run.jumps or other.jumps else run.integrator.order)
    extrapolated = run.result + (run.result - other.result) / (growth - 1.0)
    unresolved = UNRESOLVED_PART * run.imbalance if run.coarseness > 1.0 else 0.0
    return max(CAUTION * abs(run.result - extrapolated), unresolved)


class StepControl:
    """The time step of one scenario, made shorter as its runs prove that necessary.

    `integrator: auto` takes the dashpots implicitly where that reaches the end with less work. A reset boundary
    shortens the step until a whole number of steps fits the interval.

    Args:
        time: the scene's section `time`.
        spectrum: of the scenario's lattice and model.

    Attributes:
        step: to be taken in the present attempt.
        attempt: how often a step has been chosen.
        records: the runs so far, where there is a tolerance.

    Raises InputError for a `dt` beyond the stability limit, unless `force`.
    """

    def __init__(self, scenario: Scenario, time: Any, spectrum: Spectrum, force: bool = False) -> None:
        self.scenario, self.time, self.spectrum, self.attempt = scenario, time, spectrum, 1
        self.records: list[RunRecord] = []
        self._integrator, self._safety, self._point_force = time.integrator, time.safety, scenario.point_force
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
        name, model = self._integrator, self.scenario.model
        if name == "auto":
            candidates = [one for one in AUTOMATIC if one.takes(model)]
            name = min(candidates, key=lambda one: one.cost(self.spectrum.points) / self._longest(one)).name
        integrator = INTEGRATORS[name]
        dt = self._longest(integrator) if self.time.dt == "auto" else self.time.dt
        return TimeStep(integrator, self.limit(integrator, self._point_force), fitted(dt, model.reset_interval))

    def _longest(self, integrator: Integrator) -> float:
        """Step that is safely stable [R/c] and, unless the scene has its own, resolves what resets stir up."""
        stable = self._safety * self.limit(integrator, self._point_force)
        if self.time.dt != "auto":
            return stable
        error = RESET_ERROR if self.time.tolerance == "none" else self.time.tolerance
        return min(stable, resolving_step(self.spectrum, self.scenario.model, integrator, error))

    # ---- errors

    def other_step(self, limit: float) -> float:
        """Step [R/c] of a second run to estimate the error with: a longer one, which costs less, where that is stable.

        `limit`: of stable steps, with the force of the wall that was measured.
        """
        dt, interval = self.step.dt, self.scenario.model.reset_interval
        longer = fitted(COARSE * limit, interval)
        return longer if dt > FROM * limit and longer > dt else fitted(dt / COMPARED, interval)

    def record(self, columns: Columns) -> RunRecord:
        """What the next steps are chosen from: a run with the present step."""
        step, result = self.step, self.scenario.primary(columns)[1]
        _, worst = relative_imbalance(self.scenario, columns)
        worst *= self.scenario.sensitivity
        coarseness, jumps = step.dt / self.scenario.resolving_step, bool(columns["sliding"].any())
        return RunRecord(step.integrator, step.dt, result, worst, coarseness, jumps)

    def error(self, columns: Columns) -> float | None:
        """The estimated error of the last primary result; None after a single run."""
        left = self.scenario.end_truncation_error(columns)
        if not self.scenario.step_dependent:
            return left
        return error_estimate(*self.records[-2:]) + left if len(self.records) > 1 else None

    def out_of_tolerance(self, columns: Columns) -> str | None:
        """Why the last run, which gave `columns`, is not known to be within the tolerance; None where it is."""
        tolerance, error = self.time.tolerance, self.error(columns)
        if tolerance == "none" or (error is not None and error <= tolerance):
            return None
        found = "cannot be estimated" if error is None else f"is estimated at {error:.3g}"
        text = f"time.tolerance is {tolerance:g}, and the error of the result after {self.attempt} runs {found}"
        left = self.scenario.end_truncation_error(columns)
        if left > 0.5 * tolerance:
            text += f": {left:.2g} of it is due to where the run ends, at any step; {self.scenario.truncation_remedy}"
        else:
            text += "; write a smaller time.safety, or another time.integrator"
        return f"{text}; or write a larger time.tolerance, or none"

    # ---- the next run

    def shorten_after_blow_up(self, peak: float) -> bool:
        """Choose a shorter step after a blow-up; False where that would not help.

        `peak` is the largest measured force of the wall on one point [M c^2/R].
        """
        self._blow_ups += 1
        self.records.clear()  # the next step may be of another integrator
        if self._last or self._blow_ups > BLOW_UPS:
            return False
        if self._beyond(peak):
            return self._again(force=HARDER * peak)
        return self._again(0.5 * self._taken)

    def shorten_after_run(self, peak: float, columns: Columns) -> bool:
        """Choose a shorter step after a run to the end, which gave `columns`; False where the step may stand.

        Ordinary scenes need none. Hard walls (a from 1,000 on) often do, two or three runs: how a point rattles between
        disk and wall is not foreseen.
        """
        if self.time.tolerance != "none":
            self.records.append(self.record(columns))
        if self._last:
            return False
        if self.time.tolerance != "none":
            return self._approach(peak, columns)
        if self._beyond(peak):
            return self._again(force=HARDER * peak)
        closing, worst = relative_imbalance(self.scenario, columns)
        excess = self.scenario.sensitivity * max(abs(closing) / CLOSING, worst / WORST)
        # Where a shorter step does not help, it is not the step that is at fault.
        if excess <= 1.0 or excess > 0.5 * self._excess:
            return False
        self._excess = excess
        return self._again(max(0.25, 0.9 / sqrt(excess)) * self._taken)  # order 2: the error falls with the square

    @property
    def _last(self) -> bool:
        """Whether no other step is to be tried."""
        return self.time.dt != "auto" or self.attempt >= (ATTEMPTS if self.time.tolerance == "none" else SEARCH)

    @property
    def _taken(self) -> float:
        """Part of the limit that was taken, which a reset boundary may have made less than was asked for."""
        return self.step.dt / self.step.limit

    def _beyond(self, peak: float) -> bool:
        """Whether the step is too near to the limit that the force of the wall leaves."""
        return self.step.dt > max(MARGIN, self._safety) * self.limit(self.step.integrator, peak)

    def _again(self, safety: float | None = None, force: float | None = None) -> bool:
        self._safety, self._point_force = safety or self._safety, force or self._point_force
        self.step, self.attempt = self._choice(), self.attempt + 1
        return True

    def _approach(self, peak: float, columns: Columns) -> bool:
        """Choose what brings the result within the tolerance; False where it is, or where no step can.

        A first run beyond the measured stability limit still serves to compare with, the last must be within it.
        """
        scenario, step, tolerance = self.scenario, self.step, self.time.tolerance
        error, left = self.error(columns), scenario.end_truncation_error(columns)
        allowed = tolerance - left
        stands = not (self.out_of_tolerance(columns) or self._beyond(peak) or unacceptable(scenario, columns))
        if stands or allowed <= 0.0:
            return False
        shorter = COMPARED
        if error is not None:
            shorter = min(((error - left) / (AIM * allowed)) ** (1.0 / step.integrator.order), MOST)
        excess = abs(relative_imbalance(scenario, columns)[0]) / max(LARGEST, tolerance)
        least = max(LEAST, sqrt(excess), step.dt / (MARGIN * self.limit(step.integrator, peak)))
        return self._again(step.dt / max(shorter, least) / self.limit(step.integrator, self._point_force))


def fitted(dt: float, interval: float) -> float:
    """The longest step up to `dt` of which a whole number fits `interval` [R/c]; `dt` where that is 0."""
    # Less a little, or a whole part of the interval that was rounded down would give the next one.
    return interval / ceil((1.0 - 1e-9) * interval / dt) if interval else dt
