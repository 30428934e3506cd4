"""Estimate the errors due to the time step from a second run, and search for a step
within a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from typing import NamedTuple

import numpy as np

from taichi_disk.computation.contact import (
    contact_interval,
    greatest_compression,
    vibration_left,
)
from taichi_disk.computation.diagnostics import inverted_triangles, relative_imbalance
from taichi_disk.computation.driver import Driver
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import TimeStep
from taichi_disk.computation.step_control import fitted
from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.simulation.observables import Columns, split

# The constants were measured on scenes with a known result: `python -m
# tests.validation.estimate_trial`.
STEP_RATIO = 1.25  # ratio of a run's step to the shorter step of its second run
# the same ratios of the further runs if errors fall irregularly
HALF_STEP = 2.0
QUARTER_STEP = 4.0
# The second run has the longer step of 0.95 of the stability limit if the first has at
# least 0.75 of it.
LONGER_STEP = 0.95
LONGER_FROM = 0.75
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
LEAST_RATIO = 1.15
MOST_RATIO = 3.0

# A motion may be chaotic if the estimated error exceeds this fraction of the result, or
# if it has not fallen although the step is shorter by CHAOS_SHORTER.
SUSPICIOUS_ERROR = 1e-3
CHAOS_SHORTER = 4.0
# A motion is chaotic if a start turned by CHAOS_TURN [rad] changes the result by more
# than CHAOS_PART of the tolerance.
CHAOS_TURN = 1e-10
CHAOS_PART = 0.25

INSTANTS = 20  # of the contact, at which inverted triangles are counted


class SecondRun(NamedTuple):
    """Errors of results by name (empty if the second run has no result), and the
    largest number of triangles that were turned inside out during its contact."""

    errors: dict[str, float]
    inverted: int


def richardson(dt: float, runs: list[tuple[float, float]], order: int) -> float:
    """Return the error at the step `dt` from the steps and results of two or more
    `runs`, if errors are C dt^order.

    Each two runs give a C, and the largest counts.
    """
    errors = []
    for (step, value), (other_step, other_value) in combinations(runs, 2):
        powers = (step / dt) ** order - (other_step / dt) ** order
        errors.append(abs((value - other_value) / powers))
    return max(errors)


def second_run(driver: Driver) -> SecondRun:
    """Run the finished scene of `driver` again with another step and, if errors fall
    irregularly, with a third."""
    # Irregular errors may agree by chance, hence three runs. On the hardest walls the
    # error also stays at a plateau, which differences do not show: the estimate is at
    # least a fraction of the worst imbalance.
    scenario = driver.scenario
    inverted = 0
    runs: list[tuple[float, dict[str, float]]] = []
    try:
        for dt in _other_steps(driver):
            other = Driver(scenario, replace(driver.step, dt=dt), driver.kernels)
            if not runs:
                inverted = _most_inverted(other, driver.columns)
            other.advance()
            if not other.has_ended:
                return SecondRun({}, inverted)
            runs.append((dt, measured(scenario, other.columns)))
    except TaichiDiskError:  # the other step gives no result
        return SecondRun({}, inverted)
    return SecondRun(_errors(driver, runs), inverted)


def measured(scenario: Scenario, columns: Columns) -> dict[str, float]:
    """Return all quantities of a finished scene that have an error estimate."""
    numbers = dict(scenario.result(columns))
    if scenario.is_thrown:
        numbers["vibration_left"] = vibration_left(
            split(columns, scenario.lattice.inertia)
        )
    return numbers


def _most_inverted(driver: Driver, columns: Columns) -> int:
    """Advance `driver` through the contact, and return the largest number of triangles
    turned inside out. `columns`: of a finished run of the same scene."""
    start, end = contact_interval(
        columns["t"], columns["wall_force"], columns["com_vy"]
    )
    times = [*np.linspace(start, end, INSTANTS), greatest_compression(columns)]
    lattice = driver.scenario.lattice
    most = 0
    for t in sorted(times):
        steps = round(t / driver.step.dt) - driver.simulation.step_number
        if steps > 0 and driver.advance(steps=steps) == "running":
            most = max(most, inverted_triangles(lattice, driver.state.vectors[0]))
    return most


def _errors(
    driver: Driver, others: list[tuple[float, dict[str, float]]]
) -> dict[str, float]:
    """Return the errors of the quantities of a finished run by name. `others`: step
    [R/c] and quantities of its further runs."""
    scenario = driver.scenario
    columns = driver.columns
    dt = driver.step.dt
    runs = [*others, (dt, measured(scenario, columns))]
    least = ROUNDING
    if dt > scenario.wall_step:
        _, worst = relative_imbalance(scenario, columns)
        least += UNRESOLVED_PART * scenario.sensitivity * worst
    scales = scenario.result_scales(columns)
    if scenario.is_thrown:
        scales["vibration_left"] = scenario.sensitivity
    sampling = _sampling_errors(scenario, columns)
    order = _order(driver)
    primary, _ = scenario.primary(columns)
    errors = {}
    for name, scale in scales.items():
        if not all(name in numbers for _, numbers in runs):
            continue
        safety = ERROR_SAFETY[order]
        if name != primary:
            safety *= SECONDARY_SAFETY
        values = [(step, numbers[name]) for step, numbers in runs]
        of_step = max(safety * richardson(dt, values, order), least * scale)
        errors[name] = of_step + sampling.get(name, 0.0)
    errors[primary] += scenario.end_truncation_error(columns)
    return errors


def _sampling_errors(scenario: Scenario, columns: Columns) -> dict[str, float]:
    """Return the error of each quantity, such as a time, that is due to the distance
    between rows."""
    # It is the change if every other row is left out, or half of the change if two rows
    # of three are left out: either alone may agree by chance.
    found = measured(scenario, columns)
    rows = np.arange(len(columns["t"]))
    ends = (rows == 0) | (rows == rows[-1])
    errors = dict.fromkeys(found, 0.0)
    for n, k in ((2, 0), (2, 1), (3, 0), (3, 1), (3, 2)):
        kept_rows = ends | (rows % n == k)
        thinned = measured(
            scenario, {name: values[kept_rows] for name, values in columns.items()}
        )
        for name in found.keys() & thinned.keys():
            change = abs(thinned[name] - found[name])
            errors[name] = max(errors[name], change / (n - 1))
    return errors


def _is_irregular(driver: Driver) -> bool:
    """Return whether errors fall irregularly, so that results at two steps may agree by
    chance.

    They do with friction, if a step crosses much of the wall's decay length, and if
    points slide along a wall of springs.
    """
    scenario = driver.scenario
    crosses_wall = driver.step.dt > IRREGULAR_FROM * scenario.wall_step
    if scenario.model.has_friction or crosses_wall:
        return True
    # In a search for a tolerance, sliding points do not count: they would need a
    # further run each time, which took minutes.
    if scenario.scene.time.tolerance != "none":
        return False
    return bool(driver.columns["sliding"].any())


def _other_steps(driver: Driver) -> list[float]:
    """Return the steps [R/c] of the other runs: shorter ones, or a longer one, which
    costs less, if that is stable."""
    step = driver.step
    interval = driver.scenario.model.reset_interval
    if _is_irregular(driver):
        return [
            fitted(step.dt / ratio, interval) for ratio in (HALF_STEP, QUARTER_STEP)
        ]
    limit = step.limit_under(driver.largest_force)
    longer = fitted(LONGER_STEP * limit, interval)
    if step.dt > LONGER_FROM * limit and longer > step.dt:
        return [longer]
    return [fitted(step.dt / STEP_RATIO, interval)]


def _order(driver: Driver) -> int:
    """Return the assumed order of the error: 1 if it falls irregularly or points slide,
    otherwise the integrator's."""
    if driver.columns["sliding"].any() or _is_irregular(driver):
        return 1
    return driver.step.integrator.order


