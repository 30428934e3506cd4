"""Conservation laws of a free lattice, and small bodies with a known motion."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import FALLING, FREE, advance, chain, damped, disk, shaken
from numpy.testing import assert_allclose

from taichi_disk.integrators import TRAPEZOIDAL, VELOCITY_VERLET
from taichi_disk.physics import Springs


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
    # Dashpots damp velocities that differ from point to point within a few steps; their
    # sum is accurate to 1 %.
    assert np.ptp(columns["total"]) < 0.01 * columns["kinetic"][0]


@pytest.mark.parametrize("integrator", [VELOCITY_VERLET, TRAPEZOIDAL])
def test_dashpots_brake_a_rotation(integrator, kernels):
    # The dashpot acts on the full relative velocity, eq. (3): v_i - v_j = Omega x r_ij.
    # Power eta Omega^2 sum r_ij^2, torque -eta Omega sum r_ij^2. (An axial dashpot does
    # not act on a rotation.)
    lattice = disk(60, height=1.0)
    eta = 0.05
    spin = 0.02
    h = 1e-5
    steps = 20
    x = lattice.positions - lattice.positions.mean(axis=0)
    v = spin * np.stack([-x[:, 1], x[:, 0]], axis=1)
    simulation = kernels.simulation(lattice, damped(eta), integrator, v, h)
    columns = advance(simulation, steps, steps)
    momentum = columns["angular_momentum"]
    squares = np.sum(lattice.rest_lengths**2)
    assert momentum[0] == pytest.approx(spin * np.sum(x**2) / 60, rel=1e-12)
    # The rates at t = 0; they change once the disk is no longer in rigid rotation,
    # after 1/(11 eta/m) ~ 0.03 R/c.
    braked = eta * spin * squares * steps * h
    assert momentum[0] - momentum[-1] == pytest.approx(braked, rel=1e-2)
    assert columns["dissipated"][-1] == pytest.approx(spin * braked, rel=1e-2)


def test_two_points_on_a_spring_swing_as_leapfrog_must(kernels):
    # s'' = -(2 k/m) s. Leapfrog's own solution is s_k = s_0 cos(k theta), theta = 2
    # asin(h omega/2), exactly, up to its limit h omega = 2.
    k = 1.7
    s0 = 0.05
    pair = chain([(0.0, 0.0), (0.8, 0.0)], [(0, 1)], 0.3)
    stretched = replace(pair, positions=np.array([[-s0 / 2, 0.0], [0.8 + s0 / 2, 0.0]]))
    model = replace(FREE, springs=Springs(k))
    omega = np.sqrt(2 * k / 0.3)
    for h in (0.01, 1.9 / omega):
        theta = 2 * np.arcsin(h * omega / 2)
        still = np.zeros((2, 2))
        simulation = kernels.simulation(stretched, model, VELOCITY_VERLET, still, h)
        for steps in (1, 7, 300):
            simulation.advance(steps - simulation.step_number)
            x = simulation.positions()[:, 0]
            v = simulation.velocities()[:, 0]
            swing = s0 * np.cos(steps * theta)
            assert x[1] - x[0] - 0.8 == pytest.approx(swing, abs=1e-12)
            # v_k = (x_{k+1} - x_{k-1})/2h
            speed = -s0 * np.sin(steps * theta) * np.sin(theta) / h
            assert v[1] - v[0] == pytest.approx(speed, abs=1e-11)
