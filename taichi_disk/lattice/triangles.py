"""Springs and triangles between points, as index arrays: Delaunay's, their sides, outline, areas and numbering."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import InputError, SimulationError

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
Long = NDArray[np.int64]

# Height over longest side. Three points of a straight row span a triangle of zero area, up to rounding.
_FLAT = 1e-9
_LONG = 3.0  # a sliver's outer side over the median spring
GAP = 5.0  # longest spring over the median; points at random have some of 4.4
_SLIVER = 0.25  # a sliver's height over its outer side


def bond_lengths(positions: Array, bonds: NDArray[np.signedinteger]) -> Array:
    """Distance (m,) [R] between the two ends of each bond (m, 2) at `positions` (n, 2)."""
    d = positions[bonds[:, 0]] - positions[bonds[:, 1]]
    return np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])


def delaunay(points: Array) -> Long:
    """Delaunay triangles (t, 3) of `points` (n, 2), counter-clockwise, without those of zero area."""
    from taichi_disk.lattice.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(points).simplices.astype(np.int64)  # counter-clockwise
    except QhullError as error:
        raise InputError("the points lie on one line") from error
    corner = points[triangles]
    longest = np.max(np.sum((corner - np.roll(corner, 1, axis=1)) ** 2, axis=2), axis=1)
    return triangles[double_area(corner) > _FLAT * longest]


def centred(x: Array) -> Array:
    """Points (n, 2) near the origin, which differ as `x` do: far away the area of a triangle loses its digits."""
    return x - np.round(x.mean(axis=0))


def triangles_of(x: Array, springs: Long) -> tuple[Long, Long]:
    """Triangles of `springs`: those that are Delaunay's, right also if springs cross; all, right if none cross."""
    later: list[set[int]] = [set() for _ in x]
    pairs = np.sort(springs, axis=1)
    for i, j in pairs.tolist():
        later[i].add(j)
    every = np.array([(i, j, k) for i, j in pairs.tolist() for k in sorted(later[i] & later[j])], np.int64)
    every = every.reshape(-1, 3)
    clockwise = double_area(x[every]) < 0.0
    every[clockwise] = every[clockwise, ::-1]
    for k in np.setdiff1d(np.arange(len(x)), every):
        raise InputError(f"point {k} at ({x[k, 0]:.4g}, {x[k, 1]:.4g}) is no corner of a triangle of springs")

    triangles = delaunay(centred(x))
    side = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    joined = np.isin(pair_keys(side, len(x)), pair_keys(springs, len(x))).all(axis=1)
    return triangles[joined], every


def without_slivers(x: Array, triangles: Long) -> Long:
    """Drop slivers from the outside in, longest outer side first; the outline remains one closed chain."""
    n = len(x)
    side, first, _ = distinct_sides(triangles, n)
    longest = _LONG * float(np.median(bond_lengths(x, side[first])))
    while True:
        side, first, count = distinct_sides(triangles, n)
        outer = first[count == 1]
        end, start = side[outer].T
        third = triangles[outer % len(triangles)].sum(axis=1) - end - start
        length = np.linalg.norm(x[start] - x[end], axis=1)
        flat = double_area(x[triangles[outer % len(triangles)]]) < _SLIVER * length**2
        # A third point on the outline already would hold its two halves together alone.
        sliver = np.flatnonzero(((length > longest) | flat) & ~np.isin(third, start))
        if not len(sliver):
            return triangles
        sliver = sliver[np.argsort(-length[sliver], kind="stable")]
        one_each = sliver[np.unique(third[sliver], return_index=True)[1]]
        triangles = np.delete(triangles, outer[one_each] % len(triangles), axis=0)


def without_bridges(x: Array, triangles: Long) -> Long:
    """Drop triangles whose circumcircle, which holds no point, is wider than GAP median springs: they bridge a hole."""
    side, first, _ = distinct_sides(triangles, len(x))
    length = bond_lengths(x, side).reshape(3, -1)
    widest = GAP * float(np.median(length.ravel()[first]))
    return triangles[length.prod(axis=0) <= widest * double_area(x[triangles])]


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
    return 0.5 * float(np.sum(_cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0])))


def double_area(corner: Array) -> Array:
    """Twice the area (t,) [R^2] of triangles with the corners (t, 3, 2), positive if counter-clockwise."""
    return _cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def chains(sides: Long) -> list[Long]:
    """The points of `sides` (h, 2), each joined to the next. Raises SimulationError if these are not closed chains."""
    following, found = dict(sides.tolist()), list[Long]()
    closed = len(following) == len(sides)  # not so where two parts have but a point in common
    while closed and following:
        chain = list(following.popitem())
        while chain[-1] not in (chain[0], None):
            chain.append(following.pop(chain[-1], None))
        closed = chain.pop() is not None
        found.append(np.array(chain))
    if not closed:
        raise SimulationError("the triangulation has no closed outline: choose another lattice seed")
    return found


def reverse_cuthill_mckee(bonds: Long, n: int, start: int) -> Long:
    """SciPy's order of n points, begun at `start`.

    SciPy begins at a point of least degree and breaks ties by an unstable sort, so we hang one more point on
    `start`: the only one with a single bond. From there on the order is unique.
    """
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    i, j = np.append(bonds, [[start, n]], axis=0).T
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(n + 1, n + 1))
    return reverse_cuthill_mckee(graph.tocsr())[:-1].astype(np.int64)
