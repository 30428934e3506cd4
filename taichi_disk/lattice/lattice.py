"""The body: mass points joined by springs, the sides of triangles that tile it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.errors import SimulationError

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
Long = NDArray[np.int64]

# Height over longest side. Three points of a straight row span a triangle of zero area, up to rounding.
_FLAT = 1e-9


@dataclass(frozen=True)
class Lattice:
    """Mass points and springs: the disk, and after it the elastic wall where there is one.

    Every index array refers to rows of `positions`.
    """

    positions: Array  # (n, 2), unloaded, in the body's own coordinates [R]
    bonds: Indices  # (m, 2), bonds[:, 0] < bonds[:, 1]; sorted lexicographically, the disk's before the wall's
    rest_lengths: Array  # (m,) [R]
    masses: Array  # (n,) [M]
    disk_points: int  # the first `disk_points` points are the disk, the rest the elastic wall
    disk_surface: Indices  # outline of the disk, counter-clockwise
    wall_surface: Indices  # elastic wall: top side, corners included, ordered by x (empty if none)
    wall_boundary: Indices  # elastic wall: left top corner -> bottom -> right top corner (empty if none)
    triangles: Indices  # (t, 3), counter-clockwise, the disk's before the wall's
    origin: str = "a lattice of one's own"  # what titles say of it

    @classmethod
    def disk(cls, points: int, seed: int, rim: bool = True, min_spacing: float = 0.7) -> Lattice:
        """A disk of points at random in the unit circle: see `taichi_disk.lattice.disk_lattice`."""
        from taichi_disk.lattice.disk import disk_lattice

        return disk_lattice(points, seed, rim, min_spacing)

    @classmethod
    def from_points(
        cls, points: ArrayLike, springs: ArrayLike | None = None, rest_lengths: ArrayLike | None = None
    ) -> Lattice:
        """A disk of points of your own, renumbered: see `taichi_disk.lattice.custom_lattice`."""
        from taichi_disk.lattice.custom import custom_lattice

        return custom_lattice(points, springs, rest_lengths)


def bond_lengths(positions: Array, bonds: NDArray[np.signedinteger]) -> Array:
    """Distance (m,) [R] between the two ends of each bond (m, 2) at `positions` (n, 2)."""
    d = positions[bonds[:, 0]] - positions[bonds[:, 1]]
    return np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])


def triangulate(points: Array) -> Lattice:
    """The lattice of `points` (n, 2) and the springs of their Delaunay triangles, in the order of `tiled`.

    Raises SimulationError if the triangles do not tile the outline's interior and use every point.
    """
    return tiled(points, delaunay(points))[0]


def delaunay(points: Array) -> Long:
    """Delaunay triangles (t, 3) of `points` (n, 2), counter-clockwise, without those of zero area."""
    from scipy.spatial import Delaunay

    triangles = Delaunay(points).simplices.astype(np.int64)  # counter-clockwise
    corner = points[triangles]
    longest = np.max(np.sum((corner - np.roll(corner, 1, axis=1)) ** 2, axis=2), axis=1)
    return triangles[double_area(corner) > _FLAT * longest]


def tiled(points: Array, triangles: Long, bonds: Long | None = None) -> tuple[Lattice, Long]:
    """Springs at rest on `bonds` (m, 2), by default the triangles' sides, between points of equal mass, 1 M in all.

    The points are renumbered by reverse Cuthill-McKee's order from the leftmost point, which keeps memory local, and
    the outline begins at its lowest index. Also returns the order: positions = points[order].
    Raises SimulationError if the `triangles` (t, 3) do not tile the outline's interior and use every point.
    """
    n = len(points)
    side, first, count = distinct_sides(triangles, n)
    outline = _chain(side[first[count == 1]])
    area = 0.5 * float(double_area(points[triangles]).sum())
    whole = abs(area - polygon_area(points[outline])) <= 1e-9 * area
    euler = n - len(first) + len(triangles) == 1
    if not (whole and euler and len(np.unique(triangles)) == n):
        raise SimulationError("the triangulation is degenerate: choose another lattice seed")

    bonds = side[first] if bonds is None else bonds
    order = _reverse_cuthill_mckee(bonds, n, int(np.argmin(points[:, 0])))
    rank = np.argsort(order)
    bonds = np.sort(rank[bonds], axis=1)
    bonds = bonds[np.argsort(bonds[:, 0] * n + bonds[:, 1])]
    outline = np.roll(rank[outline], -int(np.argmin(rank[outline])))
    ends, corners, surface, none = (one.astype(np.int32) for one in (bonds, rank[triangles], outline, np.empty(0)))
    x = points[order]
    return Lattice(x, ends, bond_lengths(x, bonds), np.full(n, 1.0 / n), n, surface, none, none, corners), order


def distinct_sides(triangles: Long, n: int) -> tuple[Long, Long, Long]:
    """Sides (3t, 2) of `triangles` (t, 3) of n points, side k in the sense of triangle k % t.

    Also, of each distinct side in either sense: where it comes first (m,), and how many triangles it has (m,).
    """
    side = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    _, first, count = np.unique(pair_keys(side, n), return_index=True, return_counts=True)
    return side, first, count


def pair_keys(pairs: NDArray[np.signedinteger], n: int) -> Long:
    """A number for each pair (..., 2) of n points, the same in either order."""
    return pairs.min(axis=-1).astype(np.int64) * n + pairs.max(axis=-1)


def polygon_area(corners: Array) -> float:
    """Area [R^2] inside the closed polygon through `corners` (n, 2), positive if counter-clockwise."""
    return 0.5 * float(np.sum(_cross(corners, np.roll(corners, -1, axis=0))))


def double_area(corner: Array) -> Array:
    """Twice the area (t,) [R^2] of triangles with the corners (t, 3, 2), positive if counter-clockwise."""
    return _cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _chain(sides: Long) -> Long:
    """The points of `sides` (h, 2), each joined to the next. Raises SimulationError if that is not one closed chain."""
    following = dict(sides.tolist())
    chain = sides[:1, 0].tolist()
    while chain and (after := following.pop(chain[-1], chain[0])) != chain[0]:
        chain.append(after)
    if not chain or len(chain) != len(sides):
        raise SimulationError("the triangulation has a hole: choose another lattice seed")
    return np.array(chain)


def _reverse_cuthill_mckee(bonds: Long, n: int, start: int) -> Long:
    """SciPy's order of n points, begun at `start`.

    SciPy begins at a point of least degree and breaks ties by an unstable sort, so we hang one more point on
    `start`: the only one with a single bond. From there on the order is unique.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    i, j = np.append(bonds, [[start, n]], axis=0).T
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(n + 1, n + 1))
    return reverse_cuthill_mckee(graph.tocsr())[:-1].astype(np.int64)
