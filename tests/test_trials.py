"""When an automatic step is shortened and tried again, and when it stands."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from taichi_disk.dynamics import CLOSING, MARGIN, OPEN, WORST, Trial, next_trial, slid, unclosed
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import Spectrum
from taichi_disk.scene import TimeSection
from taichi_disk.time_step import TimeStep
from taichi_disk.tolerance import Tried

# What next_trial asks of a setup.
SETUP = SimpleNamespace(energy_scale=lambda columns: 2.0, physics=Physics(wall="none"))
STEP = TimeStep("velocity_verlet", limit=0.02, dt=0.016)


def modes(limit: float) -> Spectrum:
    """Of a disk for which that is the stability limit of leapfrog [R/c], whatever the wall does."""
    return Spectrum(omega=2.0 / limit, damping=0.0, mass=1.0, points=100)


def tried(excess: float, before: float = float("inf"), **time) -> Trial | None:
    """After a run whose worst imbalance is `excess` times the allowed one."""
    total = np.array([0.0, excess * WORST * 2.0, 0.0])
    trial = Trial(TimeSection(**time), point_force=0.1, excess=before)
    return next_trial(trial, SETUP, STEP, modes(0.02), peak=0.1, columns={"total": total})


def test_a_closed_ledger_lets_the_step_stand() -> None:
    assert tried(0.9) is None
    closing = np.array([0.0, 3 * CLOSING * 2.0])
    assert next_trial(Trial(TimeSection(), 0.1), SETUP, STEP, modes(0.02), 0.1, {"total": closing}) is not None


def test_an_open_ledger_shortens_the_step_as_order_2_asks() -> None:
    following = tried(4.0)
    assert following is not None
    # dt -> dt 0.9/sqrt(4): the error, of order 2, falls to 0.81 of what is allowed.
    assert following.time.safety * STEP.limit == pytest.approx(0.45 * STEP.dt)
    assert following.excess == pytest.approx(4.0)


def test_an_imbalance_that_shorter_steps_leave_as_it_is_ends_the_trials() -> None:
    assert tried(4.0, before=4.1) is None
    assert tried(4.0, before=20.0) is not None


def test_a_harder_wall_than_estimated_is_met_with_its_measured_force() -> None:
    measured = modes(0.99 * STEP.dt / MARGIN)
    following = next_trial(Trial(TimeSection(), 0.1), SETUP, STEP, measured, 0.4, {"total": np.zeros(2)})
    assert following is not None and following.point_force == pytest.approx(0.6)


def test_a_step_given_by_hand_stands() -> None:
    assert tried(100.0, dt=0.016) is None


def test_after_a_blow_up_the_step_is_halved() -> None:
    following = next_trial(Trial(TimeSection(), 0.1), SETUP, STEP, modes(0.02), 0.1, None)
    assert following is not None and following.time.safety * STEP.limit == pytest.approx(0.5 * STEP.dt)


def test_what_a_shorter_step_seldom_mends_is_tried_once_more() -> None:
    following = next_trial(Trial(TimeSection(), 0.1), SETUP, STEP, modes(0.02), 0.1, None, True)
    assert following is not None and following.time.safety * STEP.limit == pytest.approx(0.5 * STEP.dt)
    assert next_trial(following, SETUP, STEP, modes(0.02), 0.1, None, True) is None
    assert next_trial(following, SETUP, STEP, modes(0.02), 0.1, None, False) is not None


@pytest.mark.parametrize(
    ("eta", "boundary", "taken"),
    [(0.0, "none", "vefrl"), (1.0, "none", "velocity_verlet"), (1.0, "reset", "auto")],
)
def test_a_tolerance_changes_the_integrator_where_another_costs_less(eta: float, boundary: str, taken: str) -> None:
    """Not beside a reset boundary, where explicit dashpots were seen to err far more than implicit ones."""
    setup = SimpleNamespace(
        physics=Physics(wall="none", eta=eta, boundary=boundary),
        energy_scale=SETUP.energy_scale,
        scene=SimpleNamespace(time=TimeSection(tolerance=1e-8)),
        depends_on_step=True,
        resolving_step=np.inf,
        left_over=lambda columns: 0.0,
    )
    present = replace(STEP, integrator="trapezoidal" if eta else "velocity_verlet")
    runs = tuple(Tried(present.integrator, dt, 0.9 + dt**2) for dt in (1.2 * STEP.dt, STEP.dt))
    spectrum = replace(modes(0.02), damping=500.0)
    trial = Trial(TimeSection(tolerance=1e-8), 0.1, tried=runs)
    following = next_trial(trial, setup, present, spectrum, 0.1, {"total": np.zeros(2)})
    assert following is not None and following.time.integrator == taken


def test_a_ledger_that_stays_open_is_told_with_what_may_help() -> None:
    for dt, helps in (("auto", "a shorter step did not help"), (0.01, "time.dt: auto")):
        scene = SimpleNamespace(time=TimeSection(dt=dt))
        setup = SimpleNamespace(energy_scale=SETUP.energy_scale, scene=scene)
        for excess, told in ((0.9, False), (1.1, True)):
            text = unclosed(setup, {"total": np.array([0.0, 0.0, -excess * OPEN * 2.0])})
            assert bool(text) == told
            if text:
                assert "off by -0.0011 at the end" in text and helps in text


def test_energy_that_sliding_changed_is_told() -> None:
    for part, told in ((0.9, False), (-1.1, True)):
        assert bool(slid(SETUP, {"sliding": np.array([0.0, part * OPEN * 2.0, 0.0])})) == told
