"""Matrices of a spring network (stiffness, Laplacian), their eigenvalues, and the
elastic moduli of the material.

The moduli are measured by stretching a rectangular sample. They are two-dimensional:
stress is force per length, and the thickness of the sheet is free to change (plane
stress).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.errors import SimulationError
from taichi_disk.mechanics.lattice.lattice import Lattice, triangulate
from taichi_disk.mechanics.lattice.random_points import (
    least_distance,
    rectangle_points,
    rim_spacing,
)
from taichi_disk.mechanics.lattice.triangles import Array, Indices, bond_lengths

Sparse = Any  # scipy.sparse.csr_matrix, which has no type stubs

# degrees of freedom; for fewer, Lanczos iteration is slower or impossible
_MAX_DENSE_SIZE = 64
# a dense solver is faster if more than this fraction of all modes is requested
_DENSE_FRACTION = 0.2
# points of the sample whose moduli are measured
_MIN_SAMPLE = 300
_MAX_SAMPLE = 20_000
# width of the layer along the sides of a sample that is not measured, in mean springs
_EDGE_LAYER = 3.0


def network_stiffness(positions: Array, bonds: Indices, k: Array | float) -> Sparse:
    """Return the stiffness matrix (2n, 2n) [M c^2/R^2] of unstretched springs: the sum
    of k e e^T over the bonds.

    `k` is a number or (m,), e the direction of a bond. Degrees of freedom: x0, y0, x1,
    y1, ...
    """
    start, end = bonds.T
    length = bond_lengths(positions, bonds)
    e = (positions[start] - positions[end]) / length[:, None]
    products = e[:, :, None] * e[:, None, :]
    return assemble(np.reshape(k, (-1, 1, 1)) * products, bonds, len(positions))


def laplacian(lattice: Lattice) -> Sparse:
    """Return the graph Laplacian (n, n) with stiffness factors; eta times it is the
    matrix of vector dashpots."""
    weights = lattice.stiffened(np.ones(len(lattice.bonds)))
    return assemble(weights[:, None, None], lattice.bonds, len(lattice.positions))


def assemble(block: Array, bonds: Indices, n: int) -> Sparse:
    """Sum the matrices [[B, -B], [-B, B]] of all bonds (i, j) into a matrix (n w, n w);
    B is `block` (m, w, w).

    `bonds` (m, 2) are sorted by their first points; each B is symmetric.
    """
    from scipy.sparse import bsr_matrix

    start, end = bonds.T
    width = block.shape[1]
    shape = (n * width, n * width)
    points = np.arange(n + 1)
    row_starts = np.searchsorted(start, points)
    upper = bsr_matrix((block, end, row_starts), shape=shape)
    # On the diagonal is the sum of the blocks of all bonds of a point.
    ones = np.tile(np.eye(width), (n, 1))
    sums = upper @ ones + upper.T @ ones
    blocks = sums.reshape(n, width, width)
    diagonal = bsr_matrix((blocks, points[:-1], points), shape=shape)
    return (diagonal - upper - upper.T).tocsr()


def symmetric_factors(matrix: Any) -> Any:
    """Return SciPy's sparse LU factors of a symmetric matrix, with pivots on the
    diagonal."""
    # The order depends only on the sparsity pattern. The pivots have the signs of the
    # eigenvalues (Sylvester).
    from scipy.sparse.linalg import splu

    return splu(
        matrix.tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )


def largest_eigenvalue(matrix: Sparse, masses: Array) -> float:
    """Return the largest eigenvalue of M^-1/2 K M^-1/2; K is a symmetric `matrix`, M =
    diag(`masses`) (n,) [M].

    K has 1 or 2 degrees of freedom per mass. For a stiffness matrix the result is the
    square of the highest frequency [c^2/R^2]. Raises SimulationError if Lanczos
    iteration does not converge.
    """
    from scipy.sparse import diags
    from scipy.sparse.linalg import ArpackNoConvergence, eigsh

    size = matrix.shape[0]
    scale = diags(1.0 / np.sqrt(np.repeat(masses, size // len(masses))))
    scaled = (scale @ matrix @ scale).tocsr()
    if size <= _MAX_DENSE_SIZE:
        value = np.linalg.eigvalsh(scaled.toarray())[-1]
    else:
        start = np.random.default_rng(0).standard_normal(size)
        try:
            value = eigsh(
                scaled,
                k=1,
                which="LA",
                v0=start,
                # The error of the eigenvalue is the square of the vector's, so this
                # gives all digits that are kept.
                tol=1e-6,
                return_eigenvectors=False,
            )[0]
        except ArpackNoConvergence as error:
            raise SimulationError(
                "the highest frequency, which limits the step, was not found: set"
                " time.dt"
            ) from error
    # Round, because the last digits depend on the machine's BLAS and the time step must
    # not.
    return float(f"{value:.10g}")


def bending_compliance(stiffness: Sparse) -> float:
    """Return the largest squared displacement of a point per 2 energy [R^2/(M c^2)] in
    the five softest vibrations."""
    # `stiffness` (2n, 2n) belongs to a free body and has three rigid modes. The
    # compliance of the sixth vibration is subtracted from each, so that the result does
    # not depend on the order of two equally soft vibrations.
    values, modes = softest_modes(stiffness, min(9, stiffness.shape[0]))
    # finite even if a part of the body moves freely
    least = 1e-12 * stiffness.diagonal().max()
    compliance = 1.0 / np.maximum(values[3:], least)
    beyond_sixth = compliance - compliance[-1]
    of_coordinates = modes[:, 3:] ** 2 @ beyond_sixth
    of_points = of_coordinates.reshape(-1, 2).sum(axis=1)
    # the last digits depend on the machine's BLAS
    return float(f"{of_points.max():.6g}")


def softest_modes(stiffness: Sparse, count: int) -> tuple[Array, Array]:
    """Return the `count` lowest eigenvalues, ascending, of a positive semidefinite
    matrix (size, size), and the vectors (size, count)."""
    from scipy.linalg import eigh
    from scipy.sparse.linalg import eigsh

    size = stiffness.shape[0]
    if count > _DENSE_FRACTION * size:
        values, vectors = eigh(stiffness.toarray(), subset_by_index=(0, count - 1))
        return values, vectors
    below_all = -1e-9 * stiffness.diagonal().max()
    start = np.random.default_rng(0).standard_normal(size)
    values, vectors = eigsh(stiffness.tocsc(), k=count, sigma=below_all, v0=start)
    order = values.argsort()
    return values[order], vectors[:, order]


# ---- moduli


@dataclass(frozen=True)
class Moduli:
    """Elastic moduli of the material in two dimensions (plane stress)."""

    young: float  # [M c^2/R^2]
    poisson: float
    density: float = 1.0 / pi  # [M/R^2], mass M over area pi R^2

    @property
    def wave_speed_p(self) -> float:
        """Speed of longitudinal waves, sqrt(E/((1 - nu^2) rho)) [c]."""
        return sqrt(self.young / ((1.0 - self.poisson**2) * self.density))

    @property
    def wave_speed_s(self) -> float:
        """Speed of transverse waves, sqrt(E/(2 (1 + nu) rho)) [c]."""
        return sqrt(self.young / (2.0 * (1.0 + self.poisson) * self.density))


@lru_cache(maxsize=8)  # the scenes of a sweep share them
def bulk_moduli(points: int, seed: int, k: float, min_spacing: float) -> Moduli:
    """Measure the moduli of the material of a disk of `points` points by stretching a
    square sample.

    The sample has as many points as the disk (but 300 to 20,000), so its moduli scatter
    like the disk's. `k` is the springs' stiffness [M c^2/R^2]; `seed` and `min_spacing`
    are as for `Lattice.disk`.
    """
    side = sqrt(pi)
    sample = min(max(points, _MIN_SAMPLE), _MAX_SAMPLE)
    mesh = rectangle(sample, seed, min_spacing, length=side, width=side)
    x = mesh.positions[:, 0]
    displacements = stretch(mesh, k, left=x == 0.0, right=x == side)
    return inner_moduli(mesh, k, displacements)


def rectangle(
    points: int, seed: int, min_spacing: float, length: float, width: float
) -> Lattice:
    """Make a rectangle [R] with a corner at (0, 0), of the material of a disk of
    `points` points.

    Raises InputError if `min_spacing` is out of range.
    """
    x = rectangle_points(
        np.random.default_rng([seed, 2]),
        points=round(points * length * width / pi),
        low=np.zeros(2),
        high=np.array([length, width]),
        row=rim_spacing(points),
        spacing=least_distance(points, min_spacing),
    )
    return triangulate(x)


def stretch(
    mesh: Lattice,
    k: float,
    left: NDArray[np.bool_],
    right: NDArray[np.bool_],
    clamped: bool = False,
) -> Array:
    """Return the displacements (n, 2) in linear equilibrium with u_x = x prescribed at
    both ends.

    The end points `left` and `right` (n,) move freely in y unless `clamped`.
    """
    stiffness = network_stiffness(mesh.positions, mesh.bonds, k)
    ends = left | right
    is_fixed = np.stack([ends, ends & clamped], axis=1)  # along x and y
    is_fixed[np.argmax(ends), 1] = True  # keeps the sample from shifting sideways
    fixed = is_fixed.ravel()
    u = (mesh.positions * [1.0, 0.0]).ravel()
    rows = stiffness[~fixed]
    force = -(rows[:, fixed] @ u[fixed])
    u[~fixed] = symmetric_factors(rows[:, ~fixed]).solve(force)
    return u.reshape(-1, 2)


def inner_moduli(mesh: Lattice, k: float, u: Array) -> Moduli:
    """Return the moduli from the mean stress and strain of the triangles away from the
    edges, displaced by `u` (n, 2)."""
    margin = _EDGE_LAYER * mesh.rest_lengths.mean()
    low = mesh.positions.min(axis=0) + margin
    high = mesh.positions.max(axis=0) - margin
    middle = mesh.positions[mesh.triangles].mean(axis=1)
    is_inside = ((middle > low) & (middle < high)).all(axis=1)
    triangles = mesh.triangles[is_inside]
    corner = mesh.positions[triangles]
    displacement = u[triangles]
    next_corner = np.roll(corner, -1, axis=1)
    next_displacement = np.roll(displacement, -1, axis=1)

    # Each triangle carries half of a bond's force: area times stress = sum force length
    # e e^T / 2.
    bond = next_corner - corner
    elongation = next_displacement - displacement
    bond_x = bond[:, :, 0]
    bond_y = bond[:, :, 1]
    square = np.sum(bond * bond, axis=2)
    tension = 0.5 * k * np.sum(bond * elongation, axis=2) / square
    stress_x = np.sum(tension * bond_x**2)
    stress_y = np.sum(tension * bond_y**2)
    # Compute area times strain from the triangles' sides by Gauss's theorem.
    twice = displacement + next_displacement
    strain_x = 0.5 * np.sum(twice[:, :, 0] * bond_y)
    strain_y = -0.5 * np.sum(twice[:, :, 1] * bond_x)
    # Solve strain_x = (stress_x - nu stress_y)/E, and the same with x and y exchanged.
    # The common area cancels.
    det = stress_x**2 - stress_y**2
    one_over_E = (strain_x * stress_x - strain_y * stress_y) / det
    nu_over_E = (strain_x * stress_y - strain_y * stress_x) / det
    return Moduli(young=float(1.0 / one_over_E), poisson=float(nu_over_E / one_over_E))
