"""Which integrator and step are chosen; when a step is shortened and tried again, and when it stands."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from bodies import computed, damped

from taichi_disk.computation import diagnostics, step_control
from taichi_disk.computation.diagnostics import CLOSING, LARGEST, WORST
from taichi_disk.computation.stability import spectrum, step_limit
from taichi_disk.computation.step_control import (
    BLOW_UPS,
    CAUTION,
    COMPARED,
    MOST,
    StepControl,
)
from taichi_disk.errors import SimulationError
from taichi_disk.integrators import INTEGRATORS, TRAPEZOIDAL, VELOCITY_VERLET
from taichi_disk.integrators.trapezoidal import factorise
from taichi_disk.lattice import disk_lattice
from taichi_disk.scenes import load_scene

VV = VELOCITY_VERLET
UNDAMPED = "material.eta_star=0"


def control_of(*settings, name="exponential_wall", **time):
    """The control of a real scene."""
    scene = load_scene(
        name,
        ["lattice.points=60", "impact.gap=0.3", *settings, *(f"time.{key}={value}" for key, value in time.items())],
    )
    scenario = scene.scenario()
    return StepControl(scenario, scene.time, spectrum(scenario.lattice, scenario.model))


def series(control, e=0.9, worst=0.0, closing=0.0, left=0.0):
    """Of an impact with the restitution `e`; energies over that of its start: off by `worst`, at the end by `closing`.

    `left`: potential of the wall at the end over the kinetic energy of the flight.
    """
    scenario = control.scenario
    v, energy = scenario.velocity, 0.5 * float((scenario.velocities**2).sum()) / 60
    return {
        "t": np.arange(4.0),
        "com_vy": v * np.array([-1.0, -0.5, 0.5, e]),
        "wall_force": np.array([0.0, 1.0, 1.0, 0.0]),
        "wall": np.array([0.0, 0.0, 0.0, left * 0.5 * v**2]),
        "sliding": np.zeros(4),
        "angular_momentum": np.zeros(4),
        "total": energy * (1.0 + np.array([0.0, worst, 0.0, closing])),
    }


def run_to_the_end(control, excess=0.0, closing=0.0, peak=0.0, e=0.9):
    """What follows from a run whose worst imbalance is `excess` times the allowed one, at the end `closing` times."""
    return control.shorten_after_run(peak, series(control, e, excess * WORST, closing * CLOSING))


def test_an_imbalance_shortens_the_step_as_order_2_asks():
    control = control_of(UNDAMPED)
    first = control.step.dt
    assert first == pytest.approx(0.8 * control.step.limit)
    assert not run_to_the_end(control, 0.9, closing=0.9) and control.attempt == 1
    # dt -> dt 0.9/sqrt(4): the error, of order 2, falls to 0.81 of what is allowed.
    assert run_to_the_end(control, 4.0) and control.attempt == 2
    assert control.step.dt == pytest.approx(0.45 * first)
    # Not where shorter steps leave the imbalance as it is, and not where a person has chosen the step.
    assert not run_to_the_end(control, 3.9)
    assert run_to_the_end(control, 0.9, closing=-1.5)
    assert not run_to_the_end(control_of(UNDAMPED, dt=first), 100.0)


def test_what_a_fast_spin_loses_counts_against_the_slow_flight():
    # A part of the energy E that is off reaches the flight's kinetic energy K by the work of one motion on the other,
    # of the order of sqrt(E K): sqrt(E/K) times as much of K.
    control = control_of(UNDAMPED, "impact.velocity=0.01", "impact.spin=1.0")
    first, scenario = control.step.dt, control.scenario
    more = np.sqrt(0.5 * (scenario.velocities**2).sum() / 60 / (0.5 * 0.01**2))
    assert more > 50.0
    assert not run_to_the_end(control, 0.9 / more)
    assert run_to_the_end(control, 4.0 / more) and control.step.dt == pytest.approx(0.45 * first)


def test_a_harder_wall_than_estimated_is_met_with_its_measured_force():
    for what_follows in (run_to_the_end, StepControl.shorten_after_blow_up):
        control = control_of(UNDAMPED)
        limit = partial(step_limit, control.spectrum, control.scenario.model, VV)
        forces = np.geomspace(1e-3, 1e3, 2000)
        # The step is to keep 5 % from the limit that the measured force leaves.
        peak = next(force for force in forces if control.step.dt > 0.95 * limit(force))
        assert not run_to_the_end(control, peak=0.99 * peak) and control.attempt == 1
        assert what_follows(control, peak=peak) and control.step.limit == limit(1.5 * peak)


def test_a_step_too_near_to_the_limit_does_not_stand_however_well_two_runs_agree():
    control = control_of(UNDAMPED, tolerance=1e-2)
    assert run_to_the_end(control)
    limit = partial(step_limit, control.spectrum, control.scenario.model, VV)
    hard = next(force for force in np.geomspace(1e-3, 1e3, 2000) if control.step.dt > 0.95 * limit(force))
    assert run_to_the_end(control, peak=hard) and control.step.dt < 0.95 * limit(hard)
    assert not run_to_the_end(control, peak=hard)


def test_after_a_blow_up_the_step_is_halved_a_few_times():
    control = control_of(UNDAMPED)
    first = control.step.dt
    for number in range(1, BLOW_UPS + 1):
        assert control.shorten_after_blow_up(0.0) and control.step.dt == pytest.approx(0.5**number * first)
    assert not control.shorten_after_blow_up(0.0)
    assert not control_of(UNDAMPED, dt=first).shorten_after_blow_up(0.0)


def test_after_a_blow_up_no_run_is_compared_with_one_of_another_integrator():
    # The wall proves so hard that dashpots no longer are what bounds an explicit step.
    control = control_of("material.eta_star=6", "impact.velocity=0.003", tolerance=1e-3)
    assert control.step.integrator is TRAPEZOIDAL and run_to_the_end(control)
    assert control.shorten_after_blow_up(1e3 * control.scenario.point_force) and control.step.integrator is VV
    # A first run tells nothing by itself, though its result is that of the run before.
    assert control.error(series(control)) is None
    assert run_to_the_end(control) and not run_to_the_end(control)


@pytest.mark.parametrize(("tolerance", "error"), [(1e-4, 0.75e-4), (1e-6, 4e-4 / MOST**2)])
def test_the_next_step_is_as_long_as_the_tolerance_allows(tolerance, error):
    control = control_of(UNDAMPED, tolerance=tolerance)
    first, constant = control.step.dt, 4e-4 / CAUTION / (control.step.dt / COMPARED) ** 2
    # The first one tells nothing by itself.
    assert run_to_the_end(control, e=0.9 + constant * control.step.dt**2)
    assert control.step.dt == pytest.approx(first / COMPARED)
    assert run_to_the_end(control, e=0.9 + constant * control.step.dt**2)
    assert constant * control.step.dt**2 * CAUTION == pytest.approx(error, rel=1e-5)


def test_a_result_is_out_of_tolerance_as_soon_as_its_estimated_error_exceeds_it():
    for excess in (0.99, 1.01):
        control = control_of(UNDAMPED, tolerance=4e-4 / excess)
        constant = 4e-4 / CAUTION / (control.step.dt / COMPARED) ** 2
        assert run_to_the_end(control, e=0.9 + constant * control.step.dt**2)
        e = 0.9 + constant * control.step.dt**2
        assert run_to_the_end(control, e=e) == (excess > 1.0)
        told = control.out_of_tolerance(series(control, e))
        assert (told is None) == (excess < 1.0)
        assert told is None or "is estimated at 0.0004" in told
    # A fifth of what the wall's last potential is worth in e is part of its error.
    more = control.error(series(control, e, left=1e-3)) - control.error(series(control, e))
    assert more == pytest.approx(0.2 * (np.sqrt(e**2 + 1e-3) - e), rel=1e-6)


def test_what_makes_a_result_doubtful_is_told():
    control = control_of(UNDAMPED)
    energy = control.scenario.energy
    for part, expected in ((0.8, 0), (1.1, 2)):
        rows = series(control, closing=-part * LARGEST) | {"sliding": energy * part * LARGEST * np.array([0, 1, 0, 0])}
        told = diagnostics.warnings(control.scenario, rows)
        assert len(told) == expected
    assert "imbalance is -0.0011 at the end" in told[0] and "slid from spring to spring" in told[1]


# ---- the first choice


def test_dashpots_are_solved_for_where_that_costs_less_than_the_steps_that_it_saves():
    # A step with the factor of 60 points costs 2.8 explicit ones, with that of a million points 11.6.
    for eta_star, saved, few, many in (
        (0.0, 1.0, VV, VV),
        (1.5, 2.03, VV, VV),
        (6.0, 6.3, TRAPEZOIDAL, VV),
        (20.0, 20.0, TRAPEZOIDAL, TRAPEZOIDAL),
    ):
        control = control_of(f"material.eta_star={eta_star}", "impact.velocity=0.001")
        scenario, own = control.scenario, control.spectrum
        implicit, explicit = (control.limit(way, scenario.point_force) for way in (TRAPEZOIDAL, VV))
        assert implicit / explicit == pytest.approx(saved, rel=0.05)
        for points, expected in ((60, few), (1_000_000, many)):
            chosen = StepControl(scenario, scenario.scene.time, replace(own, points=points))
            assert chosen.step.integrator is expected
        for name in ("velocity_verlet", "trapezoidal"):
            chosen = StepControl(scenario, replace(scenario.scene.time, integrator=name), own)
            assert chosen.step.integrator is INTEGRATORS[name]


def test_the_elimination_order_keeps_the_factor_of_the_dashpots_sparse():
    # Minimum degree: some 15,000 entries for 1099 points (3,187 springs); in the points' own order, ten times that.
    lattice = disk_lattice(1099, 0)
    assert len(lattice.bonds) < len(factorise(lattice, damped(0.1), 0.01).row) < 20_000


@pytest.mark.parametrize("interval", [3e-3, 0.0777, 1.0])
def test_a_whole_number_of_steps_fits_the_reset_interval(interval):
    control = control_of("wall.points=80", f"wall.reset_interval={interval}", name="absorbing_wall")
    step, scenario = control.step, control.scenario
    count = interval / step.dt
    assert count == pytest.approx(round(count), abs=1e-9)
    assert step.dt <= 0.8 * step.limit * (1 + 1e-12)
    assert round(count) == 1 or interval / (round(count) - 1) > 0.8 * step.limit
    # What was taken, written as dt, is taken again, however the division was rounded.
    for part in range(1 + int(interval / step.limit), 100):
        time = replace(scenario.scene.time, dt=interval / part)
        assert StepControl(scenario, time, control.spectrum).step.dt == interval / part


# ---- tolerances, in scenes


SMALL = ("exponential_wall", "lattice.points=60", "material.eta_star=0", "impact.velocity=0.05")


def test_a_small_tolerance_is_reached_from_a_first_step_that_is_far_too_long(kernels):
    strong = ("exponential_wall", "lattice.points=30", "material.eta_star=100", "time.tolerance=1e-9")
    _, outcome = computed(kernels, *strong)
    assert outcome.facts["error_estimate"]["restitution"] <= 1e-9


@pytest.mark.parametrize("tolerance", [1e-3, 1e-7])
def test_a_run_within_a_tolerance_is_as_near_as_it_says(tolerance, kernels):
    # Against one with steps so short that its error of order 4 is below 1e-9.
    fine = ("time.integrator=vefrl", "time.safety=0.1")
    exact, run = computed(kernels, *SMALL, *fine, estimate=False)
    scenario, outcome = computed(kernels, *SMALL, f"time.tolerance={tolerance}")
    off = abs(scenario.result(outcome.columns)["restitution"] - exact.result(run.columns)["restitution"])
    assert 0.0 < off <= outcome.facts["error_estimate"]["restitution"] <= tolerance
    assert outcome.facts["attempts"] >= 2


def test_what_the_wall_still_holds_when_the_run_ends_is_part_of_the_error(kernels):
    soft = (*SMALL, "wall.a=10", "wall.V0=5")
    near = (*soft, "impact.gap=1.6")
    scenario, far = computed(kernels, *soft, "time.tolerance=1e-7")
    exact = scenario.result(far.columns)["restitution"]
    for one in (near, (*near, "time.tolerance=1e-3")):
        scenario, outcome = computed(kernels, *one)
        # Two steps differ by 1e-7.
        off = abs(scenario.result(outcome.columns)["restitution"] - exact)
        assert 5e-6 < off <= outcome.facts["error_estimate"]["restitution"]
    with pytest.raises(SimulationError, match=r"due to where the run ends, at any step; a larger impact\.gap"):
        computed(kernels, *near, "time.tolerance=1e-8")


def test_a_tolerance_that_cannot_be_shown_is_a_failure_with_advice(monkeypatch, kernels):
    monkeypatch.setattr(step_control, "SEARCH", 2)
    with pytest.raises(SimulationError, match=r"the error of the result after 2 runs is .*write a larger"):
        computed(kernels, *SMALL[:2], "time.tolerance=1e-9", "impact.velocity=0.1")
