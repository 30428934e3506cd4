"""Mechanics of the spring network in NumPy: energy, forces, tangent stiffness, highest frequency.

With s = |r_i - r_j| - L_ij and e = (r_i - r_j)/|r_i - r_j|, a bond holds the energy k_a s^2/2 + k_b s^4/4 and
pulls point i with -(k_a s + k_b s^3) e (the paper's equations (1) and (3), at rest). Units: M, R, c.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

Array = NDArray[np.float64]
Bonds = NDArray[np.int32]
Sparse = Any  # scipy.sparse.csr_matrix, which has no type stubs

_DENSE = 64  # degrees of freedom up to which a dense solver is faster, and Lanczos short of room

_LARGE = 50_000  # from which Lanczos takes seconds and stops as soon as it may


def spring_energy(positions: Array, bonds: Bonds, rest_lengths: Array, k_a: float, k_b: float) -> float:
    """Elastic energy [M c^2] of positions (n, 2)."""
    _, stretch, _ = _bond_state(positions, bonds, rest_lengths)
    square = stretch * stretch
    return float(np.sum((0.5 * k_a + 0.25 * k_b * square) * square))


def spring_forces(positions: Array, bonds: Bonds, rest_lengths: Array, k_a: float, k_b: float) -> Array:
    """Force (n, 2) [M c^2/R] of the springs on each point: minus the gradient of `spring_energy`."""
    direction, stretch, _ = _bond_state(positions, bonds, rest_lengths)
    pull = (k_a * stretch + k_b * stretch**3)[:, None] * direction
    n = len(positions)
    i, j = bonds.T
    return np.stack(
        [np.bincount(j, pull[:, a], minlength=n) - np.bincount(i, pull[:, a], minlength=n) for a in (0, 1)],
        axis=1,
    )


def tangent_stiffness(positions: Array, bonds: Bonds, rest_lengths: Array, k_a: float, k_b: float) -> Sparse:
    """Second derivative (2n, 2n) [M c^2/R^2] of `spring_energy`, degrees of freedom x0, y0, x1, y1, ...

    A bond of length r and tension T = k_a s + k_b s^3 adds T' e e^T (material) + T/r (1 - e e^T) (geometric).
    """
    direction, stretch, length = _bond_state(positions, bonds, rest_lengths)
    square = stretch * stretch
    along = k_a + 3.0 * k_b * square
    across = (k_a + k_b * square) * stretch / length
    x, y = direction.T
    block = np.empty((len(bonds), 2, 2))
    block[:, 0, 0] = along * x * x + across * y * y
    block[:, 1, 1] = along * y * y + across * x * x
    block[:, 0, 1] = block[:, 1, 0] = (along - across) * x * y
    return _assemble(block, bonds, len(positions))


def laplacian(bonds: Bonds, n: int) -> Sparse:
    """Graph Laplacian (n, n): eta times it is the matrix of the vector dashpots, the same for x and y."""
    return _assemble(np.ones((len(bonds), 1, 1)), bonds, n)


def largest_eigenvalue(matrix: Sparse, masses: Array) -> float:
    """Largest eigenvalue of M^-1/2 K M^-1/2, K a sparse symmetric matrix and M the diagonal of `masses`.

    K has the same number of degrees of freedom, 1 or 2, for each of the n `masses` (n,) [M]. For a stiffness
    matrix the result is the square of the highest frequency [c^2/R^2]. Lanczos iteration from a fixed vector.
    """
    from scipy.sparse import diags
    from scipy.sparse.linalg import ArpackNoConvergence, eigsh

    size = matrix.shape[0]
    scale = diags(1.0 / np.sqrt(np.repeat(masses, size // len(masses))))
    scaled = (scale @ matrix @ scale).tocsr()
    if size <= _DENSE:
        value = np.linalg.eigvalsh(scaled.toarray())[-1]
    else:
        start = np.random.default_rng(0).standard_normal(size)
        try:
            # The error of the value goes with the square of that of the vector: 1e-6 gives the digits kept, too.
            tolerance = 1e-12 if size < _LARGE else 1e-6
            value = eigsh(scaled, k=1, which="LA", v0=start, tol=tolerance, return_eigenvectors=False)[0]
        except ArpackNoConvergence as error:
            raise SimulationError("the highest frequency was not found: give time.dt by hand") from error
    # The last digits are the machine's BLAS's; the time step that follows from this must not depend on them.
    return float(f"{value:.10g}")


def _bond_state(positions: Array, bonds: Bonds, rest_lengths: Array) -> tuple[Array, Array, Array]:
    """Direction (m, 2), stretch (m,) and length (m,) of each bond."""
    d = positions[bonds[:, 0]] - positions[bonds[:, 1]]
    length = np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])
    return d / length[:, None], length - rest_lengths, length


def _assemble(block: Array, bonds: Bonds, n: int) -> Sparse:
    """Sum over bonds of the stiffness [[B, -B], [-B, B]] on the points i, j, B being `block` (m, w, w)."""
    from scipy.sparse import bsr_matrix, coo_matrix

    width = block.shape[1]
    i, j = bonds.T.astype(np.int64)
    diagonal = np.empty((n, width, width))
    for a in range(width):
        for b in range(width):
            diagonal[:, a, b] = np.bincount(i, block[:, a, b], n) + np.bincount(j, block[:, a, b], n)
    row = np.concatenate([i, j, np.arange(n)])
    column = np.concatenate([j, i, np.arange(n)])
    entries = np.concatenate([-block, -block, diagonal])
    # Sort the blocks by rows through SciPy's own conversion of their numbers: entry k + 1 is block k.
    order = coo_matrix((np.arange(1, len(row) + 1), (row, column)), shape=(n, n)).tocsr()
    order.sort_indices()
    matrix = bsr_matrix((entries[order.data - 1], order.indices, order.indptr), shape=(n * width, n * width))
    return matrix.tocsr()
