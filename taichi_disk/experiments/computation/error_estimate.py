"""Estimate the errors due to the time step from a second run, and search for a step
within a tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import combinations
from math import inf

import numpy as np

from taichi_disk.base.errors import SimulationError
from taichi_disk.experiments.computation.contact import Contact, energy_error
from taichi_disk.experiments.computation.diagnostics import (
    BlowUp,
    relative_imbalance,
)
from taichi_disk.experiments.computation.driver import Driver
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.computation.stability import TimeStep
from taichi_disk.experiments.computation.step_control import fitted
from taichi_disk.experiments.computation.words import Numbers
from taichi_disk.mechanics.lattice.triangles import quarter_turned
from taichi_disk.mechanics.simulation.observables import Columns, split

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
# Results other than the primary one converge less regularly: a further factor, and the
# smallest stated error over that of the primary result times the scale, because two
# runs may agree by chance.
SECONDARY_SAFETY = 2.0
SECONDARY_PART = 0.03
# smallest stated error over the worst energy imbalance, if the step does not resolve
# the wall
UNRESOLVED_PART = 0.5
ROUNDING = 1e-14  # rounding error of sums over many steps
# ratio of the step to the step that resolves the wall, from which errors fall
# irregularly
IRREGULAR_FROM = 0.51

SEARCH = 12  # how often the step is halved for a tolerance
# Differences of results at three steps show the order of the error if their ratio is
# the expected one within this factor.
ORDER_MARGIN = 2.0

# A plain run warns if the estimated error exceeds this fraction of the result.
SUSPICIOUS_ERROR = 1e-3
# A start turned by CHAOS_TURN [rad] changes the result by this angle times a factor. It
# is at most some ten in ordinary impacts. From CHAOTIC_FROM on, results may agree by
# chance, and the step is halved at most CHAOTIC_SEARCH times.
CHAOS_TURN = 1e-10
CHAOTIC_FROM = 100.0
CHAOTIC_SEARCH = 8

# A start turned by this angle [rad] moves the disk about as far as the errors of an
# automatic step do until the contact. Its effect is part of the error on a wall that is
# reset, where the results at three steps may agree by chance.
PATH_TURN = 1e-5


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


def second_run(driver: Driver, run: Callable[[TimeStep], Driver]) -> Numbers:
    """Return the errors of results by name: `run` the finished scene of `driver` again
    with another step and, if errors fall irregularly, with a third. Raises
    SimulationError if there is no result then."""
    # Irregular errors may agree by chance, hence three runs. On the hardest walls the
    # error also stays at a plateau, which differences do not show: the estimate is at
    # least a fraction of the worst imbalance.
    others: list[Driver] = []
    for dt in _other_steps(driver):
        other = run(_step(driver, dt))
        if other.failure and dt > driver.step.dt:
            other = run(_step(driver, driver.step.dt / STEP_RATIO))
        _require_result(driver, other)
        others.append(other)
    errors = _errors(driver, others, _order(driver))
    if driver.scenario.model.reset_interval:
        changes = _changes_by_turns(driver)
        errors = {name: error + changes[name] for name, error in errors.items()}
    return errors


def _step(driver: Driver, dt: float) -> TimeStep:
    """Return the step of `driver` with the length `dt` [R/c]."""
    return replace(driver.step, dt=fitted(dt, driver.scenario.model.reset_interval))


def _require_result(driver: Driver, other: Driver) -> None:
    """Raise SimulationError if the scene of `driver` has no result with the step of
    `other`."""
    if other.has_ended:
        return
    failure = other.failure
    text = (
        f"the time step decides whether there is a result: with {driver.step.dt:.4g}"
        f" R/c there is one, and with {other.step.dt:.4g} R/c: {failure}"
    )
    if isinstance(failure, BlowUp):
        raise BlowUp(text, failure.last_good)
    raise SimulationError(text)


def measured(scenario: Scenario, columns: Columns) -> Numbers:
    """Return all quantities of a finished scene that have an error estimate."""
    numbers = dict(scenario.result(columns))
    if scenario.is_thrown:
        parts = split(columns, scenario.lattice.inertia)
        numbers["vibration_left"] = Contact(parts).vibration_left
    return numbers


def _errors(driver: Driver, others: list[Driver], order: int) -> Numbers:
    """Return the errors of the quantities of a finished run by name. `others`: further
    runs; `order`: of the error of the primary result."""
    scenario = driver.scenario
    columns = driver.columns
    inertia = scenario.lattice.inertia
    dt = driver.step.dt
    runs = [
        (other.step.dt, measured(scenario, other.columns))
        for other in (*others, driver)
    ]
    least = ROUNDING
    if dt > scenario.wall_step:
        _, worst = relative_imbalance(scenario, columns)
        least += UNRESOLVED_PART * scenario.sensitivity * worst
    scales = scenario.result_scales(columns)
    if scenario.is_thrown:
        scales["vibration_left"] = scenario.sensitivity
    sampling = _sampling_errors(scenario, columns)
    primary, _ = scenario.primary(columns)
    errors: Numbers = {}
    for name, scale in scales.items():
        if not all(name in numbers for _, numbers in runs):
            continue
        values = [(step, numbers[name]) for step, numbers in runs]
        if name == primary:
            of_step = ERROR_SAFETY[order] * richardson(dt, values, order)
        else:
            usual = _order(driver)
            safety = SECONDARY_SAFETY * ERROR_SAFETY[usual]
            of_step = safety * richardson(dt, values, usual)
            of_step = max(of_step, SECONDARY_PART * scale * errors[primary])
        if name == "vibration_left":
            # Beside the energy of a fast spin it is a small rest, in which two runs may
            # agree by chance.
            of_step = max(of_step, energy_error(split(columns, inertia)))
        errors[name] = max(of_step, least * scale) + sampling.get(name, 0.0)
        if name == primary:
            errors[name] += scenario.end_truncation_error(columns)
    return errors


def _turned(driver: Driver, angle: float) -> Driver:
    """Return the finished or failed driver of the same scene, in which the body starts
    turned by `angle`."""
    lattice = driver.scenario.lattice
    n = lattice.disk_points
    positions = lattice.positions.copy()
    arm = positions[:n] - lattice.mean(positions)
    positions[:n] += angle * quarter_turned(arm)
    start = replace(driver.scenario, lattice=replace(lattice, positions=positions))
    other = Driver(start, driver.step)
    other.advance()
    return other


def _changes_by_turns(driver: Driver) -> Numbers:
    """Return the largest change of each quantity of a finished run if the body starts
    turned by PATH_TURN either way."""
    found = measured(driver.scenario, driver.columns)
    changes = dict.fromkeys(found, 0.0)
    for angle in (PATH_TURN, -PATH_TURN):
        other = _turned(driver, angle)
        if other.has_ended:
            turned = measured(driver.scenario, other.columns)
            for name in found.keys() & turned.keys():
                change = abs(turned[name] - found[name])
                changes[name] = max(changes[name], change)
    return changes


def _sampling_errors(scenario: Scenario, columns: Columns) -> Numbers:
    """Return the error of each quantity, such as a time, that is due to the distance
    between rows."""
    # It is the change if every other row is left out, or half of the change if two rows
    # of three are left out: either alone may agree by chance.
    found = measured(scenario, columns)
    rows = np.arange(len(columns["t"]))
    ends = (rows == 0) | (rows == rows[-1])
    errors = dict.fromkeys(found, 0.0)
    if scenario.model.reset_interval:
        # The energy jumps at a reset, and the contact may end on either side of it.
        parts = split(columns, scenario.lattice.inertia)
        errors["vibration_left"] = Contact(parts).vibration_change
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

    They do with friction, if a step crosses much of the wall's decay length, if points
    slide along a wall of springs, and on a wall that is reset.
    """
    model = driver.scenario.model
    crosses_wall = driver.step.dt > IRREGULAR_FROM * driver.scenario.wall_step
    if model.has_friction or model.reset_interval or crosses_wall:
        return True
    return _slides(driver)


