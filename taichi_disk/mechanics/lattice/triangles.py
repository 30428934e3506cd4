"""Index arrays of springs and triangles: Delaunay triangulation, sides, outlines, areas
and numbering."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.errors import InputError, SimulationError

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
Long = NDArray[np.int64]

# height over longest side; a flatter triangle is three points on a line
_MIN_HEIGHT = 1e-9
# largest diameter of a circumcircle inside a body of bare points, in median springs;
# random points have up to 4
_MAX_CIRCLE = 5.0


def bond_lengths(positions: Array, bonds: NDArray[np.signedinteger]) -> Array:
    """Return the lengths (m,) [R] of `bonds` (m, 2) between `positions` (n, 2)."""
    i, j = bonds.T
    return norms((positions[i] - positions[j]).T)


def norms(vectors: Array) -> Array:
    """Return the lengths (k,) of vectors (2, k)."""
    # not np.hypot, whose rounding depends on the machine
    x, y = vectors
    return np.sqrt(x * x + y * y)


def quarter_turned(vectors: Array) -> Array:
    """Return `vectors` (..., 2) turned by a right angle, counter-clockwise."""
    return vectors[..., ::-1] * [-1.0, 1.0]


def delaunay(points: Array) -> Long:
    """Return the Delaunay triangles (t, 3) of `points` (n, 2), counter-clockwise,
    without those of zero area."""
    from scipy.spatial import Delaunay, QhullError

    try:
        triangles = Delaunay(points).simplices.astype(np.int64)  # counter-clockwise
    except QhullError as error:
        raise InputError(
            "the points lie on one line: a body needs points that span triangles"
        ) from error
    return triangles[~is_flat(points, triangles)]


def is_flat(
    x: Array, triangles: Long, min_height: float = _MIN_HEIGHT
) -> NDArray[np.bool_]:
    """Return whether the corners of each of the counter-clockwise `triangles` (t, 3)
    lie on one line: within `min_height` of the longest side."""
    corner = x[triangles]
    sides = corner - np.roll(corner, 1, axis=1)
    longest = np.max(np.sum(sides**2, axis=2), axis=1)
    return double_area(corner) <= min_height * longest


def centred(x: Array) -> Array:
    """Shift points (n, 2) by whole numbers to the origin; far away, areas of triangles
    lose digits by cancellation."""
    return x - np.round(x.mean(axis=0))


def compact_triangles(x: Array) -> Long:
    """Return the Delaunay triangles (t, 3) of bare points (n, 2) whose circumcircles
    are at most _MAX_CIRCLE median springs wide, and the narrowest triangle of every
    other point unless one of its sides is longer."""
    # Sorted, so that the numbering of the points does not choose diagonals of squares.
    order = np.lexsort(x.T)
    triangles = order[delaunay(centred(x[order]))]
    side, first, _ = distinct_sides(triangles, len(x))
    length = bond_lengths(x, side)
    widest = _MAX_CIRCLE * np.median(length[first])
    # The diameter of the circumcircle is the product of the sides over twice the area.
    sides = length.reshape(3, -1)
    diameter = sides.prod(axis=0) / double_area(x[triangles])
    narrowest = np.full(len(x), np.inf)
    np.minimum.at(narrowest, triangles, diameter[:, None])
    limit = np.maximum(narrowest, widest)
    is_compact = diameter <= limit[triangles].max(axis=1)
    is_short = sides.max(axis=0) <= widest
    return triangles[is_compact & is_short]


def enclosed_triangles(x: Array, springs: Long) -> Long:
    """Return the counter-clockwise triangles (t, 3) that three `springs` (m, 2) enclose
    and no spring divides."""
    n = len(x)
    start, end = np.concatenate([springs, springs[:, ::-1]]).T
    along_x, along_y = (x[end] - x[start]).T
    around = np.lexsort((np.arctan2(along_y, along_x), start))
    start = start[around]
    end = end[around]
    key = start * n + end
    by_key = np.argsort(key)
    opposite = by_key[np.searchsorted(key[by_key], end * n + start)]
    # On the left of a spring from i to j the next side leads from j to the neighbour
    # that precedes i around j.
    before = np.arange(len(start)) - 1
    is_first = np.diff(start, prepend=-1) > 0
    before[is_first] = np.searchsorted(start, start[is_first], "right") - 1
    second = before[opposite]
    third = second[second]
    corners = np.stack([start, start[second], start[third]], axis=1)
    is_closed = second[third] == np.arange(len(start))
    is_lowest = corners.argmin(axis=1) == 0  # each triangle is found from three sides
    corners = corners[is_closed & is_lowest]
    return corners[~is_flat(x, corners)]


def shown_point(point: Array) -> str:
    x, y = np.round(point, 9) + 0.0  # no digits of rounding errors, and no -0
    return f"({x:.8g}, {y:.8g})"  # so that places on a map differ


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
    arm = corners - corners[0]
    return 0.5 * np.sum(cross(arm, np.roll(arm, -1, axis=0)))


def double_area(corner: Array) -> Array:
    """Return twice the areas (t,) [R^2] of triangles with corners (t, 3, 2), positive
    if counter-clockwise."""
    return cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])


def cross(a: Array, b: Array) -> Array:
    """Return the cross products (k,) of vectors (k, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def chains(sides: Long) -> list[Long]:
    """Order directed `sides` (h, 2) into closed chains of points. Raises
    SimulationError if that is impossible."""
    following = dict(sides.tolist())
    if len(following) < len(sides):
        raise unusable("has no closed outline")  # two parts share only a point
    rings = []
    while following:
        start, point = following.popitem()
        ring = [start]
        while point != start:
            ring.append(point)
            point = following.pop(point)
        rings.append(np.array(ring))
    return rings


def unusable(fault: str) -> SimulationError:
    return SimulationError(f"the triangulation {fault}: choose another lattice seed")


def numbering(triangles: Long, x: Array) -> Long:
    """Return the reverse Cuthill-McKee order (n,) of the corners `x` (n, 2), which
    keeps memory accesses local. It begins at the leftmost point."""
    # SciPy begins at a point of lowest degree and breaks ties by an unstable sort. An
    # additional point, with a single bond to the leftmost, makes its choice unique.
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import reverse_cuthill_mckee

    n = len(x)
    side, first, _ = distinct_sides(triangles, n)
    leftmost = np.argmin(x[:, 0])
    i, j = np.append(side[first], [[leftmost, n]], axis=0).T
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(n + 1, n + 1))
    return reverse_cuthill_mckee(graph.tocsr())[:-1].astype(np.int64)
