"""Dashpots that relax within a step, in bodies that vibrate from the start."""

import numpy as np
import pytest
from bodies import advance, computed
from reference import Model

from taichi_disk.mechanics.integrators import TRAPEZOIDAL
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.physics import Model as Laws, Springs

LONG = pytest.mark.validate


@LONG
@pytest.mark.parametrize(
    ("points", "eta_star", "spin", "velocity", "most"),
    [
        (20, 40, 0.5, 0.02, 1e-4),
        (22, 300, 0.3, 0.05, 2e-3),
        (30, 2000, -0.1, 0.05, 2e-3),
    ],
)
def test_a_disk_that_spins_beside_strong_dashpots_meets_its_estimate(
    points, eta_star, spin, velocity, most, kernels
):
    settings = (f"lattice.points={points}", f"material.eta_star={eta_star}")
    settings += (f"impact.spin={spin}", f"impact.velocity={velocity}")
    scenario, outcome = computed(kernels, "exponential_wall", *settings)
    lattice = scenario.lattice
    end = outcome.series["t"][-1]
    assert outcome.summary["integrator"] == "trapezoidal"
    assert outcome.summary["steps"] < 2000
    _, (_, v) = Model(lattice, scenario.model).solve(
        lattice.positions, scenario.velocities, (0.0, end), 1e-10, "LSODA"
    )
    e = scenario.result(outcome.series)["restitution"]
    error = abs(e - v[:, 1].mean() / velocity)
    assert error < outcome.summary["error_estimate"]["restitution"] < most
    energy = outcome.summary["energy"]
    assert abs(energy["worst_imbalance"]) < 1e-3
    assert energy["scale"] == pytest.approx(
        0.5 * (scenario.velocities**2).sum() / points, rel=1e-12
    )


@pytest.mark.parametrize(
    ("mass", "stretch"),
    [
        (0.5, 0.1),
        pytest.param(0.5, 0.0, marks=LONG),
        pytest.param(0.1, 0.1, marks=LONG),
    ],
)
def test_the_balance_of_linear_damped_springs_is_always_exact(mass, stretch, kernels):
    # Leapfrog conserves E - h^2/(8 m) f.F, whose second term is 0 at rest.
    masses = np.array([mass, 1.0 - mass])
    rod = Lattice(
        positions=np.array([[-0.5, 0.0], [0.5, 0.0]]),
        bonds=np.array([[0, 1]], np.int32),
        rest_lengths=np.array([1.0 - stretch]),
        masses=masses,
        triangles=np.zeros((0, 3), np.int32),
        disk_points=2,
        disk_surface=np.arange(2, dtype=np.int32),
    )
    # along the spring: its force is linear
    velocities = np.array([[0.05, 0.0], [-0.05, 0.0]]) / masses[:, None]
    simulation = kernels.simulation(
        rod, Laws(Springs(1.0, 0.0, 40.0)), TRAPEZOIDAL, velocities, 0.5
    )
    columns = advance(simulation, 4000, 4000)
    assert columns["dissipated"][-1] == pytest.approx(
        columns["kinetic"][0] + columns["elastic"][0], rel=1e-12
    )
