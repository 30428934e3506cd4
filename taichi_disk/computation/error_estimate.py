"""Estimate the errors due to the time step from a second run, and search for a step
within a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.diagnostics import relative_imbalance
from taichi_disk.computation.driver import Driver
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import TimeStep
from taichi_disk.computation.step_control import fitted
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.lattice import Array
from taichi_disk.simulation.observables import Columns

# The constants were measured on scenes with a known result: `python -m
# tests.validation.estimate_trial`.
STEP_RATIO = 1.25  # ratio of a run's step to the shorter step of its second run
# the same ratios of the further runs if errors fall irregularly
HALF_STEP, QUARTER_STEP = 2.0, 4.0
# The second run has the longer step of 0.95 of the stability limit if the first has at
# least 0.75 of it.
LONGER_STEP, LONGER_FROM = 0.95, 0.75
# Ratio of the stated error to the error by Richardson's extrapolation, for each assumed
# order. Order 1 has a reserve.
ERROR_SAFETY = {1: 1.5, 2: 2.0, 4: 2.0}
# further factor for results other than the primary one, which converge less regularly
SECONDARY_SAFETY = 2.0
# smallest stated error over the worst energy imbalance, if the step does not resolve
# the wall
UNRESOLVED_PART = 0.5
ROUNDING = 1e-14  # rounding error of sums over many steps
# ratio of the step to the step that resolves the wall, from which errors fall
# irregularly
IRREGULAR_FROM = 0.51

SEARCH = 12  # number of steps tried for a tolerance
# ratio of the error that the next step should have to the tolerance
TOLERANCE_PART = 0.75
# ratio of a step to the next; a power law is not reliable beyond 3
LEAST_RATIO, MOST_RATIO = 1.15, 3.0


class SecondRun(NamedTuple):
    """Errors of results by name (empty if the second run has no result), and its most
    compressed state (n, 2)."""

    errors: dict[str, float]
    compressed: Array


def richardson(dt: float, runs: list[tuple[float, float]], order: int) -> float:
    """Return the error at the step `dt` from the steps and results of two or more
    `runs`, if errors are C dt^order.

    Each two runs give a C, and the largest counts.
    """
    pairs = combinations(runs, 2)
    return max(
        abs((one - two) / ((step / dt) ** order - (other / dt) ** order))
        for (step, one), (other, two) in pairs
    )


def second_run(driver: Driver) -> SecondRun:
    """Run the finished scene of `driver` again with another step and, if errors fall
    irregularly, with a third."""
    # Irregular errors may agree by chance, hence three runs. On the hardest walls the
    # error also stays at a plateau,
    # which differences do not show: the estimate is at least a fraction of the worst
    # imbalance.
    scenario, columns, dt = driver.scenario, driver.columns, driver.step.dt
    runs: list[tuple[float, dict[str, float]]] = []
    x = driver.start.vectors[0]
    try:
        for other_dt in _other_steps(driver):
            other = Driver(scenario, replace(driver.step, dt=other_dt), driver.kernels)
            if not runs:
                other.advance(steps=round(greatest_compression(columns) / other_dt))
                x = other.state.vectors[0]
            other.advance()
            if not other.has_ended:
                return SecondRun({}, x)
            runs.append((other_dt, scenario.result(other.columns)))
        runs.append((dt, scenario.result(columns)))
    except TaichiDiskError:  # the other step gives no result
        return SecondRun({}, x)
    least = ROUNDING
    if dt > scenario.wall_step:
        least += (
            UNRESOLVED_PART
            * scenario.sensitivity
            * relative_imbalance(scenario, columns)[1]
        )
    errors, scales, sampling = (
        {},
        scenario.result_scales(columns),
        _sampling_errors(scenario, columns),
    )
    order, primary = _order(driver), scenario.primary(columns)[0]
    for name in [
        name for name in scales if all(name in results for _, results in runs)
    ]:
        difference = richardson(
            dt, [(step, results[name]) for step, results in runs], order
        )
        safety = ERROR_SAFETY[order] * (SECONDARY_SAFETY if name != primary else 1.0)
        errors[name] = max(safety * difference, least * scales[name]) + sampling.get(
            name, 0.0
        )
    errors[primary] += scenario.end_truncation_error(columns)
    return SecondRun(errors, x)


def _sampling_errors(scenario: Scenario, columns: Columns) -> dict[str, float]:
    """Return the error of each result, such as a time, that is due to the distance
    between rows."""
    # It is the change if every other row is left out, or half of the change if two rows
    # of three are left out: either alone may agree by chance.
    found, rows = scenario.result(columns), np.arange(len(columns["t"]))
    ends = (rows == 0) | (rows == rows[-1])
    errors = dict.fromkeys(found, 0.0)
    for n, k in ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2)):
        thinned = scenario.result(
            {key: one[ends | (rows % n == k)] for key, one in columns.items()}
        )
        for name in found.keys() & thinned.keys():
            errors[name] = max(errors[name], abs(thinned[name] - found[name]) / (n - 1))
    return errors


def _is_irregular(driver: Driver) -> bool:
    """Return whether errors fall irregularly, so that results at two steps may agree by
    chance.

    They do with friction, if a step crosses much of the wall's decay length, and if
    points slide along a wall of springs. The search for a tolerance estimates the error
    of sliding points from one further run: two took minutes.
    """
    scenario = driver.scenario
    sliding = (
        driver.columns["sliding"].any() and scenario.scene.time.tolerance == "none"
    )
    return bool(
        scenario.model.has_friction
        or sliding
        or driver.step.dt > IRREGULAR_FROM * scenario.wall_step
    )


def _other_steps(driver: Driver) -> list[float]:
    """Return the steps [R/c] of the other runs: shorter ones, or a longer one, which
    costs less, if that is stable."""
    step, interval = driver.step, driver.scenario.model.reset_interval
    if _is_irregular(driver):
        return [
            fitted(step.dt / ratio, interval) for ratio in (HALF_STEP, QUARTER_STEP)
        ]
    limit = step.limit_under(driver.largest_force)
    longer = fitted(LONGER_STEP * limit, interval)
    return [
        (
            longer
            if step.dt > LONGER_FROM * limit and longer > step.dt
            else fitted(step.dt / STEP_RATIO, interval)
        )
    ]


def _order(driver: Driver) -> int:
    """Return the assumed order of the error: 1 if it falls irregularly or points slide,
    otherwise the integrator's."""
    return (
        1
        if driver.columns["sliding"].any() or _is_irregular(driver)
        else driver.step.integrator.order
    )


