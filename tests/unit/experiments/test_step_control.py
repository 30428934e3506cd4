"""The choice of integrator and step, and when a step is shortened or accepted."""

from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import computed, control_of, damped, driver_of, drivers_of

from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.experiments.computation import diagnostics, error_estimate
from taichi_disk.experiments.computation.diagnostics import MAX_IMBALANCE, BlowUp
from taichi_disk.experiments.computation.stability import step_limit
from taichi_disk.experiments.computation.step_control import MAX_BLOW_UPS, StepControl
from taichi_disk.mechanics.integrators import (
    INTEGRATORS,
    TAKAHASHI_IMADA,
    TRAPEZOIDAL,
    VELOCITY_VERLET,
)
from taichi_disk.mechanics.integrators.trapezoidal import factorise
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.simulation.simulation import MAX_STEPS

VV = VELOCITY_VERLET
IMPACT = ("lattice.points=60", "material.eta_star=0", "impact.velocity=0.05")
SMALL = ("exponential_wall", *IMPACT)


@pytest.fixture
def finished(kernels):
    """Return a driver at the end of an impact without dashpots."""
    return drivers_of(kernels, *SMALL)[-1]


def after_run(columns, force=0.0):
    """Return a stand-in for a finished run with this time series and largest force."""
    return SimpleNamespace(has_ended=True, largest_force=force, columns=columns)


def after_failure(failure, force=0.0):
    """Return a stand-in for a run that failed."""
    return SimpleNamespace(has_ended=False, failure=failure, largest_force=force)


def off_by(driver, worst, closing=0.0):
    """Return a time series with energy errors `worst` and `closing`, by scale."""
    columns = driver.columns
    scale = driver.scenario.energy_scale(driver.columns)
    error = np.full(len(columns["t"]), worst)
    error[0] = 0.0
    error[-1] = closing
    return columns | {"total": columns["total"][0] + scale * error}


def test_an_automatic_step_resolves_what_resets_do_to_damped_vibrations():
    few = "lattice.points=60", "wall.points=80", "material.eta_star=10"

    def change_of_e(*settings, integrator="velocity_verlet"):
        control = control_of(
            "absorbing_wall", *few, f"time.integrator={integrator}", *settings
        )
        model = control.scenario.model
        rate = model.springs.eta * control.spectrum.damping
        part = 0.015  # measured with N = 100 to 4000
        if integrator == "trapezoidal":
            part = 0.004
            rate = min(rate, 1.0 / (3.0 * model.reset_interval))
        return part * rate * control.spectrum.omega * control.step.dt**2

    assert 0.5 * 2e-5 < change_of_e() <= 2e-5
    assert 0.5 * 1e-6 < change_of_e("time.tolerance=1e-6") <= 1e-6
    assert change_of_e("time.dt=0.003") > 1e-4  # as asked for
    for strong in "material.eta_star=10", "material.eta_star=1000":
        settings = strong, "time.tolerance=1e-7"
        assert 0.5e-7 < change_of_e(*settings, integrator="trapezoidal") <= 1e-7


def test_an_imbalance_shortens_the_step_as_order_2_asks(finished):
    def follows(control, worst, closing=0.0):
        columns = off_by(finished, worst * 1e-4, closing * 2e-5)
        return control.shortens(after_run(columns, finished.largest_force))

    control = control_of(*SMALL)
    first = control.step.dt
    assert first == pytest.approx(0.8 * control.step.limit)
    assert not follows(control, 0.9, closing=0.9)
    assert control.attempt == 1
    # dt -> dt 0.9/sqrt(4): the error, of order 2, falls to 0.81 of the allowed one.
    assert follows(control, 4.0)
    assert control.attempt == 2
    assert control.step.dt == pytest.approx(0.45 * first)
    # The step stays if shorter ones do not help, or if the user has chosen it.
    assert not follows(control, 3.9)
    assert follows(control, 0.9, closing=-1.5)
    assert not follows(control_of(*SMALL, f"time.dt={first}"), 100.0)


def test_what_a_fast_spin_loses_counts_against_the_slow_flight(kernels):
    # An error of the energy E affects the kinetic energy K of the flight through the
    # work of one motion on the other, some sqrt(E K): relative to K sqrt(E/K) more.
    settings = ("impact.velocity=0.01", "impact.spin=1.0", "impact.gap=0.3")
    driver = driver_of(kernels, *SMALL, *settings)
    control = control_of(*SMALL, *settings)
    scenario = driver.scenario
    more = np.sqrt(0.5 * (scenario.velocities**2).sum() / 60 / (0.5 * 0.01**2))
    assert more > 50.0
    driver.advance(steps=10)
    first = control.step.dt
    for part, shortens in ((0.9, False), (4.0, True)):
        columns = off_by(driver, part / more * 1e-4)
        assert control.shortens(after_run(columns)) == shortens
    assert control.step.dt == pytest.approx(0.45 * first)


