"""A tolerance for the headline: the run finds its step, and says how far it is off."""

from __future__ import annotations

import csv
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from worlds import computed

from taichi_disk import load_scene, run
from taichi_disk.dynamics import ROUNDING, Trial
from taichi_disk.errors import InputError, SimulationError
from taichi_disk.scene import TimeSection
from taichi_disk.scenes import build
from taichi_disk.time_step import TimeStep
from taichi_disk.tolerance import (
    CAUTION,
    LONGEST_FIRST,
    MOST,
    RATIO,
    REGULAR_CAUTION,
    UNRESOLVED_PART,
    Other,
    Tried,
    better_step,
    error_estimate,
    settles,
)

VV, VEFRL = "velocity_verlet", "vefrl"
SMALL = ("lattice.points=60", "material.eta_star=0", "impact.velocity=0.05")


def runs(integrator, steps, error):
    """Runs of a scene whose true headline is 0.9 and whose `error` is a function of the step."""
    return [Tried(integrator, dt, 0.9 + error(dt)) for dt in steps]


def test_the_estimate_is_exact_where_the_error_is_a_power_of_the_step():
    def square(h):
        return 3.0 * h**2

    assert error_estimate(runs(VV, [0.02], square)) is None
    # Two headlines cannot tell that it is one; the energy can.
    two = runs(VV, [0.02, 0.014], square)
    assert error_estimate(two) == pytest.approx(CAUTION * square(0.014), rel=1e-9)
    regular = [replace(one, imbalance=5.0 * one.dt**2) for one in two]
    assert error_estimate(regular) == pytest.approx(REGULAR_CAUTION * square(0.014), rel=1e-9)
    assert error_estimate(runs(VV, [0.02, 0.014, 0.009], square)) == pytest.approx(square(0.009), rel=1e-9)

    def fourth(h):
        return 3.0 * h**4

    assert error_estimate(runs(VEFRL, [0.02, 0.016, 0.01], fourth)) == pytest.approx(fourth(0.01), rel=1e-5)
    # Order 4 after two runs of order 2, whose extrapolation is exact here.
    assert error_estimate([*two, *runs(VEFRL, [0.03], fourth)], resolving=0.01) == pytest.approx(2.0 * fourth(0.03))


def test_an_energy_that_hardly_errs_vouches_for_the_first_run_of_order_4():
    """Whose error is one to three times that, whatever the runs before say; but only where it resolves the wall."""
    before = runs(VV, [0.02, 0.016], lambda h: 3.0 * h**2 + 50.0 * h**3)
    (high,) = runs(VEFRL, [0.03], lambda h: 0.0)
    high = replace(high, imbalance=1e-7)
    unknown = error_estimate([*before, high], resolving=0.029)
    assert unknown > 1e-5
    assert error_estimate([*before, high]) == pytest.approx(3.0 * 1e-7 / (2.0 * 0.9))  # e^2 is energy: 2 e de = dE
    between = replace(high, imbalance=unknown)  # more than once, less than three times what it tells
    assert error_estimate([*before, between]) == pytest.approx(unknown)
    assert error_estimate([*before, replace(high, imbalance=1e-3)]) == pytest.approx(1e-3 / (2.0 * 0.9))
    # Two of order 4 that agree by accident are not believed more than it.
    agreeing = [Tried(VEFRL, h, 0.9, imbalance=1e-6) for h in (0.03, 0.02)]
    assert error_estimate(agreeing) == pytest.approx(1e-6 / (2.0 * 0.9))
    # Neither are two of which none resolves the wall believed to have come nearer than they are apart.
    apart = runs(VEFRL, [0.03, 0.02], lambda h: 3.0 * h**4)
    assert error_estimate(apart, resolving=0.019) == pytest.approx(3.0 * (0.03**4 - 0.02**4))
    assert error_estimate(apart) == pytest.approx(CAUTION * 3.0 * 0.02**4)


@pytest.mark.parametrize("steps", [(0.8, 0.57, 0.5), (0.8, 0.57, 0.19), (0.8, 0.57, 0.4, 0.1)])
@pytest.mark.parametrize("power", [3, 4])
def test_a_next_power_of_the_step_is_never_missed_by_three_runs(steps, power):
    """Two runs may agree by accident, where the powers cancel: h^2 - h^4/(h_1^2 + h_2^2) has no error to see there."""
    cancelling = (steps[0] ** 2 - steps[1] ** 2) / (steps[0] ** power - steps[1] ** power)
    assert error_estimate(runs(VV, steps[:2], lambda h: h**2 - cancelling * h**power)) < 1e-12
    for part in [*np.linspace(-5.0, 5.0, 101), -cancelling]:

        def error(h, part=part):
            return h**2 + part * h**power

        assert error_estimate(runs(VV, steps, error)) >= (1.0 - 1e-9) * abs(error(steps[-1]))


