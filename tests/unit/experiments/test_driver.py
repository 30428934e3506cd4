"""The loop over time: launches, the end of a scene, restarts, failures, messages."""

import numpy as np
import pytest
from bodies import SMALL, computed, driver_of, drivers_of, words
from numpy.testing import assert_array_equal

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.computation import driver
from taichi_disk.experiments.computation.diagnostics import (
    LostBalance,
    inverted_triangles,
)
from taichi_disk.experiments.scenes.impact import ImpactScenario
from taichi_disk.mechanics.simulation.observables import as_columns
from tests.validation.hard_cases import FAST_SPIN, FOLDING

COMPRESSION = pytest.param("compression", marks=pytest.mark.validate)
IMPACT = words("exponential_wall lattice.points=60 material.eta_star=0 time.safety=0.3")
SCENES = {
    "impact": IMPACT,
    "compression": ("compression", *SMALL, "compression.tolerance=1e-3"),
    "elastic wall": words(
        "absorbing_wall lattice.points=60 wall.points=80 wall.width=3.0"
    ),
}


@pytest.mark.parametrize("name", ["impact", "elastic wall", COMPRESSION])
def test_steps_are_as_reported_and_launches_leave_no_trace(name, kernels, monkeypatch):
    whole = driver_of(kernels, *SCENES[name])
    assert whole.advance() == "finished"
    columns = whole.columns
    state = whole.end
    assert state.step == whole.stride * (len(columns["t"]) - 1)
    summary = computed(kernels, *SCENES[name], estimate=False)[1].summary
    assert (summary["steps"], summary["dt"]) == (state.step, whole.step.dt)
    assert summary["attempts"] == 1
    # Launches of a few steps give bitwise the same end.
    monkeypatch.setattr(driver, "SPRINGS_PER_LAUNCH", 20_000)
    short = driver_of(kernels, *SCENES[name])
    assert short.advance(steps=11) == "running"
    assert short.simulation.step_number == 11
    early = short.state, short.row
    assert short.advance(seconds=0.0) == "running"
    assert 11 < short.simulation.step_number < 0.9 * state.step
    for is_again in (False, True):
        if is_again:
            short.back_to(*early)
            assert (short.status, short.count) == ("running", 1 + 11 // short.stride)
        while short.advance(steps=777) == "running":
            pass
        assert short.status == "finished"
        assert_array_equal(short.end.vectors, state.vectors)
        for key, column in columns.items():
            assert_array_equal(short.columns[key], column)
    # it stays finished
    assert short.advance(steps=5) == "finished"
    assert short.simulation.step_number == state.step


def test_a_wall_harder_than_foreseen_makes_the_step_shorter_until_it_holds(kernels):
    # Points rattle between disk and wall.
    hard = (*IMPACT, "time.safety=0.8", "wall.a=3000", "impact.velocity=0.1")
    drivers = drivers_of(kernels, *hard)
    steps = [driver.step.dt for driver in drivers]
    assert drivers[-1].status == "finished"
    assert len(steps) > 1
    assert (np.diff(steps) < 0.0).all()
    summary = computed(kernels, *hard, estimate=False)[1].summary
    assert (summary["attempts"], summary["steps"]) == (len(steps), drivers[-1].end.step)
    assert summary["dt"] <= 0.95 * summary["dt_limit"]
    assert summary["warnings"] == []
    assert abs(summary["energy"]["closing_imbalance"]) < 2e-5
    assert summary["energy"]["worst_imbalance"] < 1e-4


def test_a_step_beyond_the_limit_is_refused_with_the_limit_named_unless_forced(kernels):
    limit = driver_of(kernels, *IMPACT).step.limit
    with pytest.raises(InputError, match=f"{limit:.6g} R/c.*--force"):
        driver_of(kernels, *IMPACT, f"time.dt={1.001 * limit}")
    for dt, force in ((0.999 * limit, False), (1.5 * limit, True)):
        assert driver_of(kernels, *IMPACT, f"time.dt={dt}", force=force).step.dt == dt


def test_the_end_of_a_hovering_rod_is_asked_a_few_times(kernels, monkeypatch, tmp_path):
    # A rod that turns faster than it rises must clear the wall by its whole length.
    asked = []
    plain = ImpactScenario.time_to_end

    def counted(scenario, columns):
        asked.append(plain(scenario, columns))
        return asked[-1]

    monkeypatch.setattr(ImpactScenario, "time_to_end", counted)
    axes = np.linspace(-1.0, 1.0, 17), np.linspace(-0.15, 0.15, 5)
    rod = np.stack(np.meshgrid(*axes), axis=-1).reshape(-1, 2)
    np.savetxt(tmp_path / "rod.csv", rod, delimiter=",")
    own = ("exponential_wall", f"lattice.file={tmp_path / 'rod.csv'}")
    throw = ("material.eta_star=0", "impact.turn=0.8", "impact.velocity=0.05")
    driver = driver_of(kernels, *own, *throw)
    assert driver.advance() == "finished"
    assert asked[0] > 300.0 * driver.interval
    assert len(asked) < 20
    # It has not ended much later than it could.
    earlier = {name: values[[-3]] for name, values in driver.columns.items()}
    assert driver.scenario.time_to_end(driver.columns) == 0.0
    assert plain(driver.scenario, earlier) > 0.0


def test_a_falling_disk_copies_two_rows_to_ask_for_its_end(kernels, monkeypatch):
    def of_two(rows, interval):
        assert len(rows) == 2
        return as_columns(rows, interval)

    monkeypatch.setattr(driver, "as_columns", of_two)
    falls = words("impact.velocity=0.05 impact.gravity=5e-3 impact.bounces=2")
    assert driver_of(kernels, *IMPACT, *falls, "time.dt=0.018").advance() == "finished"


def test_a_run_whose_balance_is_lost_fails_if_its_step_was_chosen(kernels, monkeypatch):
    monkeypatch.setattr(driver, "unacceptable", lambda *_: "it is lost")
    failed = driver_of(kernels, *IMPACT)
    assert failed.advance() == "failed"
    assert isinstance(failed.failure, LostBalance)
    assert str(failed.failure) == "it is lost"
    given = driver_of(kernels, *IMPACT, f"time.dt={failed.step.dt}")
    assert given.advance() == "finished"


def test_triangles_are_counted_in_every_row_with_and_without_an_estimate(kernels):
    # None is inverted at the greatest compression, some are a little later.
    folding = words(f"exponential_wall {FOLDING}")
    scenario, outcome = computed(kernels, *folding, estimate=False)
    series = outcome.series
    counted = [
        inverted_triangles(scenario.lattice, state.positions)
        for state in outcome.replay(series["t"][::5])
    ]
    assert series["inverted"][::5].tolist() == counted
    assert series["inverted"][series["t"].searchsorted(outcome.contact.greatest)] == 0
    assert outcome.summary["inverted_triangles"] == max(series["inverted"]) > 1
    assert any("turned inside out" in text for text in outcome.summary["warnings"])


def test_rows_follow_the_surface_of_a_fast_spin_on_a_slow_flight(kernels):
    settings = words(f"exponential_wall {FAST_SPIN}")
    scenario, outcome = computed(kernels, *settings)
    errors = outcome.summary["error_estimate"]
    # 0.27 and 0.012 if rows follow the centre alone
    assert errors["contact_time"] < 1e-3
    assert errors["spin_after"] < 1e-4
    finer = f"time.sample_interval={scenario.row_interval / 4}"
    _, closer = computed(kernels, *settings, finer, estimate=False)
    numbers = scenario.result(closer.series)
    for name in ("contact_time", "spin_after"):
        error = abs(numbers[name] - outcome.summary[name])
        assert error <= errors[name], name
