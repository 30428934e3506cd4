"""Validation of user-supplied points, springs, triangles and numbers."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.errors import InputError
from taichi_disk.lattice.random_points import MAX_POINTS, MIN_POINTS, hexagonal_spacing
from taichi_disk.lattice.triangles import Array, Long, double_area, pair_keys

_MIN_EXTENT, _MAX_EXTENT = 1.0, 4.0  # limits for the larger of width and height [R]
_MAX_OFFSET = 0.1  # largest distance of the points' mean from x = 0 [R]
# points closer than this are the same point [spacing of a hexagonal lattice]
_MIN_DISTANCE = 1e-6
# minimum, maximum, largest ratio; beyond these, steps or sums are not finite
MASSES = 1e-150, 1e150, 1e15
STIFFNESS, REST_LENGTHS = (1e-12, 1e12), (1e-9, 1e3)


def checked_points(points: ArrayLike) -> Array:
    from taichi_disk.lattice.spatial import cKDTree

    x = numbers(points, "points")
    if x.ndim != 2 or x.shape[1] != 2:
        raise InputError(f"points must be an array of shape (n, 2), not {x.shape}")
    n = len(x)
    if not MIN_POINTS <= n <= MAX_POINTS:
        raise InputError(f"a lattice has {MIN_POINTS} to {MAX_POINTS} points, not {n}")
    if not np.isfinite(x).all():
        raise InputError(
            f"point {np.flatnonzero(~np.isfinite(x).all(axis=1))[0]} is not finite"
        )
    width, height = np.ptp(x, axis=0)
    if not _MIN_EXTENT <= max(width, height) <= _MAX_EXTENT:
        limits = f"the larger must be between {_MIN_EXTENT:g} and {_MAX_EXTENT:g} R"
        size = f"the points extend over {width:.4g} x {height:.4g} R"
        raise InputError(
            f"{size}: {limits} (lengths are in units of the disk's radius R)"
        )
    if abs(x[:, 0].mean()) > _MAX_OFFSET:
        raise InputError(
            f"the points' mean lies at x = {x[:, 0].mean():.4g} R: shift them so that"
            " it is at x = 0"
        )
    for i, j in sorted(cKDTree(x).query_pairs(_MIN_DISTANCE * hexagonal_spacing(n))):
        raise InputError(
            f"points {i} and {j} are the same, ({x[i, 0]:.6g}, {x[i, 1]:.6g})"
        )
    return x


def _checked_corners(values: ArrayLike, n: int, name: str, width: int) -> Long:
    corners = np.asarray(values)
    if (
        corners.ndim != 2
        or corners.shape[1] != width
        or not np.issubdtype(corners.dtype, np.integer)
    ):
        kind = f"{corners.dtype} of shape {corners.shape}"
        raise InputError(
            f"{name}s must be whole numbers of shape (any, {width}), not {kind}"
        )
    corners = corners.astype(np.int64)
    for k in np.flatnonzero((corners < 0).any(axis=1) | (corners >= n).any(axis=1)):
        raise InputError(
            f"{name} {k} is {corners[k].tolist()}: it must join {width} points of 0 to"
            f" {n - 1}"
        )
    return corners


def checked_springs(springs: ArrayLike, n: int) -> Long:
    pairs = _checked_corners(springs, n, "spring", 2)
    for k in np.flatnonzero(pairs[:, 0] == pairs[:, 1]):
        raise InputError(
            f"spring {k} joins {pairs[k].tolist()}: it needs two different points"
        )
    _, first = np.unique(pair_keys(pairs, n), return_index=True)
    for k in np.setdiff1d(np.arange(len(pairs)), first):
        raise InputError(
            f"spring {k} joins {pairs[k].tolist()}, which are joined already"
        )
    return pairs


def checked_triangles(triangles: ArrayLike, x: Array, springs: Long | None) -> Long:
    """Validate `triangles` and orient them counter-clockwise."""
    n = len(x)
    corners = _checked_corners(triangles, n, "triangle", 3)
    clockwise = double_area(x[corners]) < 0.0
    corners[clockwise] = corners[clockwise, ::-1]
    if springs is not None:
        side = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
        for k in np.flatnonzero(
            ~np.isin(pair_keys(side, n), pair_keys(springs, n)).all(axis=1)
        ):
            where = f"triangle {k}, {corners[k].tolist()}"
            raise InputError(
                f"{where}, has a side that is no spring: add the spring or remove the"
                " triangle"
            )
    return corners


def positive(
    values: ArrayLike,
    count: int,
    name: str,
    low: float,
    high: float,
    ratio: float = np.inf,
) -> Array:
    array = numbers(values, name)
    if array.shape != (count,):
        raise InputError(f"{name} must have the shape ({count},), not {array.shape}")
    for k in np.flatnonzero(~((low <= array) & (array <= high))):
        raise InputError(
            f"{name}[{k}] is {array[k]:g}: it must be a positive number, from {low:g}"
            f" to {high:g}"
        )
    smallest = int(array.argmin())
    if array.max() > ratio * array[smallest]:
        raise InputError(
            f"{name}[{smallest}] is {array[smallest]:g}, less than {1 / ratio:g} of the"
            f" largest, {array.max():g}"
        )
    return array


def numbers(values: ArrayLike, name: str) -> Array:
    with suppress(TypeError, ValueError, OverflowError):
        if not np.iscomplexobj(values):
            return np.array(values, dtype=np.float64, order="C")
    raise InputError(
        f"{name} must be an array of real numbers that float64 can represent"
    )
