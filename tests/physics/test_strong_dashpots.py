"""Dashpots so strong that a step is long beside their own time, where points move against each other from the start."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import advance, chain, computed
from reference import Model

from taichi_disk.integrators import TRAPEZOIDAL
from taichi_disk.physics import Model as Laws
from taichi_disk.physics import Springs

LONG = pytest.mark.validate


@pytest.mark.parametrize(
    ("points", "eta_star", "spin"),
    [(22, 300, 0.3), pytest.param(30, 2000, -0.1, marks=LONG), pytest.param(150, 100, 0.05, marks=LONG)],
)
def test_a_disk_that_spins_beside_strong_dashpots_meets_its_estimate(points, eta_star, spin, kernels):
    settings = f"lattice.points={points}", f"material.eta_star={eta_star}", f"impact.spin={spin}"
    scenario, outcome = computed(kernels, "exponential_wall", "impact.velocity=0.05", *settings)
    lattice, end = scenario.lattice, outcome.columns["t"][-1]
    assert outcome.facts["integrator"] == "trapezoidal" and outcome.facts["steps"] < 2000
    _, (_, v) = Model(lattice, scenario.model).solve(lattice.positions, scenario.velocities, (0.0, end), 1e-8)
    e = scenario.result(outcome.columns)["restitution"]
    assert abs(e - v[:, 1].mean() / 0.05) < outcome.facts["error_estimate"]["restitution"] < 2e-3
    assert abs(outcome.facts["energy"]["worst_imbalance"]) < 1e-3


def test_the_balance_of_a_free_disk_with_dashpots_is_exact_at_any_step_for_linear_springs(kernels):
    # What leapfrog keeps is E - h^2/(8 m) f.F; at rest at the end nothing of that is left.
    rod = chain([[-0.5, 0.0], [0.5, 0.0]], [[0, 1]], 0.5)
    velocities = np.array([[0.1, 0.0], [-0.1, 0.0]])  # along the spring: its force is linear
    simulation = kernels.simulation(rod, Laws(Springs(1.0, 0.0, 40.0)), TRAPEZOIDAL, velocities, 0.5)
    columns = advance(simulation, 4000, 4000)
    assert columns["dissipated"][-1] == pytest.approx(columns["kinetic"][0], rel=1e-12)
