"""The Cholesky factor of the implicit dashpots, against dense algebra."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.lattice import disk_lattice
from taichi_disk.model.factor import factorise


def dense(bonds, n, coupling, extra):
    """1 + coupling L + diag(extra), by adding up springs one by one."""
    matrix = np.eye(n) + np.diag(extra)
    for i, j in bonds:
        matrix[[i, j], [i, j]] += coupling
        matrix[i, j] -= coupling
        matrix[j, i] -= coupling
    return matrix


@pytest.mark.parametrize("coupling", [1e-3, 0.5, 100.0])
@pytest.mark.parametrize("components", [1, 2])
def test_factor_times_its_transpose_is_the_matrix(coupling, components):
    lattice = disk_lattice(90, 3)
    n = 90
    rng = np.random.default_rng(1)
    free = np.sort(rng.permutation(n)[:70]).astype(np.int32)
    extra = rng.uniform(0.0, 2.0, (n, components))
    factor = factorise(lattice.bonds, coupling, free, extra)
    assert sorted(factor.order) == sorted(free)
    for c in range(components):
        lower = np.eye(70)
        for k in range(70):
            rows = factor.row[factor.column[k] : factor.column[k + 1]]
            assert (rows > k).all()
            lower[rows, k] = factor.values[factor.column[k] : factor.column[k + 1], c]
        product = lower @ np.diag(1.0 / factor.inverse_diagonal[:, c]) @ lower.T
        expected = dense(lattice.bonds, n, coupling, extra[:, c])[np.ix_(factor.order, factor.order)]
        np.testing.assert_allclose(product, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def test_elimination_order_keeps_the_factor_sparse():
    # Minimum degree: some 15,000 entries for 1099 points (3,187 springs); in the points' own order, ten times that.
    lattice = disk_lattice(1099, 0)
    factor = factorise(lattice.bonds, 1.0, np.arange(1099, dtype=np.int32), np.zeros((1099, 1)))
    assert len(lattice.bonds) < len(factor.row) < 20_000
