"""The independent solver that a tolerance is held against."""

from __future__ import annotations

import numpy as np
import pytest
from reference import Model
from worlds import disk_and_wall

from taichi_disk.model.physics import Physics
from taichi_disk.study.truth import Solver


def test_the_truth_has_the_forces_of_the_reference():
    rng = np.random.default_rng(2)
    lattice = disk_and_wall(60, 80, height=0.01)
    x = lattice.positions + 1e-3 * rng.standard_normal(lattice.positions.shape)
    v = 1e-2 * rng.standard_normal(x.shape)
    k = len(lattice.wall_boundary)
    for boundary in ("pinned", "dashpot"):
        physics = Physics(
            k_b=1.0,
            eta=0.1,
            wall="elastic",
            boundary=boundary,
            threshold=0.2,
            impedance=rng.uniform(0.02, 0.05, (k, 2)),
        )
        solver = Solver(lattice, physics)
        solver.touch(x)
        np.testing.assert_allclose(solver.force(x, v), Model.of(lattice, physics).force(x, v), rtol=0, atol=1e-12)


def test_the_truth_keeps_the_energy_where_points_slide_from_spring_to_spring():
    """Between two springs the energy jumps; what it jumps by is all that is lost, however many stretches there are."""
    lattice = disk_and_wall(30, 40, height=0.04)
    physics = Physics(wall="elastic", boundary="pinned", threshold=0.3, a=100.0, V0=50.0)
    model = Model.of(lattice, physics)
    v = np.zeros_like(lattice.positions)
    v[: lattice.disk_points] = (0.3, -0.15)
    jumps = []

    class Watched(Solver):
        def touch(self, x):
            before = self.contact_energy(x)
            super().touch(x)
            jumps.append(self.contact_energy(x) - before)

    end = Watched(lattice, physics).solve(v, 1.5, 1e-9)

    def energy(x, v):
        return model.potential(x) + 0.5 * lattice.masses[0] * np.sum(v**2)

    slid = jumps[1:]  # the first found the contacts that there were
    assert np.abs(slid).max() > 1e-5
    assert energy(*end) - energy(lattice.positions, v) == pytest.approx(sum(slid), abs=1e-9)
