"""Index arrays of springs and triangles: Delaunay triangulation, sides, outlines, areas
and numbering."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import InputError, SimulationError

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
Long = NDArray[np.int64]

# height over longest side; a flatter triangle is three points on a line
_MIN_HEIGHT = 1e-9
# in median springs; a triangle with a longer outer side is a sliver
_MAX_OUTER_SIDE = 3.0
_SLIVER_HEIGHT = 0.25  # height over outer side; a flatter triangle is a sliver
# longest spring without a gap, in median springs; lattices of random points have up to
# 4.4
MAX_SPRING = 5.0


def bond_lengths(positions: Array, bonds: NDArray[np.signedinteger]) -> Array:
    """Return the lengths (m,) [R] of `bonds` (m, 2) between `positions` (n, 2)."""
    d = positions[bonds[:, 0]] - positions[bonds[:, 1]]
    return np.sqrt(d[:, 0] * d[:, 0] + d[:, 1] * d[:, 1])


def delaunay(points: Array) -> Long:
    """Return the Delaunay triangles (t, 3) of `points` (n, 2), counter-clockwise,
    without those of zero area."""
    from taichi_disk.lattice.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(points).simplices.astype(np.int64)  # counter-clockwise
    except QhullError as error:
        raise InputError(
            "the points lie on one line: a body needs points that span triangles"
        ) from error
    corner = points[triangles]
    longest = np.max(np.sum((corner - np.roll(corner, 1, axis=1)) ** 2, axis=2), axis=1)
    return triangles[double_area(corner) > _MIN_HEIGHT * longest]


def centred(x: Array) -> Array:
    """Shift points (n, 2) by whole numbers to the origin; far away, areas of triangles
    lose digits by cancellation."""
    return x - np.round(x.mean(axis=0))


def triangles_of(x: Array, springs: Long) -> tuple[Long, Long]:
    """Return two tilings (t, 3): the Delaunay triangles whose sides are springs, and
    all triangles whose sides are."""
    # The first tiling is right even if springs cross, the second only if no springs
    # cross.
    later: list[set[int]] = [set() for _ in x]
    pairs = np.sort(springs, axis=1)
    for i, j in pairs.tolist():
        later[i].add(j)
    cycles = np.array(
        [(i, j, k) for i, j in pairs.tolist() for k in sorted(later[i] & later[j])],
        np.int64,
    )
    cycles = cycles.reshape(-1, 3)
    clockwise = double_area(x[cycles]) < 0.0
    cycles[clockwise] = cycles[clockwise, ::-1]
    for k in np.setdiff1d(np.arange(len(x)), cycles):
        where = f"point {k} at ({x[k, 0]:.4g}, {x[k, 1]:.4g})"
        raise InputError(
            f"{where} is no corner of a triangle of springs: remove it, or join it by"
            " more springs"
        )

    triangles = delaunay(centred(x))
    side = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    has_springs = np.isin(pair_keys(side, len(x)), pair_keys(springs, len(x))).all(
        axis=1
    )
    return triangles[has_springs], cycles


def without_slivers(x: Array, triangles: Long) -> Long:
    """Remove slivers from the outside in, longest outer side first, so that the outline
    remains one closed chain."""
    n = len(x)
    side, first, _ = distinct_sides(triangles, n)
    longest = _MAX_OUTER_SIDE * float(np.median(bond_lengths(x, side[first])))
    while True:
        side, first, count = distinct_sides(triangles, n)
        outer = first[count == 1]
        end, start = side[outer].T
        third = triangles[outer % len(triangles)].sum(axis=1) - end - start
        length = np.linalg.norm(x[start] - x[end], axis=1)
        flat = (
            double_area(x[triangles[outer % len(triangles)]])
            < _SLIVER_HEIGHT * length**2
        )
        # If the third point is already on the outline, two parts of the body would
        # share only that point.
        sliver = np.flatnonzero(((length > longest) | flat) & ~np.isin(third, start))
        if not len(sliver):
            return triangles
        sliver = sliver[np.argsort(-length[sliver], kind="stable")]
        # one sliver for each third point
        removed = sliver[np.unique(third[sliver], return_index=True)[1]]
        triangles = np.delete(triangles, outer[removed] % len(triangles), axis=0)


def without_bridges(x: Array, triangles: Long) -> Long:
    """Remove triangles that bridge a hole: those with circumcircles wider than
    MAX_SPRING median springs."""
    side, first, _ = distinct_sides(triangles, len(x))
    length = bond_lengths(x, side).reshape(3, -1)
    widest = MAX_SPRING * float(np.median(length.ravel()[first]))
    return triangles[length.prod(axis=0) <= widest * double_area(x[triangles])]


def distinct_sides(triangles: Long, n: int) -> tuple[Long, Long, Long]:
    """Return the sides (3t, 2) of `triangles` (t, 3), the first occurrence and the
    count (m,) of distinct sides.

    Side k has the direction of triangle k % t. Sides of opposite directions are the
    same.
    """
    side = np.concatenate(
        [triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]]
    )
    _, first, count = np.unique(
        pair_keys(side, n), return_index=True, return_counts=True
    )
    return side, first, count


def pair_keys(pairs: NDArray[np.signedinteger], n: int) -> Long:
    """Return a unique number for each pair (..., 2) of n points, the same for (i, j)
    and (j, i)."""
    return pairs.min(axis=-1).astype(np.int64) * n + pairs.max(axis=-1)


def polygon_area(corners: Array) -> float:
    """Return the area [R^2] of the polygon with `corners` (n, 2), positive if
    counter-clockwise."""
    return 0.5 * float(
        np.sum(_cross(corners - corners[0], np.roll(corners, -1, axis=0) - corners[0]))
    )


def double_area(corner: Array) -> Array:
    """Return twice the areas (t,) [R^2] of triangles with corners (t, 3, 2), positive
    if counter-clockwise."""
    return _cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def chains(sides: Long) -> list[Long]:
    """Order directed `sides` (h, 2) into closed chains of points. Raises
    SimulationError if that is impossible."""
    following, rings = dict(sides.tolist()), list[Long]()
    closed = len(following) == len(sides)  # false if two parts share only a point
    while closed and following:
        chain = list(following.popitem())
        while chain[-1] not in (chain[0], None):
            chain.append(following.pop(chain[-1], None))
        closed = chain.pop() is not None
        rings.append(np.array(chain))
    if not closed:
        raise SimulationError(
            "the triangulation has no closed outline: choose another lattice seed"
        )
    return rings


def reverse_cuthill_mckee(bonds: Long, n: int, start: int) -> Long:
    """Return the reverse Cuthill-McKee order (n,) of points joined by `bonds` (m, 2),
    beginning at `start`."""
    # SciPy begins at a point of lowest degree and breaks ties by an unstable sort. An
    # additional point, with a single bond to `start`, makes its choice unique.
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    i, j = np.append(bonds, [[start, n]], axis=0).T
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(n + 1, n + 1))
    return reverse_cuthill_mckee(graph.tocsr())[:-1].astype(np.int64)