def test_on_a_harder_wall_than_estimated_the_measured_force_sets_the_step(finished):
    for has_blown_up in (False, True):
        control = control_of(*SMALL)
        model = control.scenario.model
        integrator = control.step.integrator
        limit = partial(step_limit, control.spectrum, model, integrator)
        # The step must stay 5 % below the limit with the measured force.
        forces = np.geomspace(1e-3, 1e3, 2000)
        peak = next(one for one in forces if control.step.dt > 0.95 * limit(one))
        assert not control.shortens(after_run(finished.columns, 0.99 * peak))
        assert control.attempt == 1
        run = after_run(finished.columns, peak)
        if has_blown_up:
            run = after_failure(BlowUp("lost"), peak)
        assert control.shortens(run)
        assert control.step.limit == limit(1.5 * peak)


def test_after_a_blow_up_the_step_is_halved_a_few_times_but_not_for_lack_of_time():
    control = control_of(*SMALL)
    first = control.step.dt
    blown_up = after_failure(BlowUp("lost"))
    assert not control.shortens(after_failure(SimulationError("late")))
    for number in range(1, MAX_BLOW_UPS + 1):
        assert control.shortens(blown_up)
        assert control.step.dt == pytest.approx(0.5**number * first)
    assert not control.shortens(blown_up)
    assert not control_of(*SMALL, f"time.dt={first}").shortens(blown_up)


def test_more_steps_than_can_be_counted_are_refused_beforehand():
    with pytest.raises(InputError, match=r"time\.dt: 1e-09 .* at most 2,147,483,647"):
        control_of(*SMALL, "time.dt=1e-9")
    limit = control_of(*SMALL).scenario.max_time
    for dt, is_refused in ((0.99 * limit / MAX_STEPS, True), (limit / 2e9, False)):
        with pytest.raises(InputError) if is_refused else nullcontext():
            control_of(*SMALL, f"time.dt={dt}")


def test_warnings_say_what_makes_a_result_doubtful(finished):
    scenario = finished.scenario
    for part, expected in ((0.8, 0), (1.1, 2)):
        columns = off_by(finished, 0.0, closing=-part * MAX_IMBALANCE)
        columns["sliding"] = np.zeros_like(columns["t"])
        columns["sliding"] += scenario.reference_energy * part * MAX_IMBALANCE
        messages = diagnostics.warnings(scenario, columns)
        assert len(messages) == expected
    assert "imbalance at the end is -0.0011" in messages[0]
    assert "slid from spring to spring" in messages[1]


# ---- the first choice


def test_dashpots_are_solved_for_where_that_costs_less_than_the_steps_that_it_saves():
    # A step with the factor of 60 points costs 2.8 explicit ones; a step by iteration
    # with a million points costs 3.5.
    slow = ("impact.velocity=0.001", "impact.gap=0.3")
    for eta_star, saved, few, many in (
        (1.5, 2.03, VV, VV),
        (3.0, 3.37, TRAPEZOIDAL, VV),
        (6.0, 6.3, TRAPEZOIDAL, TRAPEZOIDAL),
    ):
        settings = (*SMALL, f"material.eta_star={eta_star}", *slow)
        control = control_of(*settings)
        scenario = control.scenario
        own = control.spectrum
        implicit = control.limit(TRAPEZOIDAL)
        explicit = control.limit(VV)
        assert implicit / explicit == pytest.approx(saved, rel=0.05)
        for points, expected in ((60, few), (1_000_000, many)):
            chosen = StepControl(scenario, replace(own, points=points))
            assert chosen.step.integrator is expected
        for name in ("velocity_verlet", "trapezoidal"):
            chosen = control_of(*settings, f"time.integrator={name}")
            assert chosen.step.integrator is INTEGRATORS[name]


WALL = ("absorbing_wall", *SMALL[1:3])


@pytest.mark.parametrize(
    ("settings", "expected"),
    [
        (SMALL, TAKAHASHI_IMADA),
        ((*SMALL[:2], "material.eta_star=0.1"), VV),
        ((*SMALL, "wall.friction=0.1"), VV),
        ((*WALL, "wall.boundary=pinned", "wall.contact=smooth"), TAKAHASHI_IMADA),
        # the contact force jumps
        ((*WALL, "wall.boundary=pinned"), VV),
        # the boundary is reset
        ((*WALL, "wall.contact=smooth"), VV),
        ((*WALL, "wall.boundary=dashpot", "wall.contact=smooth"), VV),
    ],
)
def test_order_4_is_taken_where_forces_are_smooth_and_conservative(settings, expected):
    assert control_of(*settings).step.integrator is expected


def test_the_elimination_order_keeps_the_factor_of_the_dashpots_sparse():
    # Minimum degree order: some 15,000 entries for 1099 points (3,187 springs); the
    # points' own order gives ten times that.
    lattice = Lattice.disk(1099, 0)
    assert len(lattice.bonds) < len(factorise(lattice, damped(0.1), 0.01).row) < 20_000


