"""Which integrator and step are chosen; when a step is shortened and tried again, and when it stands."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import FREE, computed, damped, disk

from taichi_disk.config.sections import TimeSection
from taichi_disk.errors import SimulationError
from taichi_disk.integrators import INTEGRATORS, TRAPEZOIDAL, VELOCITY_VERLET
from taichi_disk.integrators.trapezoidal import factorise
from taichi_disk.lattice import disk_lattice
from taichi_disk.physics import ResetBoundary
from taichi_disk.simulation import diagnostics, step_control
from taichi_disk.simulation.diagnostics import CLOSING, LARGEST, WORST
from taichi_disk.simulation.stability import Spectrum, spectrum, step_limit
from taichi_disk.simulation.step_control import (
    BLOW_UPS,
    CAUTION,
    COMPARED,
    MARGIN,
    MOST,
    RunRecord,
    StepControl,
    error_estimate,
)

VV = VELOCITY_VERLET
LIMIT, DT = 0.02, 0.016  # of what follows where nothing is damped
FIRST = CAUTION * (DT / COMPARED) ** 2  # error estimated first where the true one is the step's square


def control_of(model=FREE, modes=None, sensitivity=1.0, **time):
    """The control of a scene whose energy scale is 2 M c^2, its primary result 0.9."""
    scenario = SimpleNamespace(
        model=model,
        energy_scale=lambda columns: 2.0,
        sensitivity=sensitivity,
        primary=lambda columns: ("e", 0.9),
        scene=SimpleNamespace(time=TimeSection(**time)),
        step_dependent=True,
        resolving_step=np.inf,
        point_force=0.0,
        end_truncation_error=lambda columns: 0.0,
    )
    return StepControl(scenario, scenario.scene.time, modes or Spectrum(2.0 / LIMIT, 500.0, mass=1.0, points=100))


def run_to_the_end(control, excess, closing=0.0, peak=0.0):
    """What follows from a run whose worst imbalance is `excess` times the allowed one, at the end `closing` times."""
    columns = {"total": np.array([0.0, excess * WORST * 2.0, closing * CLOSING * 2.0])}
    return control.shorten_after_run(peak, columns)


def test_an_imbalance_shortens_the_step_as_order_2_asks():
    control = control_of()
    assert control.step.dt == DT
    assert not run_to_the_end(control, 0.9, closing=0.9) and control.attempt == 1
    # dt -> dt 0.9/sqrt(4): the error, of order 2, falls to 0.81 of what is allowed.
    assert run_to_the_end(control, 4.0) and control.attempt == 2
    assert control.step.dt == pytest.approx(0.45 * DT)
    assert run_to_the_end(far := control_of(sensitivity=10.0), 0.4) and far.step.dt == control.step.dt
    # Not where shorter steps leave the imbalance as it is, and not where a person has chosen the step.
    assert not run_to_the_end(control, 3.9)
    assert run_to_the_end(control, 0.9, closing=-1.5)
    assert not run_to_the_end(control_of(dt=DT), 100.0)


def test_a_harder_wall_than_estimated_is_met_with_its_measured_force():
    lattice, model = disk(60), damped(0.0)
    modes = spectrum(lattice, model)
    for what_follows in (partial(run_to_the_end, excess=0.0), StepControl.shorten_after_blow_up):
        control = control_of(model, modes)
        limits = {force: step_limit(modes, model, VV, force) for force in np.geomspace(1e-3, 1e3, 500)}
        peak = next(force for force, limit in limits.items() if control.step.dt > MARGIN * limit)
        assert what_follows(control, peak=peak) and control.step.limit == step_limit(modes, model, VV, 1.5 * peak)


def test_after_a_blow_up_the_step_is_halved_a_few_times():
    control = control_of()
    for number in range(1, BLOW_UPS + 1):
        assert control.shorten_after_blow_up(0.0) and control.step.dt == pytest.approx(0.5**number * DT)
    assert not control.shorten_after_blow_up(0.0)
    assert not control_of(dt=DT).shorten_after_blow_up(0.0)


@pytest.mark.parametrize(("tolerance", "error"), [(1e-4, 0.75e-4), (1e-6, FIRST / MOST**2)])
def test_the_next_step_is_as_long_as_the_tolerance_allows(tolerance, error):
    control = control_of(tolerance=tolerance)
    control.scenario.primary = lambda columns: ("e", 0.9 + control.step.dt**2)
    # The first one tells nothing by itself.
    assert run_to_the_end(control, 0.0) and control.step.dt == pytest.approx(DT / COMPARED)
    assert run_to_the_end(control, 0.0) and control.step.dt**2 * CAUTION == pytest.approx(error)


def test_a_result_is_out_of_tolerance_as_soon_as_its_estimated_error_exceeds_it():
    records = [RunRecord(VV, dt, 0.9 + dt**2) for dt in (1.2 * DT, DT)]
    for excess in (0.99, 1.01):
        control = control_of(tolerance=error_estimate(*records) / excess)
        control.records = records
        told = control.out_of_tolerance({})
        assert (told is None) == (excess < 1.0)
        assert told is None or "is estimated at" in told
    # What the result would still change by if the run went on is part of its error.
    control.scenario.end_truncation_error = lambda columns: 1e-3
    assert control.error({}) == pytest.approx(error_estimate(*records) + 1e-3)


def test_what_makes_a_result_doubtful_is_told():
    rows = {"total": np.array([0.0, 0.0, -1.1 * LARGEST * 2.0]), "sliding": np.array([0.0, 1.1 * LARGEST * 2.0, 0.0])}
    scenario = control_of().scenario
    lost, slid = diagnostics.warnings(scenario, rows)
    assert "imbalance is -0.0011 at the end" in lost and "slid from spring to spring" in slid
    assert diagnostics.warnings(scenario, {name: 0.8 * values for name, values in rows.items()}) == []


# ---- the first choice


def test_dashpots_are_solved_for_where_that_costs_less_than_the_steps_that_it_saves():
    # A step with the factor of 60 points costs 2.8 explicit ones, with that of a million points 11.6.
    for eta_star, saved, few, many in (
        (0.0, 1.0, VV, VV),
        (1.5, 2.03, VV, VV),
        (6.0, 6.3, TRAPEZOIDAL, VV),
        (20.0, 20.0, TRAPEZOIDAL, TRAPEZOIDAL),
    ):
        model = damped(eta_star / 60)
        own = spectrum(disk(60), model)
        implicit, explicit = (step_limit(own, model, way, 0.0) for way in (TRAPEZOIDAL, VV))
        assert implicit / explicit == pytest.approx(saved, rel=0.03)
        for points, expected in ((60, few), (1_000_000, many)):
            assert control_of(model, replace(own, points=points)).step.integrator is expected
        for name in ("velocity_verlet", "trapezoidal"):
            assert control_of(model, own, integrator=name).step.integrator is INTEGRATORS[name]


def test_the_elimination_order_keeps_the_factor_of_the_dashpots_sparse():
    # Minimum degree: some 15,000 entries for 1099 points (3,187 springs); in the points' own order, ten times that.
    lattice = disk_lattice(1099, 0)
    assert len(lattice.bonds) < len(factorise(lattice, damped(0.1), 0.01).row) < 20_000


@pytest.mark.parametrize("interval", [3e-3, 0.0777, 1.0])
def test_a_whole_number_of_steps_fits_the_reset_interval(interval):
    model = replace(FREE, boundary=ResetBoundary(interval))
    step = control_of(model).step
    count = interval / step.dt
    assert count == pytest.approx(round(count), abs=1e-9)
    assert step.dt <= 0.8 * step.limit * (1 + 1e-12)
    assert round(count) == 1 or interval / (round(count) - 1) > 0.8 * step.limit
    # What was taken, written as dt, is taken again, however the division was rounded.
    for part in range(1 + int(interval / LIMIT), 100):
        assert control_of(model, dt=interval / part).step.dt == interval / part


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
    soft = (*SMALL, "wall.a=30", "wall.V0=15", "lattice.seed=1")
    scenario, near = computed(kernels, *soft, "impact.gap=0.55", "time.tolerance=1e-3")
    _, far = computed(kernels, *soft, "time.tolerance=1e-7")
    off = abs(np.subtract(*(scenario.result(one.columns)["restitution"] for one in (near, far))))
    assert off <= near.facts["error_estimate"]["restitution"]
    with pytest.raises(SimulationError, match=r"due to where the run ends, at any step; a larger impact\.gap"):
        computed(kernels, *soft, "impact.gap=0.55", "time.tolerance=1e-8")


def test_a_tolerance_that_cannot_be_shown_is_a_failure_with_advice(monkeypatch, kernels):
    monkeypatch.setattr(step_control, "SEARCH", 2)
    with pytest.raises(SimulationError, match=r"the error of the result after 2 runs is .*write a larger"):
        computed(kernels, *SMALL[:2], "time.tolerance=1e-9", "impact.velocity=0.1")
