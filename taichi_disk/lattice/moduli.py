"""Elastic moduli of the lattice as a continuum, by pulling a rectangle of it.

All two-dimensional: stress is force per length, and the sheet is free to thin (plane stress).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import InputError
from taichi_disk.lattice.disk import least_distance, rim_points
from taichi_disk.lattice.lattice import Array, Lattice, triangulate
from taichi_disk.lattice.network import network_stiffness, symmetric_factors
from taichi_disk.lattice.wall import rectangle_points

_FEWEST, _MOST = 300, 20_000  # points of a sample for the bulk moduli
_MARGIN = 3.0  # mean springs from the sides of a sample within which its edges are felt


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


def bulk_moduli(points: int, seed: int, k_a: float, min_spacing: float) -> Moduli:
    """Moduli of the material of a disk of `points` points, away from any edge.

    A square sample of as many points is pulled (at least 300, at most 20,000): its moduli scatter as the disk's do.
    `k_a` is the springs' stiffness [M c^2/R^2]; `seed` and `min_spacing` are as for `disk_lattice`.
    """
    side = math.sqrt(math.pi)
    mesh = rectangle(min(max(points, _FEWEST), _MOST), seed, min_spacing, side, side)
    x = mesh.positions[:, 0]
    return inner_moduli(mesh, k_a, pulled(mesh, k_a, x == 0.0, x == side))


def rectangle(points: int, seed: int, min_spacing: float, length: float, width: float) -> Lattice:
    """A rectangle [R] of the material of a disk of `points` points, made like the elastic wall, a corner at (0, 0).

    Raises InputError if `min_spacing` is out of range or there is no room between the rows along the sides.
    """
    spacing, row = least_distance(points, min_spacing), 2.0 * math.pi / rim_points(points)
    low, high, count = np.zeros(2), np.array([length, width]), round(points * length * width / math.pi)
    return triangulate(rectangle_points(np.random.default_rng([seed, 2]), count, low, high, row, spacing))


def pulled(
    mesh: Lattice, k_a: float, left: NDArray[np.bool_], right: NDArray[np.bool_], clamped: bool = False
) -> Array:
    """Displacements (n, 2) of springs of stiffness `k_a` in equilibrium, to linear order, where u_x = x on both ends.

    The points `left` and `right` (n,) are free to move in y or, if `clamped`, not.
    """
    stiffness = network_stiffness(mesh.positions, mesh.bonds, k_a)
    gripped = left | right
    held = np.stack([gripped, gripped & clamped], axis=1)
    held[np.argmax(gripped), 1] = True  # or the whole would be free to shift sideways
    held = held.ravel()
    u = (mesh.positions * [1.0, 0.0]).ravel()
    rows = stiffness[~held]
    u[~held] = symmetric_factors(rows[:, ~held]).solve(-(rows[:, held] @ u[held]))
    return u.reshape(-1, 2)


def inner_moduli(mesh: Lattice, k_a: float, u: Array) -> Moduli:
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
