"""The body: mass points at random in the unit circle, joined to their Delaunay neighbours by springs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import InputError
from taichi_disk.scatter import MAX_SPACING, hexagonal_spacing, scatter
from taichi_disk.triangulation import triangulate

MIN_POINTS, MAX_POINTS = 3, 2_000_000


@dataclass(frozen=True)
class Lattice:
    """Mass points and springs: the disk, and after it the elastic wall where there is one."""

    positions: NDArray[np.float64]  # (n, 2), unloaded, in the body's own coordinates [R]
    bonds: NDArray[np.int32]  # (m, 2), bonds[:, 0] < bonds[:, 1], sorted lexicographically
    rest_lengths: NDArray[np.float64]  # (m,), distance in the unloaded lattice [R]
    masses: NDArray[np.float64]  # (n,) [M]
    disk_points: int  # the first `disk_points` points are the disk, the rest the elastic wall
    disk_surface: NDArray[np.int32]  # outline of the disk, counter-clockwise
    wall_surface: NDArray[np.int32]  # elastic wall: top chain, corners included, ordered by x (empty if none)
    wall_boundary: NDArray[np.int32]  # elastic wall: left top corner -> bottom -> right top corner (empty if none)


def disk_lattice(points: int, seed: int, rim: bool = True, min_spacing: float = 0.7) -> Lattice:
    """A disk of exactly `points` points of mass 1/points [M] in the unit circle (R = 1).

    With `rim`, a share of the points is spaced evenly on the circle itself (random phase) and the others
    lie inside, clear of the rim. `min_spacing` is the least distance between any two points, as a fraction
    (0 to 0.75) of the hexagonal spacing sqrt(2 pi/(sqrt(3) points)). The paper says no more than "at random":
    literally, that is rim=False, min_spacing=0. The same arguments give the same bytes on every machine.

    Raises InputError for arguments out of range, SimulationError if the points cannot be placed or meshed.
    """
    if not MIN_POINTS <= points <= MAX_POINTS:
        raise InputError(f"lattice.points must be between {MIN_POINTS} and {MAX_POINTS}, not {points}")
    check_spacing(min_spacing)
    rng = np.random.default_rng(seed)
    spacing = min_spacing * hexagonal_spacing(points)
    on_rim = rim_points(points) if rim else 0
    circle = _unit_circle((np.arange(on_rim) + rng.random()) / on_rim) if rim else np.empty((0, 2))
    apothem = float(_unit_circle(np.array([0.5 / on_rim]))[0, 0]) if rim else 1.0
    # No triangle on a rim chord is flatter than an equilateral one. (Four points have no room for so much.)
    radius = max(apothem - spacing * np.sqrt(0.75), 0.2 * apothem) if rim else 1.0
    corner = np.full(2, radius)

    def depth(p: NDArray[np.float64]) -> NDArray[np.float64]:
        return radius - np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2)

    inside = scatter(rng, points - on_rim, -corner, corner, depth, spacing, circle)
    mesh = triangulate(np.concatenate([circle, inside]))
    none = np.empty(0, dtype=np.int32)
    return Lattice(
        positions=mesh.positions,
        bonds=mesh.bonds,
        rest_lengths=bond_lengths(mesh.positions, mesh.bonds),
        masses=np.full(points, 1.0 / points),
        disk_points=points,
        disk_surface=mesh.outline,
        wall_surface=none,
        wall_boundary=none,
    )


def check_spacing(min_spacing: float) -> None:
    """Raises InputError unless `min_spacing` is one that random points can keep."""
    if not 0.0 <= min_spacing <= MAX_SPACING:
        raise InputError(f"lattice.min_spacing must be between 0 and {MAX_SPACING}, not {min_spacing}")


def rim_points(points: int) -> int:
    """How many of a disk's points lie on its rim: so many that their spacing is that of the points inside.

    A point on the rim owns half the area of one inside, so the points stand for n = points - rim/2 whole
    ones; hexagonal_spacing(n) = 2 pi/rim is a quadratic equation for rim. At least one point stays inside.
    """
    k = 2.0 * np.pi * np.sqrt(3.0)
    even = round(float(np.sqrt(k * points + k * k / 16.0) - k / 4.0))
    return min(even, points - 1) if points > 3 else 3


def bond_lengths(positions: NDArray[np.float64], bonds: NDArray[np.int32]) -> NDArray[np.float64]:
    """Distance (m,) [R] between the two ends of each bond."""
    d = positions[bonds[:, 0]] - positions[bonds[:, 1]]
    return np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])


def _unit_circle(turns: NDArray[np.float64]) -> NDArray[np.float64]:
    """(cos, sin) of 2 pi `turns`, turns in [0, 1), by Taylor's series in sums and products alone.

    These round alike everywhere, whereas the last bit of NumPy's cos and sin depends on the processor.
    """
    angle = np.pi * (2.0 * turns - 1.0)
    square = angle * angle
    c, s = np.ones_like(angle), np.ones_like(angle)
    for k in range(32, 0, -2):
        c = 1.0 - square / ((k - 1) * k) * c
        s = 1.0 - square / (k * (k + 1)) * s
    xy = -np.stack([c, angle * s], axis=1)
    return xy / np.sqrt(xy[:, :1] ** 2 + xy[:, 1:] ** 2)
