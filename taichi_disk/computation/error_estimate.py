"""The error of a result that its time step causes, from a second run; and the search for a step within a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_disk.computation.diagnostics import greatest_compression, relative_imbalance
from taichi_disk.computation.driver import Driver
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.step_control import fitted
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.lattice import Array

# Measured on scenes whose truth is known: `python -m tests.validation.estimate_trial`.
STEP_RATIO = 1.25  # by which the step of a second run is shorter
LONGER_STEP, LONGER_FROM = 0.95, 0.75  # of the stability limit: a longer one instead, if the step itself is above that
ERROR_SAFETY = 1.5  # over the difference that Richardson's extrapolation finds
UNRESOLVED_PART = 0.5  # of the worst imbalance, which the error may be where a step does not resolve the wall

SEARCH = 12  # steps tried for a tolerance, which may be far from a first coarse step
TOLERANCE_PART = 0.75  # of the tolerance, at which the next step is aimed
LEAST_RATIO, MOST_RATIO = 1.15, 3.0  # by which that step is shorter: a longer leap would trust the power too far


@dataclass(frozen=True)
class SecondRun:
    """The error of a primary result by a second run, None if that has no result; (n, 2) its most compressed state."""

    error: float | None
    compressed: Array


def richardson(result: float, dt: float, other_result: float, other_dt: float, order: int) -> float:
    """Return the error of `result` at the step `dt`, if errors are C dt^order, from another run."""
    return abs(result - other_result) / abs((other_dt / dt) ** order - 1.0)


def second_run(driver: Driver) -> SecondRun:
    """Run the finished scene of `driver` again with another step.

    Two results cannot tell whether the error is a power of the step, so it is taken as larger. While a step crosses
    much of the wall's decay length 1/a at the speed of the impact, the error stands at a plateau that differences do
    not show. There it is not taken for less than a part of the worst energy imbalance.
    """
    scenario, columns, step = driver.scenario, driver.columns, driver.step
    time = replace(driver.control.time, dt=_other_step(driver), integrator=step.integrator.name)
    other = Driver(scenario, time, driver.kernels, driver.control.spectrum, force=True)
    other.advance(steps=round(greatest_compression(columns) / other.step.dt))
    x = other.state.vectors[0]
    try:
        if other.advance() == "failed":
            return SecondRun(None, x)
        results = scenario.primary(columns)[1], step.dt, scenario.primary(other.columns)[1], other.step.dt
    except TaichiDiskError:  # no result
        return SecondRun(None, x)
    error = ERROR_SAFETY * richardson(*results, _order(driver))
    if step.dt > scenario.wall_step:
        error = max(error, UNRESOLVED_PART * scenario.sensitivity * relative_imbalance(scenario, columns)[1])
    return SecondRun(error + scenario.end_truncation_error(columns), x)


def _other_step(driver: Driver) -> float:
    """Step [R/c] of the second run: a longer one, which costs less, where that is stable."""
    step, interval = driver.step, driver.scenario.model.reset_interval
    limit = driver.control.limit(step.integrator, driver.largest_force)
    longer = fitted(LONGER_STEP * limit, interval)
    return longer if step.dt > LONGER_FROM * limit and longer > step.dt else fitted(step.dt / STEP_RATIO, interval)


def _order(driver: Driver) -> int:
    """Order of the error. Where points slide from spring to spring of the elastic wall, its force jumps: 1."""
    return 1 if driver.columns["sliding"].any() else driver.step.integrator.order


def within_tolerance(driver: Driver, run: Callable[[Any], Driver]) -> tuple[Driver, SecondRun]:
    """Shorten the step of the finished `driver` until the estimated error of its result is within `time.tolerance`.

    `run` runs the scene to its end with a section `time`. Raises SimulationError if no step is found.
    """
    scenario, time = driver.scenario, driver.control.time
    for tried in range(1, SEARCH + 1):
        second, left = second_run(driver), scenario.end_truncation_error(driver.columns)
        allowed = time.tolerance - left
        if second.error is not None and second.error <= time.tolerance:
            return driver, second
        if allowed <= 0.0 or tried == SEARCH:
            break
        ratio = STEP_RATIO
        if second.error is not None:
            excess = (second.error - left) / (TOLERANCE_PART * allowed)
            ratio = float(np.clip(excess ** (1.0 / _order(driver)), LEAST_RATIO, MOST_RATIO))
        runs, step = driver.attempt, driver.step
        shorter = fitted(step.dt / ratio, scenario.model.reset_interval)
        driver = run(replace(time, dt=shorter, integrator=step.integrator.name))
        driver.attempt += runs
    raise SimulationError(_out_of_tolerance(scenario, time.tolerance, driver, second.error, left))


def _out_of_tolerance(scenario: Scenario, tolerance: float, driver: Driver, error: float | None, left: float) -> str:
    found = "cannot be estimated" if error is None else f"is estimated at {error:.3g}"
    text = f"time.tolerance is {tolerance:g}, and the error of the result after {driver.attempt} runs {found}"
    if left > 0.5 * tolerance:
        text += f": {left:.2g} of it is due to where the run ends, at any step; {scenario.truncation_remedy}"
    else:
        text += "; write a smaller time.safety, or another time.integrator"
    return f"{text}; or write a larger time.tolerance, or none"
