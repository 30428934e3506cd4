"""A sparse Cholesky factor of the implicit dashpot's matrix."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from taichi_disk.stiffness import laplacian


@dataclass(frozen=True)
class Factor:
    """L D L^T of the dashpot matrix by columns; `order[k]` is the point eliminated k-th.

    `values` (entries, c) and `inverse_diagonal` (k, c): c = 2 where x and y have matrices of their own.
    """

    order: NDArray[np.int32]
    column: NDArray[np.int32]
    row: NDArray[np.int32]
    values: NDArray[np.float64]
    inverse_diagonal: NDArray[np.float64]


def factorise(bonds: NDArray[np.int32], coupling: float, free: NDArray[np.int32], extra: NDArray[np.float64]) -> Factor:
    """Factorise 1 + coupling L + diag(extra[:, c]) over the points `free` (the others are held still).

    Args:
        bonds: (m, 2) springs.
        coupling: h/2 eta/m, dimensionless.
        free: (k,) the points that move.
        extra: (n, c) further diagonal terms for the x and y components, c = 1 or 2.
    """
    matrix = (coupling * laplacian(bonds, len(extra)) + sp.identity(len(extra))).tocsc()[free][:, free]
    factors = []
    for c in range(extra.shape[1]):
        # A diagonally dominant symmetric matrix needs no pivoting: the fill-reducing order is kept, and the
        # factors of both components have the same pattern.
        factors.append(
            splu(
                (matrix + sp.diags(extra[free, c])).tocsc(),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=0.0,
                options={"SymmetricMode": True},
            )
        )
    order = np.argsort(factors[0].perm_c).astype(np.int32)
    lowers = [sp.tril(f.L, -1, format="csc") for f in factors]
    for lower in lowers:
        lower.sort_indices()
    return Factor(
        order=free[order].astype(np.int32),
        column=lowers[0].indptr.astype(np.int32),
        row=lowers[0].indices.astype(np.int32),
        values=np.stack([lower.data for lower in lowers], axis=1),
        inverse_diagonal=np.stack([1.0 / f.U.diagonal() for f in factors], axis=1),
    )