def within_tolerance(
    driver: Driver, run: Callable[[TimeStep], Driver]
) -> tuple[Driver, SecondRun]:
    """Shorten the step of the finished `driver` until the estimated error of its result
    is within `time.tolerance`.

    `run` runs the scene to its end with a step. Raises SimulationError if no step is
    found.
    """
    scenario = driver.scenario
    tolerance = scenario.scene.time.tolerance
    for tried in range(1, SEARCH + 1):
        second = second_run(driver)
        left = scenario.end_truncation_error(driver.columns)
        error = second.errors.get(scenario.primary(driver.columns)[0])
        allowed = tolerance - left
        if error is not None and error <= tolerance:
            return driver, second
        if allowed <= 0.0 or tried == SEARCH:
            break
        ratio = STEP_RATIO
        if error is not None:
            excess = (error - left) / (TOLERANCE_PART * allowed)
            ratio = float(
                np.clip(excess ** (1.0 / _order(driver)), LEAST_RATIO, MOST_RATIO)
            )
        shorter = fitted(driver.step.dt / ratio, scenario.model.reset_interval)
        driver = run(replace(driver.step, dt=shorter))
    found = "cannot be estimated"
    if error is not None:
        found = f"is estimated at {error:.3g}"
    text = (
        f"time.tolerance is {tolerance:g}, and the error of the result after {tried}"
        f" runs {found}"
    )
    if left > 0.5 * tolerance:
        text += (
            f": {left:.2g} of it is due to where the run ends, at any step;"
            f" {scenario.truncation_remedy}"
        )
    else:
        text += "; write a smaller time.safety, or another time.integrator"
    raise SimulationError(f"{text}; or write a larger time.tolerance, or none")
