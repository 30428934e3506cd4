"""A tolerance for the restitution: the run finds its step, and says how far it is off."""

from __future__ import annotations

import numpy as np
import pytest
from reference import Model
from worlds import computed

from taichi_disk import load_scene, run
from taichi_disk.errors import InputError, SimulationError
from taichi_disk.time_step import TimeStep
from taichi_disk.tolerance import Tried, better_step, error_estimate

VV, TRAPEZOIDAL, VEFRL = "velocity_verlet", "trapezoidal", "vefrl"
FORCES = {VV: 1.0, TRAPEZOIDAL: 3.2, VEFRL: 4.0}  # cost of a step


def follows(integrator, dt, order, true=0.9, factor=3.0):
    return Tried(integrator, dt, true + factor * dt**order)


def test_the_estimate_is_exact_where_the_error_is_a_power_of_the_step():
    two = [follows(VV, 0.02, 2), follows(VV, 0.016, 2)]
    assert error_estimate(two[:1]) is None
    assert error_estimate(two) == pytest.approx(3.0 * 0.016**2, rel=1e-9)
    four = [follows(VEFRL, 0.02, 4), follows(VEFRL, 0.016, 4)]
    assert error_estimate(four) == pytest.approx(3.0 * 0.016**4, rel=1e-6)
    # Order 4 after two runs of order 2, whose extrapolation is exact here.
    assert error_estimate([*two, four[0]]) == pytest.approx(3.0 * 0.02**4, rel=1e-6)


def test_the_next_step_is_as_long_as_the_tolerance_allows():
    limit = 0.02
    first, second = follows(VV, 0.016, 2), follows(VV, 0.0128, 2)
    step = TimeStep(VV, limit, second.dt)
    assert better_step([first], 1e-6, TimeStep(VV, limit, first.dt), True).dt == pytest.approx(0.0128)
    assert better_step([first, second], 1e-3, step, True) is None
    slower = better_step([first, second], 4e-4, step, True)
    assert slower.integrator == VV
    assert 3.0 * slower.dt**2 == pytest.approx(0.7 * 4e-4, rel=1e-9)
    # A tenth of the step is better made as a step of order 4, where that is allowed.
    assert better_step([first, second], 1e-6, step, True).integrator == VEFRL
    assert better_step([first, second], 1e-6, step, False).integrator == VV