@pytest.mark.parametrize("interval", [3e-3, 0.0777, 1.0])
def test_a_whole_number_of_steps_fits_the_reset_interval(interval):
    wall = ("wall.points=80", f"wall.reset_interval={interval}", "impact.gap=0.3")
    control = control_of("absorbing_wall", SMALL[1], *wall)
    step = control.step
    scenario = control.scenario
    count = interval / step.dt
    assert count == pytest.approx(round(count), abs=1e-9)
    assert step.dt <= 0.8 * step.limit * (1 + 1e-12)
    assert round(count) == 1 or interval / (round(count) - 1) > 0.8 * step.limit
    # A step that was chosen and is then set as dt stays the same, in spite of rounding.
    for part in range(1 + int(interval / step.limit), 100):
        time = replace(scenario.scene.time, dt=interval / part)
        own = replace(scenario, scene=replace(scenario.scene, time=time))
        assert StepControl(own, control.spectrum).step.dt == interval / part


# ---- tolerances, in scenes


@pytest.mark.validate
def test_a_small_tolerance_is_reached_from_a_first_step_that_is_far_too_long(kernels):
    strong = ("lattice.points=30", "material.eta_star=100", "time.tolerance=1e-9")
    _, outcome = computed(kernels, "exponential_wall", *strong)
    assert outcome.summary["error_estimate"]["restitution"] <= 1e-9


@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_a_run_within_a_tolerance_is_as_near_as_it_says(tolerance, kernels):
    # Compare with a run whose error, of order 4, is below 1e-9.
    fine = ("time.integrator=takahashi_imada", "time.safety=0.1")
    exact, run = computed(kernels, *SMALL, *fine, estimate=False)
    scenario, outcome = computed(kernels, *SMALL, f"time.tolerance={tolerance}")
    e = scenario.result(outcome.series)["restitution"]
    off = abs(e - exact.result(run.series)["restitution"])
    assert 0.0 < off <= outcome.summary["error_estimate"]["restitution"] <= tolerance
    assert outcome.summary["attempts"] >= 2


def test_what_the_wall_still_holds_when_the_run_ends_is_part_of_the_error(kernels):
    soft = (*SMALL, "wall.a=10", "wall.V0=5")
    near = (*soft, "impact.gap=1.6")
    scenario, far = computed(kernels, *soft, "time.tolerance=1e-7")
    exact = scenario.result(far.series)["restitution"]
    for settings in (near, (*near, "time.tolerance=1e-3")):
        scenario, outcome = computed(kernels, *settings)
        # The results at two steps differ by 1e-7.
        off = abs(scenario.result(outcome.series)["restitution"] - exact)
        assert 5e-6 < off <= outcome.summary["error_estimate"]["restitution"]
    text = r"due to where the run ends, at any step; a larger impact\.gap"
    with pytest.raises(SimulationError, match=text):
        computed(kernels, *near, "time.tolerance=1e-8")


@pytest.mark.parametrize(
    ("shift", "offsets", "runs", "sliding"),
    [
        # order 4: differences fall by 16
        (0.0, [1e-4, 1e-4 / 16, 1e-4 / 256], 3, 0.0),
        # if points slide along a wall of springs, they do so by chance
        (0.0, [0.0, 1e-4 / 16 - 1e-4, 1e-4 / 256 - 1e-4, -1e-4], 4, 1e-9),
        # the first three agree by chance, then the order shows; a turned start gives
        # another result altogether
        (0.1, [0.0, 0.0, 1.6e-3, 1e-4, 6.25e-6], 5, 0.0),
        # the error falls, but not as fast, in an ordinary impact
        (0.0, [0.0, -5e-6, -9e-6], 3, 0.0),
        # all agree well within the tolerance
        (0.0, [0.0, 1e-9, -1e-9], 3, 0.0),
    ],
)
def test_three_results_decide_on_a_tolerance(shift, offsets, runs, sliding, kernels):
    driver = drivers_of(kernels, *SMALL, "time.tolerance=3e-5")[-1]
    last, errors = until_within_tolerance(driver, shift, offsets, sliding)
    assert last.step.dt == driver.step.dt / 2 ** (runs - 1)
    assert errors["restitution"] <= 3e-5


@pytest.mark.parametrize(
    ("shift", "message"),
    [
        (0.0, r"after 13 runs, .*; write a smaller time\.safety"),
        # a turned start gives another result altogether
        (0.1, r"after 9 runs, .* this impact is chaotic\. A change of the start"),
    ],
)
def test_a_tolerance_that_no_step_keeps_fails_with_advice(shift, message, kernels):
    driver = drivers_of(kernels, *SMALL, "time.tolerance=3e-5")[-1]
    with pytest.raises(SimulationError, match=message):
        until_within_tolerance(driver, shift, [0.0, 1e-3] * 7)


def until_within_tolerance(driver, shift, offsets, sliding=0.0):
    """Let `within_tolerance` get results that are off by `shift` and `offsets`."""
    offset = iter(offsets)

    def run(step):
        """Return a stand-in for the next run."""
        columns = driver.columns
        off = shift + next(offset)
        columns["com_vy"][-1] += off * driver.scenario.speed_before
        columns["sliding"][-1] = sliding
        return SimpleNamespace(
            scenario=driver.scenario, step=step, columns=columns, failure=None
        )

    return error_estimate.within_tolerance(run(driver.step), run)