def test_a_headline_that_jumps_about_does_not_pass_for_converged():
    """Errors that are random, and fall with the first power of the step as where contacts jump."""
    rng, covered = np.random.default_rng(1), []
    for _ in range(2000):
        found = [Tried(VV, h, 0.9 + h * rng.uniform(-1.0, 1.0)) for h in (0.8, 0.57, 0.4)]
        covered.append(error_estimate(found) >= abs(found[-1].headline - 0.9))
    assert np.mean(covered) > 0.9


def test_a_step_that_does_not_resolve_the_wall_is_judged_by_the_energy_too():
    agreeing = [Tried(VV, h, 0.9, imbalance=1e-3) for h in (0.02, 0.014, 0.009)]
    assert error_estimate(agreeing, resolving=0.01) == 0.0
    assert error_estimate(agreeing, resolving=0.008) == UNRESOLVED_PART * 1e-3
    step = TimeStep(VV, 0.025, 0.009)
    shorter = better_step(agreeing, 1e-6, step, resolving=0.008)
    assert 0.005 < shorter.dt <= 0.008


def test_the_next_step_is_as_long_as_the_tolerance_allows():
    limit = 0.02
    first, second = runs(VV, [0.016, 0.0128], lambda h: 3.0 * h**2)
    assert better_step([first], 1e-6, TimeStep(VV, limit, first.dt)).dt == pytest.approx(0.016 / RATIO)
    step = TimeStep(VV, limit, second.dt)
    longer = better_step([first, second], 3e-4, step, Other(VEFRL, 0.034, 4.0))
    assert longer.integrator == VV
    assert 3.0 * longer.dt**2 == pytest.approx(0.75 * 3e-4, rel=1e-9)
    # Not at one leap, unless the energy says that the power can be trusted so far.
    assert better_step([first, second], 2e-5, step).dt > second.dt / 3.0
    trusted = [replace(one, imbalance=one.dt**2) for one in (first, second)]
    assert 3.0 * better_step(trusted, 2e-5, step).dt ** 2 == pytest.approx(1.5e-5, rel=1e-9)


@pytest.mark.parametrize(("before", "other"), [(VV, Other(VEFRL, 0.034, 4.0)), ("trapezoidal", Other(VV, 0.002, 0.3))])
def test_another_integrator_is_taken_once_it_costs_less(before, other):
    """Order 4 in place of 2; explicit dashpots in place of implicit ones, where steps are short anyway."""
    tried = runs(before, [0.016, 0.0128], lambda h: 3.0 * h**2)
    step = TimeStep(before, 0.02, 0.0128)
    assert better_step(tried, 3e-4, step, other).integrator == before
    taken = better_step(tried, 1e-6, step, other)
    assert (taken.integrator, taken.dt) == (other.integrator, pytest.approx(LONGEST_FIRST * other.limit))
    assert better_step(tried, 1e-6, step).integrator == before
    # Order 4 at once, far below what the energy says of order 2.
    coarse = Tried(before, 0.016, 0.9, imbalance=1e-3)
    at_once = better_step([coarse], 1e-8, TimeStep(before, 0.02, 0.016), other)
    assert (at_once.integrator == VEFRL) == (other.integrator == VEFRL)
    # Where a step crosses much of the wall's decay length, the error is more of what is amiss with the energy.
    for resolving, hopeless in ((0.016, True), (0.16, False)):
        taken = better_step([coarse], 2e-6, TimeStep(before, 0.02, 0.016), other, resolving)
        assert (taken.integrator == VEFRL) == (hopeless and other.integrator == VEFRL)
    assert other.first(resolving=1e-4).dt == pytest.approx(2e-4)  # no longer than serves


def test_order_4_leaps_as_far_as_its_energy_says():
    for imbalance, shorter in ((1e-9, RATIO), (1.2e-5, 2.0), (1.0, MOST)):
        run = Tried(VEFRL, 0.03, 0.9, imbalance)
        step = better_step([run], 1e-6, TimeStep(VEFRL, 0.034, run.dt))
        assert run.dt / step.dt == pytest.approx(shorter)  # 16 x 0.75e-6 = 1.2e-5


