"""Matrices of a network of springs: assembly, stiffness at rest, Laplacian, factors, highest frequency, bending."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_disk.errors import SimulationError
from taichi_disk.lattice.lattice import Array, Indices, bond_lengths

Sparse = Any  # scipy.sparse.csr_matrix, which has no type stubs

_DENSE = 64  # degrees of freedom up to which a dense solver is faster, and Lanczos short of room
_LARGE = 50_000  # from which Lanczos takes seconds and stops as soon as it may


def network_stiffness(positions: Array, bonds: Indices, k: float) -> Sparse:
    """Stiffness (2n, 2n) [M c^2/R^2] of unstretched springs of stiffness k: the sum of k e e^T over the bonds.

    Degrees of freedom x0, y0, x1, y1, ...; e is the bond's direction.
    """
    e = (positions[bonds[:, 0]] - positions[bonds[:, 1]]) / bond_lengths(positions, bonds)[:, None]
    return assemble(k * (e[:, :, None] * e[:, None, :]), bonds, len(positions))


def laplacian(bonds: Indices, n: int) -> Sparse:
    """Graph Laplacian (n, n): eta times it is the matrix of the vector dashpots, the same for x and y."""
    return assemble(np.ones((len(bonds), 1, 1)), bonds, n)


def assemble(block: Array, bonds: Indices, n: int) -> Sparse:
    """Sum over bonds of the matrix [[B, -B], [-B, B]] on the points i, j: (n w, n w), B being `block` (m, w, w).

    The `bonds` (m, 2) are sorted by their first points, and each B is symmetric.
    """
    from scipy.sparse import bsr_matrix

    points, width = np.arange(n + 1), block.shape[1]
    shape, ones = (n * width, n * width), np.tile(np.eye(width), (n, 1))
    upper = bsr_matrix((block, bonds[:, 1], np.searchsorted(bonds[:, 0], points)), shape=shape)
    sums = (upper @ ones + upper.T @ ones).reshape(n, width, width)
    return (bsr_matrix((sums, points[:-1], points), shape=shape) - upper - upper.T).tocsr()


def symmetric_factors(matrix: Any) -> Any:
    """SciPy's sparse L and U of a symmetric matrix, in an order that keeps them sparse and with pivots on the diagonal.

    The order depends on the pattern alone. The signs of the pivots are those of the eigenvalues (Sylvester).
    """
    from scipy.sparse.linalg import splu

    symmetric = {"SymmetricMode": True}
    return splu(matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=symmetric)


def largest_eigenvalue(matrix: Sparse, masses: Array) -> float:
    """Largest eigenvalue of M^-1/2 K M^-1/2, K a sparse symmetric matrix and M the diagonal of `masses` (n,) [M].

    K has 1 or 2 degrees of freedom for each mass. For a stiffness matrix the result is the square of the highest
    frequency [c^2/R^2]. Raises SimulationError if Lanczos iteration, from a fixed vector, does not converge.
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


def bending_compliance(stiffness: Sparse) -> float:
    """Largest (displacement of a point)^2/(2 energy) in the five softest vibrations of a free body [R^2/(M c^2)].

    Its `stiffness` (2n, 2n) has three rigid modes. The sixth vibration's compliance is subtracted from each, so that
    the result does not depend on which of two equally soft vibrations comes fifth.
    """
    from scipy.sparse.linalg import eigsh

    stiffest = stiffness.diagonal().max()
    if stiffness.shape[0] <= _DENSE:
        values, modes = np.linalg.eigh(stiffness.toarray())
    else:
        start = np.random.default_rng(0).standard_normal(stiffness.shape[0])
        values, modes = eigsh(stiffness, k=9, sigma=-1e-9 * stiffest, v0=start)
    soft = values.argsort()[3:9]
    compliance = 1.0 / np.maximum(values[soft], 1e-12 * stiffest)  # a part may swing without any energy
    squares = modes[:, soft] ** 2 @ (compliance - compliance[-1])
    return float(f"{squares.reshape(-1, 2).sum(axis=1).max():.6g}")  # the last digits are the machine's BLAS's
