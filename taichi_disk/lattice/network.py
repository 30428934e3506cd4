"""A network of springs as a matrix and as a material: stiffness, Laplacian, frequencies, bending; elastic moduli.

The moduli are those of the continuum, by pulling a rectangle of it. All are two-dimensional: stress is force per
length, and the sheet is free to thin (plane stress).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice.lattice import Lattice, triangulate
from taichi_disk.lattice.random_points import least_distance, rectangle_points, rim_points
from taichi_disk.lattice.triangles import Array, Indices, bond_lengths

Sparse = Any  # scipy.sparse.csr_matrix, which has no type stubs

_DENSE = 64  # degrees of freedom up to which a dense solver is faster, and Lanczos short of room
_LARGE = 50_000  # from which Lanczos takes seconds and stops as soon as it may
_FEWEST, _MOST = 300, 20_000  # points of a sample for the bulk moduli
_MARGIN = 3.0  # mean springs from the sides of a sample within which its edges are felt


def network_stiffness(positions: Array, bonds: Indices, k: Array | float) -> Sparse:
    """Stiffness (2n, 2n) [M c^2/R^2] of unstretched springs of stiffness k, one or (m,): sum of k e e^T over the bonds.

    Degrees of freedom x0, y0, x1, y1, ...; e is the bond's direction.
    """
    e = (positions[bonds[:, 0]] - positions[bonds[:, 1]]) / bond_lengths(positions, bonds)[:, None]
    return assemble(np.reshape(k, (-1, 1, 1)) * (e[:, :, None] * e[:, None, :]), bonds, len(positions))


def laplacian(lattice: Lattice) -> Sparse:
    """Graph Laplacian (n, n) with the springs' stiffness as weights.

    Times eta it is the matrix of the vector dashpots, the same for x and y.
    """
    weights = lattice.stiffened(np.ones(len(lattice.bonds)))
    return assemble(weights[:, None, None], lattice.bonds, len(lattice.positions))


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


# ---- moduli


@dataclass(frozen=True)
class Moduli:
    young: float  # [M c^2/R^2]
    poisson: float
    density: float = 1.0 / math.pi  # [M/R^2], of M on pi R^2

    @property
    def wave_speed_p(self) -> float:
        """Speed of longitudinal waves [c], sqrt(E/((1 - nu^2) rho))."""
        return math.sqrt(self.young / ((1.0 - self.poisson**2) * self.density))

    @property
    def wave_speed_s(self) -> float:
        """Speed of transverse waves [c], sqrt(E/(2 (1 + nu) rho))."""
        return math.sqrt(self.young / (2.0 * (1.0 + self.poisson) * self.density))


def bulk_moduli(points: int, seed: int, k: float, min_spacing: float) -> Moduli:
    """Moduli of the material of a disk of `points` points, away from any edge.

    A square sample of as many points is pulled (at least 300, at most 20,000): its moduli scatter as the disk's do.
    `k` is the springs' stiffness [M c^2/R^2]; `seed` and `min_spacing` are as for `disk_lattice`.
    """
    side = math.sqrt(math.pi)
    mesh = rectangle(min(max(points, _FEWEST), _MOST), seed, min_spacing, side, side)
    x = mesh.positions[:, 0]
    return inner_moduli(mesh, k, pulled(mesh, k, x == 0.0, x == side))


def rectangle(points: int, seed: int, min_spacing: float, length: float, width: float) -> Lattice:
    """A rectangle [R] of the material of a disk of `points` points, made like the elastic wall, a corner at (0, 0).

    Raises InputError if `min_spacing` is out of range or there is no room between the rows along the sides.
    """
    spacing, row = least_distance(points, min_spacing), 2.0 * math.pi / rim_points(points)
    low, high, count = np.zeros(2), np.array([length, width]), round(points * length * width / math.pi)
    return triangulate(rectangle_points(np.random.default_rng([seed, 2]), count, low, high, row, spacing))


def pulled(mesh: Lattice, k: float, left: NDArray[np.bool_], right: NDArray[np.bool_], clamped: bool = False) -> Array:
    """Displacements (n, 2) of springs of stiffness `k` in equilibrium, to linear order, where u_x = x on both ends.

    The points `left` and `right` (n,) are free to move in y or, if `clamped`, not.
    """
    stiffness = network_stiffness(mesh.positions, mesh.bonds, k)
    gripped = left | right
    fixed = np.stack([gripped, gripped & clamped], axis=1)
    fixed[np.argmax(gripped), 1] = True  # or the whole would be free to shift sideways
    fixed = fixed.ravel()
    u = (mesh.positions * [1.0, 0.0]).ravel()
    rows = stiffness[~fixed]
    u[~fixed] = symmetric_factors(rows[:, ~fixed]).solve(-(rows[:, fixed] @ u[fixed]))
    return u.reshape(-1, 2)


def inner_moduli(mesh: Lattice, k: float, u: Array) -> Moduli:
    """From the mean stress and strain over the triangles clear of the outside, displaced by `u` (n, 2).

    Raises InputError if there are none.
    """
    margin = _MARGIN * float(mesh.rest_lengths.mean())
    corner = mesh.positions[mesh.triangles]
    middle = corner.mean(axis=1)
    low, high = mesh.positions.min(axis=0) + margin, mesh.positions.max(axis=0) - margin
    inside = ((middle > low) & (middle < high)).all(axis=1)
    if not inside.any():
        raise InputError("a stretch test needs more than 6 spacings of the points in length and in width")
    corner, u = corner[inside], u[mesh.triangles[inside]]

    # A bond belongs half to each of its two triangles: area times stress = sum force length e e^T / 2.
    bond, elongation = (np.roll(a, -1, axis=1) - a for a in (corner, u))
    square = np.sum(bond * bond, axis=2)
    tension = 0.5 * k * np.sum(bond * elongation, axis=2) / square
    stress_x, stress_y = (float(np.sum(tension * bond[:, :, a] ** 2)) for a in (0, 1))
    # Area times strain, by Gauss's theorem over the triangles' sides.
    twice = u + np.roll(u, -1, axis=1)
    strain_x = 0.5 * float(np.sum(twice[:, :, 0] * bond[:, :, 1]))
    strain_y = -0.5 * float(np.sum(twice[:, :, 1] * bond[:, :, 0]))
    # strain_x = (stress_x - nu stress_y)/E and the same with x and y exchanged; the common area cancels.
    det = stress_x**2 - stress_y**2
    compliance = (strain_x * stress_x - strain_y * stress_y) / det
    cross = (strain_x * stress_y - strain_y * stress_x) / det
    return Moduli(1.0 / compliance, cross / compliance)