# ---- a tolerance


def within_tolerance(
    driver: Driver, run: Callable[[TimeStep], Driver]
) -> tuple[Driver, SecondRun]:
    """Shorten the step of the finished `driver` until the estimated error of its result
    is within `time.tolerance`.

    `run` runs the scene to its end with a step. Raises SimulationError if no step is
    found, or if the motion is chaotic.
    """
    scenario = driver.scenario
    tolerance = scenario.scene.time.tolerance
    longest_step = driver.step.dt
    first_error = None
    for tried in range(1, SEARCH + 1):
        second = second_run(driver)
        left = scenario.end_truncation_error(driver.columns)
        primary, value = scenario.primary(driver.columns)
        error = second.errors.get(primary)
        allowed = tolerance - left
        if error is not None:
            if first_error is None:
                first_error = error
            is_shorter = longest_step >= CHAOS_SHORTER * driver.step.dt
            has_not_fallen = is_shorter and error > first_error
            if error > SUSPICIOUS_ERROR * abs(value) or has_not_fallen:
                _refuse_chaos(driver)
            if error <= tolerance:
                return driver, second
        if allowed <= 0.0 or tried == SEARCH:
            break
        ratio = STEP_RATIO
        if error is not None:
            excess = (error - left) / (TOLERANCE_PART * allowed)
            ratio = excess ** (1.0 / _order(driver))
        ratio = float(np.clip(ratio, LEAST_RATIO, MOST_RATIO))
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
            f" {scenario.words.truncation_remedy}"
        )
    else:
        text += "; write a smaller time.safety, or another time.integrator"
    raise SimulationError(f"{text}; or write a larger time.tolerance, or none")


def _refuse_chaos(driver: Driver) -> None:
    """Raise SimulationError if the result of the finished `driver` depends so much on
    its start that no step keeps the tolerance."""
    scenario = driver.scenario
    tolerance = scenario.scene.time.tolerance
    change = change_of_turned_starts(driver)
    if change <= CHAOS_PART * tolerance:
        return
    symbol = scenario.words.symbol
    raise SimulationError(
        f"this impact is chaotic: {symbol} changes by {change:.2g} when the"
        f" start moves by {CHAOS_TURN:g} R, so that no time step gives it to"
        f" time.tolerance = {tolerance:g}; write none, which prints an honest error, or"
        " a lower impact.velocity, or more lattice.points"
    )


def change_of_turned_starts(driver: Driver) -> float:
    """Return the largest change of the primary result of the finished `driver` if the
    body starts turned by CHAOS_TURN either way. A run without a result does not
    count."""
    scenario = driver.scenario
    lattice = scenario.lattice
    n = lattice.disk_points
    _, value = scenario.primary(driver.columns)
    change = 0.0
    for angle in (CHAOS_TURN, -CHAOS_TURN):
        positions = lattice.positions.copy()
        arm = positions[:n] - lattice.mean(positions)
        positions[:n] += angle * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
        start = replace(scenario, lattice=replace(lattice, positions=positions))
        other = Driver(start, driver.step, driver.kernels)
        other.advance()
        if other.has_ended:
            _, other_value = scenario.primary(other.columns)
            change = max(change, abs(other_value - value))
    return change