def test_runs_that_differ_ever_more_do_not_settle():
    assert settles(runs(VV, [0.02, 0.014, 0.009], lambda h: h**2))
    assert not settles(runs(VV, [0.02, 0.014, 0.009], lambda h: 1.0 / h))


@pytest.mark.validate
def test_the_true_error_is_below_the_tolerance_and_the_work_below_three_times_the_best():
    """In random scenes of few points, whose truth is soon known; for more, `taichi_disk.study.tolerance_trial`."""
    from taichi_disk.study.tolerance_trial import Trials, trial_scene

    def quick(number):
        said = dict(setting.split("=") for setting in trial_scene(number)[1])
        return int(said["lattice.points"]) <= 60 and float(said["material.eta_star"]) <= 10.0

    trials = Trials()
    found = [trials.judge(number) for number in [n for n in range(60) if quick(n)][:20]]
    judged = [one for one in found if one.end in ("kept", "broken")]
    assert len(judged) >= 15
    assert [one for one in judged if one.end == "broken"] == []
    ratios = np.array([one.ratio for one in judged if one.crossed <= 1.0])
    assert np.median(ratios) <= 2.5
    assert np.mean(ratios <= 3.0) >= 0.75


def test_a_run_reports_the_error_it_estimates(tmp_path, capsys):
    from taichi_disk.report import print_result

    result = run(load_scene("exponential_wall", [*SMALL, "time.tolerance=1e-5"]), tmp_path, video=False)
    error = result.summary["error_estimate"]["restitution"]
    assert 0.0 < error <= 1e-5
    assert result.summary["attempts"] >= 2
    print_result(result)
    assert f"± {error:.1g} (time step)" in capsys.readouterr().out


def test_a_loose_tolerance_leaves_an_automatic_step_that_stands(tmp_path):
    """All that it adds is another run, and the error."""
    stands = ("lattice.points=300", "material.eta_star=0")
    plain = run(load_scene("exponential_wall", stands), tmp_path / "a", video=False)
    told = run(load_scene("exponential_wall", [*stands, "time.tolerance=1e-2"]), tmp_path / "b", video=False)
    assert told.headline["restitution"] == pytest.approx(plain.headline["restitution"], rel=1e-12)
    assert told.summary["steps"] == plain.summary["steps"]
    assert (plain.summary["attempts"], told.summary["attempts"]) == (1, 2)


def test_in_single_precision_the_estimate_holds_the_rounding(tmp_path):
    settings = [*SMALL, "time.tolerance=1e-4", "time.precision=f32"]
    result = run(load_scene("exponential_wall", settings), tmp_path, video=False)
    assert ROUNDING < result.summary["error_estimate"]["restitution"] <= 1e-4
    # Steps of 0.1 and 0.05 of the limit were off by up to 2.0e-6 and 2.4e-6 (eta* = 10 and 100, implicit dashpots).
    setup = SimpleNamespace(left_over=lambda columns: 0.0, depends_on_step=True, resolving_step=np.inf)
    for fraction, rounding in ((0.8, ROUNDING), (0.1, 5.0 * ROUNDING), (0.05, 10.0 * ROUNDING)):
        same = [Tried(VV, dt, 0.9, fraction=fraction) for dt in (0.02, 0.016)]
        trial = Trial(TimeSection(tolerance=1e-5, precision="f32"), 0.0, tried=tuple(same))
        assert trial.error(setup, {}) == pytest.approx(rounding, rel=1e-12)


@pytest.mark.usefixtures("taichi")
def test_steps_are_aimed_at_what_rounding_and_the_end_leave_of_the_tolerance():
    # Rounding is taken for 4e-7 or more: aimed at 0.75e-6 without it, no run would be within 1e-6.
    settings = ("exponential_wall", "lattice.points=60", "time.precision=f32", "time.tolerance=1e-6")
    facts = computed(*settings, "material.eta_star=0")[1].facts
    assert ROUNDING < facts["error_estimate"]["restitution"] <= 1e-6 and facts["attempts"] <= 5
    # Implicit dashpots need steps so short that rounding alone is more; that is seen before the eighth run.
    with pytest.raises(SimulationError, match=r"after [2-7] runs .* of it is rounding; write time\.precision: f64"):
        computed(*settings, "lattice.points=80", "material.eta_star=10")


