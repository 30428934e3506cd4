"""The Cholesky factor of the implicit dashpots, against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest
from bodies import ELASTIC, damped, disk, disk_and_wall, matched
from numpy.testing import assert_allclose

from taichi_disk.integrators.trapezoidal import factorise
from taichi_disk.lattice import disk_lattice
from taichi_disk.physics import Model, PinnedBoundary, Springs

BOTH = disk_and_wall(60, 80)
BODIES = {
    "none": (disk(90, 3), damped(0.3)),
    "pinned": (BOTH, Model(Springs(1.0, 1.0, 0.3), ELASTIC, boundary=PinnedBoundary())),
    "matched": (BOTH, Model(Springs(1.0, 1.0, 0.3), ELASTIC, boundary=matched(BOTH))),
}


def dense(lattice, model, h, c):
    """1 + h/2 (eta L + Z)/m for the component c, by adding up springs one by one."""
    half, edge = h / (2 * lattice.masses[0]), lattice.wall_boundary
    matrix = np.eye(len(lattice.positions))
    for i, j in lattice.bonds:
        matrix[[i, j], [i, j]] += half * model.springs.eta
        matrix[[i, j], [j, i]] -= half * model.springs.eta
    impedance = getattr(model.boundary, "impedance", np.zeros((len(edge), 2)))
    matrix[edge, edge] += half * impedance[:, c]
    return matrix


@pytest.mark.parametrize("boundary", BODIES)
def test_the_factor_times_its_transpose_is_the_matrix(boundary):
    (lattice, model), h = BODIES[boundary], 0.05
    factor, free = factorise(lattice, model, h), np.arange(len(lattice.positions))
    if boundary == "pinned":
        free = np.setdiff1d(free, lattice.wall_boundary)
    n = len(free)
    assert sorted(factor.order) == free.tolist()
    for c in range(factor.values.shape[1]):
        lower = np.eye(n)
        for k in range(n):
            entries = slice(factor.column[k], factor.column[k + 1])
            assert (factor.row[entries] > k).all()
            lower[factor.row[entries], k] = factor.values[entries, c]
        product = lower @ np.diag(1.0 / factor.inverse_diagonal[:, c]) @ lower.T
        expected = dense(lattice, model, h, c)[np.ix_(factor.order, factor.order)]
        assert_allclose(product, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_the_elimination_order_keeps_the_factor_sparse():
    # Minimum degree: some 15,000 entries for 1099 points (3,187 springs); in the points' own order, ten times that.
    lattice = disk_lattice(1099, 0)
    assert len(lattice.bonds) < len(factorise(lattice, damped(0.1), 0.01).row) < 20_000
