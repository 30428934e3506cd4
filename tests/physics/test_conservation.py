"""Conservation laws of a free lattice, and small bodies with a known motion."""

from dataclasses import replace

import numpy as np
import pytest
from bodies import FALLING, advance, damped, disk, shaken
from numpy.testing import assert_allclose

from taichi_disk.mechanics.integrators import TRAPEZOIDAL, VELOCITY_VERLET


def angular(mass, x, v):
    return mass * np.sum(x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])


@pytest.mark.parametrize(
    ("eta_star", "integrator", "axial"),
    [
        (0.0, VELOCITY_VERLET, False),
        (50.0, VELOCITY_VERLET, False),
        (50.0, TRAPEZOIDAL, False),
        (50.0, VELOCITY_VERLET, True),
    ],
)
def test_a_free_disk_keeps_its_momentum(eta_star, integrator, axial, kernels):
    # All forces come in pairs, so linear momentum is conserved to rounding, also with
    # dashpots. Central forces have no torque, so angular momentum is conserved too,
    # also with axial dashpots; vector dashpots resist rotation.
    lattice = disk(80, height=1.0)  # out of every reach of the wall at y = 0
    m = lattice.masses[0]
    x, v = shaken(lattice, 0, 0.02)
    v += np.array([0.3, -0.2])
    model = damped(eta_star / 80) if eta_star else FALLING
    model = replace(model, springs=replace(model.springs, axial=axial))
    moved = replace(lattice, positions=x)
    simulation = kernels.simulation(moved, model, integrator, v, 1e-3)
    columns = advance(simulation, 2000, 2000)
    end = {name: column[-1] for name, column in columns.items()}
    x1 = simulation.positions()
    v1 = simulation.velocities()
    linear = m * v.sum(axis=0)
    for after in (m * v1.sum(axis=0), [end["com_vx"], end["com_vy"]]):
        assert_allclose(after, linear, rtol=0, atol=1e-12)
    # The centre of mass flies straight: x_0 + v t.
    centre = [end["com_x"], end["com_y"]]
    assert_allclose(centre, x.mean(axis=0) + 2.0 * linear, rtol=0, atol=1e-12)
    assert end["angular_momentum"] == pytest.approx(
        angular(m, x1 - x1.mean(axis=0), v1), abs=1e-13
    )
    change = abs(angular(m, x1, v1) - angular(m, x, v))
    assert change > 1e-6 if eta_star and not axial else change < 1e-12
    assert np.abs(v1 - v).max() > 0.01  # the disk did not just fly
    # Dashpots damp unlike velocities within a few steps; their sum is right to 1 %.
    assert np.ptp(columns["total"]) < 0.01 * columns["kinetic"][0]