def scenes(count):
    """Random impacts of 100 points at the paper's speeds: (settings, tolerance)."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        kind = rng.choice(["rigid", "reset", "pinned", "dashpot"], p=[0.55, 0.15, 0.15, 0.15])
        eta = 0.0 if rng.random() < 0.5 else 10 ** rng.uniform(0.0, 2.0)
        settings = [
            "lattice.points=100",
            f"lattice.seed={rng.integers(1000)}",
            f"impact.velocity={10 ** rng.uniform(-2.5, -1.3):.4f}",
            f"material.eta_star={eta:.3f}",
            f"wall.a={rng.choice([100.0, 300.0, 600.0])}",
        ]
        if rng.random() < 0.3:
            settings += ["lattice.rim=false", "lattice.min_spacing=0.0"]
        if kind == "rigid":
            settings.insert(0, "exponential_wall")
        else:
            settings.insert(0, "absorbing_wall")
            settings += [f"wall.boundary={kind}", "wall.points=120", "wall.width=3.0", "wall.threshold=0.4"]
        if kind == "reset":
            settings.append("wall.reset_interval=0.05")
        yield settings, 10 ** rng.uniform(-6.5, -4.0)


def restitution(setup, outcome):
    return outcome.columns["com_vy"][-1] / setup.velocity


def true_restitution(settings, setup, outcome, kept):
    """By DOP853 on the reference's own forces; over an elastic wall, whose contacts pass from spring to spring with
    a jump that DOP853 cannot step over, by fine steps (test_convergence.py holds those against DOP853)."""
    if settings[0] == "absorbing_wall":
        damped = setup.physics.damped
        fine = [f"time.safety={0.03 if damped else 0.2}", f"time.integrator={TRAPEZOIDAL if damped else VEFRL}"]
        return restitution(*computed(*settings, *fine, kept=kept))
    model = Model.of(setup.lattice, setup.physics)
    _, v = model.solve(setup.lattice.positions, setup.velocities, outcome.columns["t"][-1], rtol=1e-9)
    return v[:, 1].mean() / setup.velocity


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
def test_the_true_error_is_below_the_tolerance_in_95_of_100_scenes():
    from taichi_disk.view.worlds import Worlds

    within, kept = [], Worlds(lambda: None)
    for settings, tolerance in scenes(20):
        setup, outcome = computed(*settings, f"time.tolerance={tolerance:.3g}", kept=kept)
        true = true_restitution(settings, setup, outcome, kept)
        within.append(abs(restitution(setup, outcome) - true) <= tolerance)
    assert np.mean(within) >= 0.95


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize("eta_star", [0.0, 100.0])
def test_a_tolerance_costs_at_most_three_times_the_best_step_by_hand(monkeypatch, eta_star):
    from taichi_disk import dynamics
    from taichi_disk.view.worlds import Worlds

    work, kept = [], Worlds(lambda: None)
    simulate = dynamics.simulate

    def counted(setup, world, step, *rest):
        result = simulate(setup, world, step, *rest)
        work.append(result.end.step * FORCES[step.integrator])
        return result

    monkeypatch.setattr(dynamics, "simulate", counted)
    settings = ["exponential_wall", "lattice.points=200", f"material.eta_star={eta_star}"]
    fine, precise = (0.02, TRAPEZOIDAL) if eta_star else (0.2, VEFRL)
    true = restitution(*computed(*settings, f"time.safety={fine}", f"time.integrator={precise}", kept=kept))
    by_hand = []  # (error, work)
    for integrator in (TRAPEZOIDAL,) if eta_star else (VV, VEFRL):
        for safety in 0.95 * 0.75 ** np.arange(9):
            work.clear()
            one = computed(*settings, f"time.safety={safety}", f"time.integrator={integrator}", kept=kept)
            by_hand.append((abs(restitution(*one) - true), work[-1]))
    for tolerance in (1e-4, 1e-5, 1e-6) if eta_star else (1e-4, 1e-5, 1e-6, 1e-7):
        work.clear()
        setup, outcome = computed(*settings, f"time.tolerance={tolerance}", kept=kept)
        assert abs(restitution(setup, outcome) - true) <= tolerance
        assert sum(work) <= 3.0 * min(cost for error, cost in by_hand if error <= tolerance)


def test_a_run_reports_the_error_it_estimates(tmp_path, capsys):
    from taichi_disk.report import print_result

    scene = load_scene(
        "exponential_wall", ["lattice.points=60", "material.eta_star=0", "impact.velocity=0.05", "time.tolerance=1e-5"]
    )
    result = run(scene, tmp_path, video=False)
    error = result.summary["error_estimate"]["restitution"]
    assert 0.0 < error <= 1e-5
    assert result.summary["attempts"] >= 2
    print_result(result)
    assert f"± {error:.1g} (time step)" in capsys.readouterr().out


def test_a_tolerance_that_cannot_be_shown_is_a_failure_with_advice(tmp_path, monkeypatch):
    from taichi_disk import dynamics

    monkeypatch.setattr(dynamics, "ATTEMPTS", 2)
    scene = load_scene("exponential_wall", ["lattice.points=60", "time.tolerance=1e-9", "impact.velocity=0.1"])
    with pytest.raises(SimulationError, match=r"error of the headline is estimated at .* write a larger one"):
        run(scene, tmp_path, video=False)


@pytest.mark.parametrize(
    ("settings", "why"),
    [
        (["exponential_wall", "time.dt=0.001"], "finds the step itself"),
        (["exponential_wall", "time.precision=f32"], "rounding alone"),
        (["compression"], "does not depend on the time step"),
    ],
)
def test_a_tolerance_that_makes_no_sense_is_refused(settings, why):
    with pytest.raises(InputError, match=why):
        load_scene(settings[0], [*settings[1:], "time.tolerance=1e-7"])
