"""Delaunay triangles of a point set, checked, with bonds, outline and an order that keeps memory local."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

Array = NDArray[np.float64]
Indices = NDArray[np.int32]

# Height over longest side. Three points of a straight row span a triangle of zero area, up to rounding.
_FLAT = 1e-9


@dataclass(frozen=True)
class Mesh:
    positions: Array  # (n, 2), reordered
    triangles: Indices  # (t, 3), counter-clockwise
    bonds: Indices  # (m, 2), bonds[:, 0] < bonds[:, 1], sorted lexicographically
    outline: Indices  # (h,), counter-clockwise, from the lowest index on


def triangulate(points: Array) -> Mesh:
    """Delaunay mesh of `points` (n, 2), the points reordered by reverse Cuthill-McKee for locality.

    Raises SimulationError if the triangles do not tile the outline's interior and use every point.
    """
    from scipy.spatial import Delaunay

    triangles = Delaunay(points).simplices.astype(np.int64)  # counter-clockwise
    corner = points[triangles]
    double_area = _cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    longest = np.max(np.sum((corner - np.roll(corner, 1, axis=1)) ** 2, axis=2), axis=1)
    solid = double_area > _FLAT * longest
    triangles = triangles[solid]

    bonds, outline = _sides(triangles, len(points))
    _check(points, bonds, outline, len(triangles), 0.5 * float(double_area[solid].sum()))

    order = _reverse_cuthill_mckee(bonds, len(points), int(np.argmin(points[:, 0])))
    rank = np.empty(len(points), dtype=np.int64)
    rank[order] = np.arange(len(points))
    bonds = np.sort(rank[bonds], axis=1)
    bonds = bonds[np.argsort(bonds[:, 0] * len(points) + bonds[:, 1])]
    outline = rank[outline]
    return Mesh(
        points[order],
        rank[triangles].astype(np.int32),
        bonds.astype(np.int32),
        np.roll(outline, -int(np.argmin(outline))).astype(np.int32),
    )


def polygon_area(corners: Array) -> float:
    """Area [R^2] inside the closed polygon through `corners` (n, 2), positive if counter-clockwise."""
    return 0.5 * float(np.sum(_cross(corners, np.roll(corners, -1, axis=0))))


def _cross(a: Array, b: Array) -> Array:
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def _sides(triangles: NDArray[np.int64], n: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Bonds: every side once, in no order. Outline: the sides of a single triangle, joined to a chain."""
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    key = sides.min(axis=1) * n + sides.max(axis=1)
    order = np.argsort(key, kind="stable")
    change = np.flatnonzero(np.diff(key[order], prepend=-1, append=-1))
    bonds = sides[order[change[:-1]]]
    single = sides[order[change[:-1][np.diff(change) == 1]]]

    following = dict(single.tolist())
    chain = [int(single[0, 0])]
    while len(chain) <= len(single) and following[chain[-1]] != chain[0]:
        chain.append(following[chain[-1]])
    if len(chain) != len(single):
        raise SimulationError("the triangulation has a hole: choose another lattice seed")
    return bonds, np.array(chain)


def _check(points: Array, bonds: NDArray[np.int64], outline: NDArray[np.int64], triangles: int, area: float) -> None:
    n = len(points)
    whole = abs(area - polygon_area(points[outline])) <= 1e-9 * area
    euler = n - len(bonds) + triangles == 1
    used = len(np.unique(bonds)) == n
    if not (whole and euler and used):
        raise SimulationError("the triangulation is degenerate: choose another lattice seed")


def _reverse_cuthill_mckee(bonds: NDArray[np.int64], n: int, start: int) -> NDArray[np.int64]:
    """Breadth first from `start`, level by level; children of one parent by rising degree, then by index.

    SciPy's own uses an unstable sort, whose ties fall differently on different processors.
    """
    degree = np.bincount(bonds.ravel(), minlength=n)
    tail = np.concatenate([bonds[:, 0], bonds[:, 1]])
    head = np.concatenate([bonds[:, 1], bonds[:, 0]])
    by_tail = np.lexsort((head, degree[head], tail))
    head = head[by_tail]
    first = np.cumsum(degree) - degree

    seen = np.zeros(n, dtype=bool)
    level = np.array([start])
    levels = []
    while len(level):
        seen[level] = True
        levels.append(level)
        count = degree[level]
        slots = np.repeat(first[level] - np.cumsum(count) + count, count) + np.arange(count.sum())
        children = head[slots]
        children = children[~seen[children]]
        _, earliest = np.unique(children, return_index=True)
        level = children[np.sort(earliest)]
    order = np.concatenate(levels)
    if len(order) != n:
        raise SimulationError("the lattice is not connected: choose another lattice seed")
    return order[::-1]
