"""How far a result is off for its time step, by runs with other steps: exact for powers, careful elsewhere."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from taichi_disk.integrators import TRAPEZOIDAL, VEFRL, VELOCITY_VERLET
from taichi_disk.simulation.error_estimate import (
    CAUTION,
    MOST,
    RATIO,
    REGULAR_CAUTION,
    UNRESOLVED_PART,
    RunRecord,
    TimeStep,
    better_step,
    error_estimate,
    two_run_estimate,
)

VV = VELOCITY_VERLET


def runs(integrator, steps, error, imbalance=0.0, resolving=np.inf):
    """Runs of a scene whose true result is 0.9 and whose `error` is a function of the step."""
    return [RunRecord(integrator, dt, 0.9 + error(dt), imbalance, dt / resolving) for dt in steps]


def square(h):
    return 3.0 * h**2


def fourth(h):
    return 3.0 * h**4


def test_the_estimate_is_exact_where_the_error_is_a_power_of_the_step():
    assert error_estimate(runs(VV, [0.02], square)) is None
    # Two results cannot tell that it is one; the energy can.
    two = runs(VV, [0.02, 0.014], square)
    assert error_estimate(two) == pytest.approx(CAUTION * square(0.014), rel=1e-9)
    regular = [replace(one, imbalance=5.0 * one.dt**2) for one in two]
    assert error_estimate(regular) == pytest.approx(REGULAR_CAUTION * square(0.014), rel=1e-9)
    assert two_run_estimate(*regular[::-1]) == pytest.approx(CAUTION * square(0.02), rel=1e-9)
    assert error_estimate(runs(VV, [0.02, 0.014, 0.009], square)) == pytest.approx(square(0.009), rel=1e-9)
    assert error_estimate(runs(VEFRL, [0.02, 0.016, 0.01], fourth)) == pytest.approx(fourth(0.01), rel=1e-5)
    # Order 4 after two runs of order 2, whose extrapolation is exact here.
    coarse = runs(VEFRL, [0.03], fourth, resolving=0.01)
    assert error_estimate([*two, *coarse]) == pytest.approx(2.0 * fourth(0.03))


@pytest.mark.parametrize("steps", [(0.8, 0.57, 0.5), (0.8, 0.57, 0.19), (0.8, 0.57, 0.4, 0.1)])
@pytest.mark.parametrize("power", [3, 4])
def test_a_next_power_of_the_step_is_never_missed_by_three_runs(steps, power):
    """Two runs may agree by accident, where the powers cancel: h^2 - h^4/(h_1^2 + h_2^2) has no error to see there."""

    def estimate(part, count):
        return error_estimate(runs(VV, steps[:count], lambda h: h**2 + part * h**power))

    cancelling = (steps[0] ** 2 - steps[1] ** 2) / (steps[0] ** power - steps[1] ** power)
    assert estimate(-cancelling, 2) < 1e-12
    for part in [*np.linspace(-5.0, 5.0, 101), -cancelling]:
        true = abs(steps[-1] ** 2 + part * steps[-1] ** power)
        assert estimate(part, len(steps)) >= (1.0 - 1e-9) * true


def test_a_result_that_jumps_about_does_not_pass_for_converged():
    """Errors that are random, and fall with the first power of the step as where contacts jump."""
    rng, covered = np.random.default_rng(1), []
    for _ in range(2000):
        found = runs(VV, (0.8, 0.57, 0.4), lambda h: h * rng.uniform(-1.0, 1.0))
        covered.append(error_estimate(found) >= abs(found[-1].result - 0.9))
    assert np.mean(covered) > 0.9


def test_a_step_that_does_not_resolve_the_wall_is_judged_by_the_energy_too():
    for resolving, expected in ((0.01, 0.0), (0.008, UNRESOLVED_PART * 1e-3)):
        agreeing = runs(VV, (0.02, 0.014, 0.009), lambda h: 0.0, 1e-3, resolving)
        assert error_estimate(agreeing) == expected
    assert 0.005 < better_step(agreeing, 1e-6, TimeStep(VV, 0.025, 0.009)).dt <= 0.008


def test_the_next_step_is_as_long_as_the_tolerance_allows():
    first, second = runs(VV, [0.016, 0.0128], square)
    assert better_step([first], 1e-6, TimeStep(VV, 0.02, first.dt)).dt == pytest.approx(0.016 / RATIO)
    step = TimeStep(VV, 0.02, second.dt)
    assert square(better_step([first, second], 3e-4, step).dt) == pytest.approx(0.75 * 3e-4, rel=1e-9)
    # Not at one leap, unless the energy says that the power can be trusted so far.
    assert better_step([first, second], 2e-5, step).dt > second.dt / 3.0
    trusted = [replace(one, imbalance=one.dt**2) for one in (first, second)]
    assert square(better_step(trusted, 2e-5, step).dt) == pytest.approx(1.5e-5, rel=1e-9)
    # Order 4 leaps as far as its energy says: 16 x 0.75e-6 = 1.2e-5.
    for imbalance, shorter in ((1e-9, RATIO), (1.2e-5, 2.0), (1.0, MOST)):
        run = RunRecord(VEFRL, 0.03, 0.9, imbalance)
        assert 0.03 / better_step([run], 1e-6, TimeStep(VEFRL, 0.034, 0.03)).dt == pytest.approx(shorter)


@pytest.mark.parametrize(
    ("before", "cost", "other"),
    [(VV, 1.0, TimeStep(VEFRL, 0.034, 0.0323, 4.0)), (TRAPEZOIDAL, 3.3, TimeStep(VV, 0.002, 0.0019, 1.0))],
    ids=["order 4 in place of 2", "explicit dashpots in place of implicit ones"],
)
def test_another_integrator_is_taken_once_it_costs_less(before, cost, other):
    records, step = runs(before, [0.016, 0.0128], square), TimeStep(before, 0.02, 0.0128, cost)
    assert better_step(records, 3e-4, step, other).integrator is before
    assert better_step(records, 1e-6, step, other) is other
    assert better_step(records, 1e-6, step).integrator is before
