"""How far a result is off for its time step, by another run: exact for powers, careful elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import computed

from taichi_disk.computation.step_control import CAUTION, UNRESOLVED_PART, RunRecord, error_estimate
from taichi_disk.integrators import VEFRL, VELOCITY_VERLET

SMALL = ("exponential_wall", "lattice.points=30", "lattice.seed=1", "material.eta_star=0")
HARD = (*SMALL, "wall.a=3000", "wall.V0=1500", "impact.velocity=0.1")


@pytest.mark.parametrize("integrator", [VELOCITY_VERLET, VEFRL])
@pytest.mark.parametrize("other", [0.02, 0.007], ids=["longer", "shorter"])
def test_the_estimate_is_exact_where_the_error_is_a_power_of_the_step(integrator, other):
    runs = [RunRecord(integrator, dt, 0.9 + 3.0 * dt**integrator.order) for dt in (other, 0.014)]
    assert error_estimate(*runs) == pytest.approx(CAUTION * 3.0 * 0.014**integrator.order, rel=1e-5)


def test_a_step_that_does_not_resolve_the_wall_is_judged_by_the_energy_too():
    for resolving, expected in ((0.01, 0.0), (0.008, UNRESOLVED_PART * 1e-3)):
        agreeing = [RunRecord(VELOCITY_VERLET, dt, 0.9, 1e-3, dt / resolving) for dt in (0.014, 0.009)]
        assert error_estimate(*agreeing) == expected


def truth(kernels, *settings):
    """e with steps so short that its error of order 4 is below 1e-7."""
    fine = ("time.integrator=vefrl", "time.safety=0.05")
    scenario, outcome = computed(kernels, *settings, *fine, estimate=False)
    return scenario.result(outcome.columns)["restitution"]


def test_a_step_as_long_as_the_wall_is_soft_is_not_told_to_be_better_than_it_is(kernels):
    # In a step of 3.3e-3 R/c the disk flies over the wall's decay length 1/a. Results of two such steps may agree by
    # chance: Richardson's estimate, enlarged by CAUTION, is three quarters of the true error here.
    scenario, outcome = computed(kernels, *HARD, "time.dt=0.00327")
    off = abs(scenario.result(outcome.columns)["restitution"] - truth(kernels, *HARD))
    assert off <= outcome.facts["error_estimate"]["restitution"] < 5e-3


@pytest.mark.parametrize("spin", [0.0, 0.3])
def test_where_a_step_does_not_resolve_the_wall_the_estimate_is_half_the_worst_imbalance_at_least(spin, kernels):
    # Over the kinetic energy K of the flight; of a spin, whose energy is in E, over sqrt(E K).
    scenario, outcome = computed(kernels, *HARD, f"impact.spin={spin}", "time.dt=0.00327")
    flight, whole = 0.5 * 0.1**2, 0.5 * (scenario.velocities**2).sum() / 30
    lost = np.abs(outcome.columns["total"] - outcome.columns["total"][0]).max()
    assert outcome.facts["error_estimate"]["restitution"] >= 0.499 * lost / np.sqrt(whole * flight)


def test_a_fast_spin_leaves_the_restitution_as_good_as_none(kernels):
    # It holds three thousand times the energy of the flight.
    settings = (*SMALL, "impact.velocity=0.01", "impact.spin=1", "impact.gap=0.128")
    scenario, outcome = computed(kernels, *settings, estimate=False)
    assert scenario.result(outcome.columns)["restitution"] == pytest.approx(truth(kernels, *settings), abs=5e-5)