def _slides(driver: Driver) -> bool:
    """Return whether a point slides from one spring of the wall to the next."""
    return bool(driver.columns["sliding"].any())


def _other_steps(driver: Driver) -> list[float]:
    """Return the steps [R/c] of the other runs: shorter ones, or a longer one, which
    costs less, if that is stable."""
    step = driver.step
    if _is_irregular(driver):
        return [step.dt / HALF_STEP, step.dt / QUARTER_STEP]
    longer = LONGER_STEP * step.limit_under(driver.largest_force)
    if step.dt > LONGER_FROM / LONGER_STEP * longer and longer > step.dt:
        return [longer]
    return [step.dt / STEP_RATIO]


def _order(driver: Driver) -> int:
    """Return the assumed order of the error: 1 if it falls irregularly, otherwise the
    integrator's."""
    if _is_irregular(driver):
        return 1
    return driver.step.integrator.order


# ---- a tolerance


def within_tolerance(
    driver: Driver, run: Callable[[TimeStep], Driver]
) -> tuple[Driver, Numbers]:
    """Halve the step of the finished `driver` until three successive results show that
    the error is within `time.tolerance`. Return the run with the shortest step, and its
    errors of results by name.

    `run` runs the scene to its end with a step. Raises SimulationError if that fails,
    or no step is found.
    """
    scenario = driver.scenario
    tolerance = scenario.scene.time.tolerance
    left = scenario.end_truncation_error(driver.columns)
    runs = [driver]
    growth = 0.0
    error = inf
    halvings = 0
    most = SEARCH
    while left < tolerance and halvings < most:
        halvings += 1
        half = run(_step(driver, 0.5 * runs[-1].step.dt))
        if half.failure:
            raise half.failure
        runs = [*runs[-2:], half]
        if len(runs) < 3:
            continue
        order = _order_shown(runs)
        last = runs[-1]
        errors = _errors(last, runs[:-1], order)
        primary, _ = scenario.primary(last.columns)
        error = errors[primary]
        if order == 1 and not growth:
            growth = growth_of_turn(driver)
            if growth >= CHAOTIC_FROM:
                most = CHAOTIC_SEARCH
        if error <= tolerance and (order > 1 or growth < CHAOTIC_FROM):
            return last, errors
    raise SimulationError(_missed(scenario, runs[-1], halvings, error, left, growth))


