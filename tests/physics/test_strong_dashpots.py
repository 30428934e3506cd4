"""Dashpots so strong that a step is longer than their relaxation time, in bodies that
vibrate from the start."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import advance, chain, computed
from reference import Model

from taichi_disk.errors import InputError
from taichi_disk.integrators import TRAPEZOIDAL
from taichi_disk.physics import Model as Laws
from taichi_disk.physics import Springs
from taichi_disk.scenes import load_scene

LONG = pytest.mark.validate


@LONG
@pytest.mark.parametrize(
    ("points", "eta_star", "spin"), [(22, 300, 0.3), (30, 2000, -0.1), (150, 100, 0.05)]
)
def test_a_disk_that_spins_beside_strong_dashpots_meets_its_estimate(
    points, eta_star, spin, kernels
):
    settings = (
        f"lattice.points={points}",
        f"material.eta_star={eta_star}",
        f"impact.spin={spin}",
    )
    scenario, outcome = computed(
        kernels, "exponential_wall", "impact.velocity=0.05", *settings
    )
    lattice = scenario.lattice
    end = outcome.series["t"][-1]
    assert outcome.summary["integrator"] == "trapezoidal"
    assert outcome.summary["steps"] < 2000
    _, (_, v) = Model(lattice, scenario.model).solve(
        lattice.positions, scenario.velocities, (0.0, end), 1e-8
    )
    e = scenario.result(outcome.series)["restitution"]
    assert (
        abs(e - v[:, 1].mean() / 0.05)
        < outcome.summary["error_estimate"]["restitution"]
        < 2e-3
    )
    assert abs(outcome.summary["energy"]["worst_imbalance"]) < 1e-3


@pytest.mark.parametrize(
    ("mass", "stretch"),
    [
        (0.5, 0.1),
        pytest.param(0.5, 0.0, marks=LONG),
        pytest.param(0.1, 0.1, marks=LONG),
    ],
)
def test_the_balance_of_linear_springs_with_dashpots_is_exact_at_any_step(
    mass, stretch, kernels
):
    # Leapfrog conserves E - h^2/(8 m) f.F, whose second term is 0 when the body is at
    # rest in the end.
    rod = chain([[-0.5, 0.0], [0.5, 0.0]], [[0, 1]], 0.5)
    masses = np.array([mass, 1.0 - mass])
    rod = replace(rod, masses=masses, rest_lengths=np.array([1.0 - stretch]))
    # along the spring: its force is linear
    velocities = np.array([[0.05, 0.0], [-0.05, 0.0]]) / masses[:, None]
    simulation = kernels.simulation(
        rod, Laws(Springs(1.0, 0.0, 40.0)), TRAPEZOIDAL, velocities, 0.5
    )
    columns = advance(simulation, 4000, 4000)
    assert columns["dissipated"][-1] == pytest.approx(
        columns["kinetic"][0] + columns["elastic"][0], rel=1e-12
    )


@LONG
def test_dashpots_brake_a_spin_in_flight_with_a_warning_and_axial_ones_do_not(kernels):
    settings = (
        "lattice.points=60",
        "impact.spin=0.05",
        "material.eta_star=10",
        "impact.gap=0.3",
    )
    _, vector = computed(kernels, "exponential_wall", *settings, estimate=False)
    _, axial = computed(
        kernels, "exponential_wall", *settings, "material.dashpot=axial", estimate=False
    )
    (text,) = vector.summary["warnings"]
    assert "angular momentum" in text
    assert "material.dashpot: axial" in text
    assert not axial.summary["warnings"]
    force = axial.series["wall_force"]
    spin = axial.series["angular_momentum"]
    before = force < 1e-6 * force.max()
    before[int(force.argmax()) :] = False
    # The disk flies until the wall's torque begins.
    assert np.ptp(spin[before]) < 1e-6 * abs(spin[0])
    assert before.sum() > 10
    assert axial.summary["integrator"] == "velocity_verlet"
    with pytest.raises(InputError, match=r"time\.integrator: trapezoidal .* axial"):
        load_scene(
            "exponential_wall",
            ["material.dashpot=axial", "time.integrator=trapezoidal"],
        )
