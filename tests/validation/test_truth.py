"""The independent solver that results are held against."""

from __future__ import annotations

import numpy as np
import pytest
import reference

from taichi_disk.accuracy.reference import Array
from taichi_disk.lattice import Lattice, disk_lattice, with_wall
from taichi_disk.physics import ElasticWall, Model, PinnedBoundary, Springs

from .truth import HeldWall, Solver


def test_the_truth_keeps_the_energy_where_points_slide_from_spring_to_spring() -> None:
    """Between two springs the energy jumps; what it jumps by is all that is lost, however many stretches there are."""
    lattice = with_wall(disk_lattice(30, 0), 40, 3.0, 0, True, 0.7, 0.04)
    model = Model(Springs(), ElasticWall(100.0, 50.0, 0.3), boundary=PinnedBoundary())
    plain = reference.Model.of(lattice, model)
    v = np.zeros_like(lattice.positions)
    v[: lattice.disk_points] = (0.3, -0.15)
    jumps = []

    class Watched(HeldWall):
        def touch(self, lattice: Lattice, x: Array) -> None:
            before = self.energy(lattice, x)
            super().touch(lattice, x)
            jumps.append(self.energy(lattice, x) - before)

    solver = Solver(lattice, model)
    solver.wall.__class__ = Watched
    end = solver.solve(v, 1.5, 1e-9)

    def energy(x: Array, v: Array) -> float:
        return float(plain.potential(x) + 0.5 * lattice.masses[0] * np.sum(v**2))

    slid = jumps[1:]  # the first found the contacts that there were
    assert np.abs(slid).max() > 1e-5
    assert energy(*end) - energy(lattice.positions, v) == pytest.approx(sum(slid), abs=1e-9)