def _order_shown(runs: list[Driver]) -> int:
    """Return the integrator's order if the results of three runs at shorter and shorter
    steps show it, else 1. If points slide along a wall of springs, they may show it by
    chance."""
    order = runs[0].step.integrator.order
    powers = [run.step.dt**order for run in runs]
    expected = (powers[0] - powers[1]) / (powers[1] - powers[2])
    first, second, third = (run.scenario.primary(run.columns)[1] for run in runs)
    if abs(third - second) <= ROUNDING or _slides(runs[-1]):
        return 1
    ratio = (second - first) / (third - second) / expected
    if 1.0 / ORDER_MARGIN <= ratio <= ORDER_MARGIN:
        return order
    return 1


def growth_of_turn(driver: Driver) -> float:
    """Return the change of the primary result of the finished `driver` over a tiny
    angle by which the body starts turned [1/rad]."""
    other = _turned(driver, CHAOS_TURN)
    if not other.has_ended:
        return inf
    _, value = driver.scenario.primary(driver.columns)
    _, other_value = driver.scenario.primary(other.columns)
    return abs(other_value - value) / CHAOS_TURN


def _missed(
    scenario: Scenario,
    driver: Driver,
    halvings: int,
    error: float,
    left: float,
    growth: float,
) -> str:
    """Return why no step keeps the tolerance. `driver`: the run with the shortest step;
    the numbers as in `within_tolerance`."""
    tolerance = scenario.scene.time.tolerance
    symbol = scenario.words.symbol
    if left > 0.5 * tolerance:
        return (
            f"time.tolerance is {tolerance:g}, and {left:.2g} of the error of {symbol}"
            " is due to where the run ends, at any step;"
            f" {scenario.words.truncation_remedy}; or write a larger time.tolerance, or"
            " none"
        )
    found = (
        f"time.tolerance is {tolerance:g}, and the error of {symbol} is estimated at"
        f" {error:.2g} after {halvings + 1} runs, the last with a step of"
        f" {driver.step.dt:.2g} R/c"
    )
    if growth < CHAOTIC_FROM:
        return (
            f"{found}; write a smaller time.safety, another time.integrator, a larger"
            " time.tolerance, or none"
        )
    return (
        f"{found}: this impact is chaotic. A change of the start changes {symbol} by"
        f" {growth:.0e} times as much, and so does the error of a step: only one of"
        f" {tolerance / growth:.0e} R would keep the tolerance. Write a larger"
        " time.tolerance, or none, which prints an honest error; or a lower"
        " impact.velocity, or more lattice.points"
    )
