"""Elastic moduli of the lattice as a continuum, by pulling a rectangle of it.

All two-dimensional: stress is force per length, and the sheet is free to thin (plane stress).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import InputError
from taichi_disk.lattice import bond_lengths, check_spacing, rim_points
from taichi_disk.scatter import hexagonal_spacing
from taichi_disk.stiffness import tangent_stiffness
from taichi_disk.triangulation import Mesh, triangulate
from taichi_disk.wall_lattice import rectangle_points

Array = NDArray[np.float64]
Ends = tuple[NDArray[np.bool_], NDArray[np.bool_]]

DENSITY = 1.0 / math.pi  # M/(pi R^2)
_FEWEST, _MOST = 300, 20_000  # points of a sample for the bulk moduli


@dataclass(frozen=True)
class Moduli:
    young: float  # [M c^2/R^2]
    poisson: float
    density: float = DENSITY  # [M/R^2]

    @property
    def wave_speed_p(self) -> float:
        """Speed of longitudinal waves [c], sqrt(E/((1 - nu^2) rho))."""
        return math.sqrt(self.young / ((1.0 - self.poisson**2) * self.density))

    @property
    def wave_speed_s(self) -> float:
        """Speed of transverse waves [c], sqrt(E/(2 (1 + nu) rho))."""
        return math.sqrt(self.young / (2.0 * (1.0 + self.poisson) * self.density))


@dataclass(frozen=True)
class StretchTest:
    bulk: Moduli  # from the mean stress and strain of the inside, whatever the grips do
    apparent: Moduli  # from the pull on the grips and the narrowing between the free sides


def bulk_moduli(points: int, seed: int, k_a: float, min_spacing: float) -> Moduli:
    """Moduli of the material of a disk of `points` points, away from any edge.

    A square sample of as many points is pulled (at least 300, at most 20,000): its moduli scatter as the disk's do.
    """
    sample = min(max(points, _FEWEST), _MOST)
    side = math.sqrt(math.pi)
    return stretch_test(sample, seed, k_a, min_spacing, side, side).bulk


def stretch_test(
    points: int, seed: int, k_a: float, min_spacing: float, length: float, width: float, clamped: bool = False
) -> StretchTest:
    """Pulls a rectangle, `length` by `width` [R], of the material of a disk of `points` points lengthwise.

    It is made like the elastic wall, with rows of points along its sides. Its ends are drawn apart, free to
    narrow or, if `clamped`, not. A clamped strip much wider than long hardly narrows: its apparent Poisson
    ratio lies far below the bulk's. Raises InputError if there is nothing inside, away from the sides.
    """
    check_spacing(min_spacing)
    low, high = np.array([0.0, 0.0]), np.array([length, width])
    count = round(points * length * width / math.pi)
    row = 2.0 * math.pi / rim_points(points)
    rng = np.random.default_rng([seed, 2])
    mesh = triangulate(rectangle_points(rng, count, low, high, row, min_spacing * hexagonal_spacing(points)))
    x, y = mesh.positions.T
    return _pull(mesh, k_a, (x == 0.0, x == length), (y == 0.0, y == width), clamped)


def perfect_stretch_test(columns: int, rows: int, k_a: float) -> StretchTest:
    """Pulls a perfect triangular lattice along its rows: E = 2/sqrt(3) k_a, nu = 1/3 in the bulk.

    `rows` of `columns` points, a unit apart.
    """
    i, j = np.meshgrid(np.arange(columns), np.arange(rows), indexing="ij")
    points = np.stack([i + 0.5 * (j % 2), j * math.sqrt(0.75)], axis=-1).reshape(-1, 2)
    mesh = triangulate(points)
    x, y = mesh.positions.T
    ends = (x <= 0.5, x >= columns - 1.0)
    return _pull(mesh, k_a, ends, (y == y.min(), y == y.max()), clamped=False)


def _pull(mesh: Mesh, k_a: float, ends: Ends, sides: Ends, clamped: bool) -> StretchTest:
    """Unit strain along x between the points `ends`; small displacements, so the result is linear in it."""
    rest = bond_lengths(mesh.positions, mesh.bonds)
    stiffness = tangent_stiffness(mesh.positions, mesh.bonds, rest, k_a, 0.0)
    u = _solve(stiffness, mesh.positions, ends, clamped)

    bottom, top = sides
    y = mesh.positions[:, 1]
    width = float(y[top].mean() - y[bottom].mean())
    narrowing = float(u[bottom, 1].mean() - u[top, 1].mean()) / width
    pull = float((stiffness @ u.ravel())[::2][ends[1]].sum())
    return StretchTest(_inside(mesh, k_a, u, 3.0 * float(rest.mean())), Moduli(pull / width, narrowing))


def _solve(stiffness: Any, positions: Array, ends: Ends, clamped: bool) -> Array:
    """Displacements (n, 2) at rest, u_x = x being imposed on the ends and, if `clamped`, u_y = 0."""
    from scipy.sparse.linalg import splu

    gripped = ends[0] | ends[1]
    held = np.stack([gripped, gripped & clamped], axis=1)
    held[np.argmax(gripped), 1] = True  # or the whole would be free to shift sideways
    held = held.ravel()
    u = np.stack([positions[:, 0], np.zeros(len(positions))], axis=1).ravel()
    rows = stiffness[~held]
    factor = splu(
        rows[:, ~held].tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    u[~held] = factor.solve(-(rows[:, held] @ u[held]))
    return u.reshape(-1, 2)


def _inside(mesh: Mesh, k_a: float, u: Array, margin: float) -> Moduli:
    """Moduli from the mean stress and strain over the triangles further than `margin` from the outside."""
    corner = mesh.positions[mesh.triangles]
    middle = corner.mean(axis=1)
    box = mesh.positions.min(axis=0) + margin, mesh.positions.max(axis=0) - margin
    inside = ((middle > box[0]) & (middle < box[1])).all(axis=1)
    if not inside.any():
        raise InputError("a stretch test needs more than 6 spacings of the points in length and in width")
    corner, u = corner[inside], u[mesh.triangles[inside]]

    # A bond belongs half to each of its two triangles: area times stress = sum force length e e^T / 2.
    bond, stretch = (np.roll(a, -1, axis=1) - a for a in (corner, u))
    square = np.sum(bond * bond, axis=2)
    tension = 0.5 * k_a * np.sum(bond * stretch, axis=2) / square
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
