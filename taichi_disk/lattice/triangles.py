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
    i, j = bonds.T
    return norms((positions[i] - positions[j]).T)


def norms(vectors: Array) -> Array:
    """Return the lengths (k,) of vectors (2, k)."""
    # not np.hypot, whose rounding depends on the machine
    x, y = vectors
    return np.asarray(np.sqrt(x * x + y * y))


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


def triangles_of(x: Array, springs: Long) -> tuple[Long, Long]:
    """Return two tilings (t, 3): the Delaunay triangles whose sides are springs, and
    all triangles whose sides are."""
    # The first tiling is right even if springs cross, the second only if no springs
    # cross.
    n = len(x)
    cycles = _spring_cycles(n, springs)
    clockwise = double_area(x[cycles]) < 0.0
    cycles[clockwise] = cycles[clockwise, ::-1]
    cycles = cycles[~is_flat(x, cycles)]
    for k in np.setdiff1d(np.arange(n), cycles):
        raise InputError(
            f"point {k} at {shown_point(x[k])} is no corner of a triangle of springs:"
            " remove it, or join it by more springs"
        )

    triangles = delaunay(centred(x))
    side = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    is_spring = np.isin(pair_keys(side, n), pair_keys(springs, n))
    return triangles[is_spring.all(axis=1)], cycles


def _spring_cycles(n: int, springs: Long) -> Long:
    """Return all triangles (t, 3), i < j < k, whose three sides are among `springs`
    (m, 2)."""
    pairs = np.sort(springs, axis=1).tolist()
    later: list[set[int]] = [set() for _ in range(n)]
    for i, j in pairs:
        later[i].add(j)
    cycles = []
    for i, j in pairs:
        for k in sorted(later[i] & later[j]):
            cycles.append((i, j, k))
    return np.array(cycles, np.int64).reshape(-1, 3)


def shown_point(point: Array) -> str:
    x, y = np.round(point, 9) + 0.0  # no digits of rounding errors, and no -0
    return f"({x:.4g}, {y:.4g})"


def without_slivers(x: Array, triangles: Long) -> Long:
    """Remove slivers from the outside in, longest outer side first, so that the outline
    remains one closed chain."""
    n = len(x)
    side, first, _ = distinct_sides(triangles, n)
    max_length = _MAX_OUTER_SIDE * float(np.median(bond_lengths(x, side[first])))
    while True:
        side, first, count = distinct_sides(triangles, n)
        outer = first[count == 1]
        start, end = side[outer].T
        owner = outer % len(triangles)  # the triangle of each outer side
        corners = triangles[owner]
        third = corners.sum(axis=1) - start - end
        length = np.linalg.norm(x[start] - x[end], axis=1)
        is_long = length > max_length
        is_low = double_area(x[corners]) < _SLIVER_HEIGHT * length**2
        # If the third point is already on the outline, two parts of the body would
        # share only that point.
        is_inner = ~np.isin(third, start)
        slivers = np.flatnonzero((is_long | is_low) & is_inner)
        if len(slivers) == 0:
            return triangles
        longest_first = slivers[np.argsort(-length[slivers], kind="stable")]
        # one sliver for each third point
        _, chosen = np.unique(third[longest_first], return_index=True)
        triangles = np.delete(triangles, owner[longest_first[chosen]], axis=0)


def without_bridges(x: Array, triangles: Long) -> Long:
    """Remove triangles that bridge a hole: those with circumcircles wider than
    MAX_SPRING median springs."""
    side, first, _ = distinct_sides(triangles, len(x))
    length = bond_lengths(x, side)
    widest = MAX_SPRING * float(np.median(length[first]))
    # The diameter of the circumcircle is the product of the sides over twice the area.
    product = length.reshape(3, -1).prod(axis=0)
    return triangles[product <= widest * double_area(x[triangles])]


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
    return 0.5 * float(np.sum(cross(arm, np.roll(arm, -1, axis=0))))


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
        raise _no_outline()  # two parts share only a point
    rings = []
    while following:
        start, point = following.popitem()
        ring = [start]
        while point != start:
            ring.append(point)
            if point not in following:
                raise _no_outline()
            point = following.pop(point)
        rings.append(np.array(ring))
    return rings


def _no_outline() -> SimulationError:
    return SimulationError(
        "the triangulation has no closed outline: choose another lattice seed"
    )


def why_not_one_piece(x: Array, triangles: Long) -> str:
    """Return why counter-clockwise `triangles` (t, 3) of the points `x` (n, 2) do not
    form a body, with the place, and what to do."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    n = len(x)
    side, _, _ = distinct_sides(triangles, n)
    start, end = side.T
    graph = coo_matrix((np.ones(len(side)), (start, end)), shape=(n, n))
    pieces, piece = connected_components(graph, directed=False)
    if pieces > 1:
        apart = int(np.argmax(piece != piece[0]))
        return (
            f"no triangles lead from point 0 at {shown_point(x[0])} to point {apart} at"
            f" {shown_point(x[apart])}: join its {pieces} pieces by triangles"
        )
    return "parts of it share only single points: join them by triangles"


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