@pytest.mark.usefixtures("taichi")
def test_a_ledger_that_only_the_tolerance_allows_is_told():
    hard = ("lattice.points=60", "material.eta_star=10", "wall.a=30000", "impact.velocity=0.05")
    facts = computed("exponential_wall", *hard, "time.tolerance=1e-2")[1].facts
    assert 1e-3 < abs(facts["energy"]["closing_imbalance"]) <= 1e-2
    assert any("which time.tolerance = 0.01 allows" in text for text in facts["warnings"])


@pytest.mark.usefixtures("taichi")
def test_a_compression_rests_within_the_tolerance_of_newtons_method():
    """By itself it would be at rest, to its own tolerance, when the last of the roll still changes xi by 9e-7 R."""
    settings = ["compression", "lattice.points=60", "lattice.seed=9162", "wall.a=44", "wall.V0=22"]
    settings += ["compression.pressure=4e-3", "material.k_a=0.76", "material.eta_star=68"]
    setup, outcome = computed(*settings, "time.tolerance=1e-7")
    error = outcome.facts["error_estimate"]["xi"]
    assert 0.0 < error <= 1e-7
    newton = build(load_scene(settings[0], [*settings[1:], "compression.method=newton"]))
    y = newton.rest.positions[:, 1]
    assert setup.headline(outcome.columns).values["xi"] == pytest.approx(
        newton.unloaded - float(y.mean() - y.min()), abs=1e-7
    )
    # At rest by itself at t = 1501 R/c, within the tolerance at 1686 R/c.
    with pytest.raises(SimulationError, match=r"xi is still .* from that of Newton's method.*time\.tolerance"):
        computed(*settings, "time.tolerance=1e-7", "compression.max_time=1600")
    with pytest.raises(SimulationError, match=r"not at rest.*max_time higher, or material\.eta_star"):
        computed(*settings, "time.tolerance=1e-7", "compression.max_time=200")


@pytest.mark.validate
def test_what_the_wall_still_holds_when_the_run_ends_is_part_of_the_error(tmp_path):
    settings = [*SMALL, "wall.a=30", "wall.V0=15", "lattice.seed=1"]
    near = run(load_scene("exponential_wall", [*settings, "impact.gap=0.55", "time.tolerance=1e-3"]), tmp_path / "a")
    far = run(load_scene("exponential_wall", [*settings, "time.tolerance=1e-7"]), tmp_path / "b", video=False)
    off = abs(near.headline["restitution"] - far.headline["restitution"])
    assert off <= near.summary["error_estimate"]["restitution"]
    with pytest.raises(SimulationError, match=r"left over where a run ends, at any step; a larger impact\.gap"):
        run(load_scene("exponential_wall", [*settings, "impact.gap=0.55", "time.tolerance=1e-8"]), tmp_path / "c")


def test_a_tolerance_that_cannot_be_shown_is_a_failure_with_advice(tmp_path, monkeypatch):
    from taichi_disk import dynamics

    monkeypatch.setattr(dynamics, "ATTEMPTS", 2)
    scene = load_scene("exponential_wall", ["lattice.points=60", "time.tolerance=1e-9", "impact.velocity=0.1"])
    with pytest.raises(SimulationError, match=r"the error of the headline after 2 runs is .*; write a larger"):
        run(scene, tmp_path, video=False)


def test_the_points_of_a_sweep_tell_their_errors(tmp_path):
    from taichi_disk.scene_file import load_sweep
    from taichi_disk.study.sweep import run_sweep

    (tmp_path / "s.yaml").write_text(
        "scene: exponential_wall\nlattice: {points: 60}\ntime: {tolerance: 1.0e-5}\nsweep: {velocity: [0.02, 0.05]}\n"
    )
    result = run_sweep(load_sweep(tmp_path / "s.yaml", ()), tmp_path / "out", jobs=1)
    with (result.out / "points.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert all(0.0 < float(row["error_estimate"]) <= 1e-5 for row in rows)


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        (["exponential_wall", "time.dt=0.001"], "finds the step itself"),
        (["exponential_wall", "time.precision=f32"], "rounding alone"),
        (["compression", "compression.method=newton"], "takes no time step"),
    ],
)
def test_a_tolerance_that_makes_no_sense_is_refused(settings, why):
    with pytest.raises(InputError, match=why):
        load_scene(settings[0], [*settings[1:], "time.tolerance=1e-7"])
