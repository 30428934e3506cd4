"""Contact with the elastic wall: every point finds the spring below it, and pushes its two ends by the lever rule."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import reference
from bodies import ELASTIC, disk_and_wall
from numpy.testing import assert_allclose

from taichi_disk.integrators import VELOCITY_VERLET
from taichi_disk.physics import Model, ResetBoundary, Springs

# Next to no springs: what is left is the contact.
BARE = Model(Springs(1e-12, 1e-12), ELASTIC, boundary=ResetBoundary(1.0))
LATTICE = disk_and_wall()
N = LATTICE.disk_points


def forces(kernels, x):
    """Of the kernels, at rest with the points at `x`."""
    still = np.zeros_like(x)
    return kernels.simulation(replace(LATTICE, positions=x), BARE, VELOCITY_VERLET, still, 1e-3).snapshot().vectors[2]


@pytest.mark.parametrize("roughness", [0.0, 0.03, 0.06])
def test_every_point_finds_the_spring_below_it_and_the_lever_rule_balances_force_and_torque(roughness, kernels):
    # Against every point held to every spring, on a surface so rough that springs stand at 45 degrees; the disk
    # somewhere along the wall, even beyond its ends.
    plain, touching = reference.Model(LATTICE, BARE), 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        x = LATTICE.positions + roughness * rng.uniform(-1, 1, LATTICE.positions.shape)
        x[:N, 0] += rng.uniform(-1.8, 1.8)
        # The surface stays ordered in x: a point is over at most one spring.
        x[LATTICE.wall_surface, 0] = np.sort(x[LATTICE.wall_surface, 0])
        expected, f, rows = plain.wall_force(x), forces(kernels, x), plain.contacts(x)
        scale = max(float(np.abs(expected).max()), 1.0)
        assert_allclose(f, expected, rtol=0, atol=1e-12 * scale)
        assert_allclose(ELASTIC.forces(LATTICE, x), expected, rtol=0, atol=1e-12 * scale)
        found = ELASTIC.contacts(LATTICE, x)
        assert found.points.tolist() == rows.point.tolist()
        assert LATTICE.wall_surface[found.springs].tolist() == rows.left.tolist()
        touching += len(rows.point)
        scale = np.abs(f).sum()
        assert np.abs(f.sum(axis=0)).max() <= 1e-13 * scale + 1e-12
        assert abs(np.sum(x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0])) <= 1e-13 * scale + 1e-12
        moved = np.flatnonzero(np.abs(f).sum(axis=1) > 1e-9)
        assert set(moved) <= {*LATTICE.wall_surface, *LATTICE.disk_surface}
    assert touching > 12
