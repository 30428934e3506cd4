"""Sides and bottom of the elastic wall: pinned, reset or absorbing."""

from dataclasses import replace

import numpy as np
import pytest
import reference
from bodies import ELASTIC, WALL, advance, disk_and_wall
from numpy.testing import assert_allclose

from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.integrators import VELOCITY_VERLET
from taichi_disk.mechanics.lattice import bulk_moduli
from taichi_disk.mechanics.physics import (
    Model,
    ResetBoundary,
    Springs,
    matched_impedance,
)


def test_the_scene_matches_its_dashpots_to_the_material_and_the_length_of_the_sides():
    # rho c_p and rho c_s follow from the measured moduli in plane stress, rho = M/(pi
    # R^2). A side of length l resists with l rho c_p along its normal and l rho c_s
    # along itself. Corners belong to two sides.
    scenario = load_scene(
        "absorbing_wall", (*WALL, "wall.boundary=dashpot", "material.k_a=2")
    ).scenario()
    moduli = bulk_moduli(150, 0, 2.0, 0.7)
    rho = 1 / np.pi
    p = np.sqrt(rho * moduli.young / (1 - moduli.poisson**2))
    s = np.sqrt(rho * moduli.young / (2 * (1 + moduli.poisson)))
    z = scenario.model.boundary.impedance
    assert_allclose(z, matched_impedance(scenario.lattice, p, s), rtol=1e-12)
    x, y = scenario.lattice.positions[scenario.lattice.wall_boundary].T
    height = np.ptp(y)
    width = np.ptp(x)
    sums = [2 * p * height + s * width, p * width + 2 * s * height]
    assert_allclose(z.sum(axis=0), sums, rtol=1e-12)
    bottom = (y == y.min()) & (np.abs(x) < width / 2 - 1e-9)
    assert_allclose(z[bottom, 1] / z[bottom, 0], p / s, rtol=1e-12)
    assert (z > 0.0).all()


def test_resets_brake_a_point_as_a_drag_of_2m_over_the_interval(kernels):
    # Between resets a boundary point gains f tau/m and, from rest, moves by f tau^2/2m:
    # a mean speed f tau/2m. A wall held only by its resets and pushed by its own
    # stretched springs creeps at this speed.
    tau = 5e-3
    lattice = disk_and_wall(60, 80, height=5.0)
    edge = lattice.wall_boundary
    m = lattice.masses[0]
    still = np.zeros_like(lattice.positions)
    model = Model(Springs(1e-3, 1e-9), ELASTIC, boundary=ResetBoundary(tau))
    x = lattice.positions.copy()
    x[edge] *= 1.1
    stretched = replace(lattice, positions=x)
    simulation = kernels.simulation(stretched, model, VELOCITY_VERLET, still, tau / 20)
    force = reference.Model(lattice, model).force(x, still)[edge]
    absorbed = advance(simulation, 20 * 20)["absorbed"][-1]
    speed = (simulation.positions()[edge] - x[edge]) / (20 * tau)
    assert_allclose(
        speed, force * tau / (2 * m), rtol=0, atol=0.02 * np.abs(speed).max()
    )
    assert not simulation.velocities()[edge].any()
    # The resets absorb the kinetic energy, m/2 (f tau/m)^2 per reset.
    assert absorbed == pytest.approx(
        20 * 0.5 * m * np.sum((force * tau / m) ** 2), rel=0.05
    )
    # The interval does not depend on the step.
    simulation = kernels.simulation(stretched, model, VELOCITY_VERLET, still, tau / 7)
    simulation.advance(6)
    assert simulation.velocities()[edge].all()
    simulation.advance(1)
    assert not simulation.velocities()[edge].any()
