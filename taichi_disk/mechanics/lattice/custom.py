"""Validation of user-supplied points, springs, triangles and numbers."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.lattice.random_points import (
    MAX_POINTS,
    MIN_POINTS,
    hexagonal_spacing,
)
from taichi_disk.mechanics.lattice.triangles import (
    Array,
    Long,
    double_area,
    is_flat,
    pair_keys,
    shown_point,
)

# limits for the larger of width and height [R]
_MIN_EXTENT = 1.0
_MAX_EXTENT = 4.0
# Points closer than this are the same point [spacing of a hexagonal lattice]: those of
# an open seam differ by roundings of six digits, those of random points by more.
_MIN_DISTANCE = 1e-4
# height over longest side of a user's triangle that cannot be told from a line
_ROUNDING = 1e-14
# minimum and maximum; beyond these, steps or sums are not finite
_MASSES = (1e-150, 1e150)
_LIGHTEST = 1e-15  # smallest mass over the largest
_OF_SPRINGS = {"stiffness": (1e-12, 1e12), "rest_lengths": (1e-9, 1e3)}


def refuse(is_bad: Any, fault: Callable[[int], str]) -> None:
    """Raise InputError with the `fault` of the first bad row, if there is one."""
    if is_bad.any():
        raise InputError(fault(int(is_bad.argmax())))


def point_array(points: ArrayLike) -> Array:
    """Return `points` as a new array (n, 2) of finite numbers."""
    x = numbers(points, "points")
    if x.shape[1:] != (2,) or not MIN_POINTS <= len(x) <= MAX_POINTS:
        raise InputError(
            f"points must be an array of shape (n, 2), n from {MIN_POINTS} to"
            f" {MAX_POINTS}, not {x.shape}"
        )
    refuse(~np.isfinite(x).all(axis=1), lambda k: f"point {k} is not finite")
    return x


def check_body(x: Array, max_offset: float) -> None:
    """Raise InputError unless the points `x` (n, 2) [R] are distinct, have the size of
    a disk, and their mean is at most `max_offset` [R] from x = 0."""
    from scipy.spatial import cKDTree

    width, height = np.ptp(x, axis=0)
    if not _MIN_EXTENT <= max(width, height) <= _MAX_EXTENT:
        raise InputError(
            f"the points extend over {width:.4g} x {height:.4g} R: the larger must be"
            f" between {_MIN_EXTENT:g} and {_MAX_EXTENT:g} R (points are in units of"
            " the disk's radius R; an outline gets the area of the disk)"
        )
    middle = x[:, 0].mean()
    if abs(middle) > max_offset:
        raise InputError(
            f"the points' mean lies at x = {middle:.4g} R: shift them so that it is at"
            " x = 0 (a mesh that is finer on one side is heavier there: mesh it evenly)"
        )
    least = _MIN_DISTANCE * hexagonal_spacing(len(x))
    for i, j in sorted(cKDTree(x).query_pairs(least)):
        raise InputError(
            f"points {i} and {j} are the same, {shown_point(x[i])}: make them one (in"
            " gmsh, Coherence Mesh does)"
        )


def checked_springs(springs: ArrayLike, n: int) -> Long:
    """Return `springs` as an array (m, 2) of distinct pairs of n points."""
    pairs = _checked_corners(springs, n, "spring", 2)
    first, second = pairs.T

    def label(k: int) -> str:
        return f"spring {k} joins {pairs[k].tolist()}"

    refuse(first == second, lambda k: f"{label(k)}: it needs two different points")
    repeats = _repeats(pair_keys(pairs, n))
    refuse(repeats, lambda k: f"{label(k)}, which are joined already")
    return pairs


def _repeats(keys: Long) -> NDArray[np.bool_]:
    """Return whether each of the `keys` (k,) stands earlier in the array, too."""
    _, first = np.unique(keys, return_index=True)
    is_repeat = np.ones(len(keys), bool)
    is_repeat[first] = False
    return is_repeat


def checked_triangles(triangles: ArrayLike, x: Array, springs: Long | None) -> Long:
    """Validate `triangles` and orient them counter-clockwise."""
    n = len(x)
    corners = _checked_corners(triangles, n, "triangle", 3)
    if len(corners) == 0:
        raise InputError("there are no triangles")
    clockwise = double_area(x[corners]) < 0.0
    corners[clockwise] = corners[clockwise, ::-1]
    refuse_overlap(x, corners)
    if springs is not None:
        side = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
        has_springs = np.isin(pair_keys(side, n), pair_keys(springs, n)).all(axis=1)
        refuse(
            ~has_springs,
            lambda k: (
                f"{_shown_triangle(corners, k)}, has a side that is no spring: add the"
                " spring or remove the triangle"
            ),
        )
    return corners


def refuse_overlap(x: Array, corners: Long) -> None:
    """Raise InputError if a counter-clockwise triangle is flat, or two of them lie on
    the same side of a line of two points."""
    refuse(
        is_flat(x, corners, _ROUNDING),
        lambda k: (
            f"{_shown_triangle(corners, k)}, is flat: its corners lie on one line"
        ),
    )
    # Both have this line as a side of the same direction.
    start = corners.ravel()
    end = np.roll(corners, -1, axis=1).ravel()
    directed = start * len(x) + end  # a number for each side with its direction

    def fault(side: int) -> str:
        same_side = int(np.argmax(directed == directed[side]))  # the first of them
        earlier = _shown_triangle(corners, same_side // 3)
        later = _shown_triangle(corners, side // 3)
        return (
            f"{later}, and {earlier}, overlap: they lie on the same side of the line"
            f" between points {start[side]} and {end[side]}"
        )

    refuse(_repeats(directed), fault)


def refuse_loose_points(x: Array, corners: Long) -> None:
    """Raise InputError if a point of `x` (n, 2) is not among the `corners` (t, 3)."""
    refuse(
        ~np.isin(np.arange(len(x)), corners),
        lambda k: (
            f"point {k} at {shown_point(x[k])} is no corner of a triangle: remove it,"
            " join it by more springs, or give `triangles`, as springs that cross need"
        ),
    )


def _shown_triangle(corners: Long, k: int) -> str:
    return f"triangle {k}, {corners[k].tolist()}"


def _checked_corners(values: ArrayLike, n: int, name: str, width: int) -> Long:
    corners = np.asarray(values)
    has_form = corners.ndim == 2 and corners.shape[1] == width
    has_integers = np.issubdtype(corners.dtype, np.integer)
    if not (has_form and has_integers):
        kind = f"{corners.dtype} of shape {corners.shape}"
        raise InputError(
            f"{name}s must be whole numbers of shape (any, {width}), not {kind}"
        )
    corners = corners.astype(np.int64)
    is_outside = (corners < 0) | (corners >= n)
    refuse(
        is_outside.any(axis=1),
        lambda k: (
            f"{name} {k} is {corners[k].tolist()}: it must join {width} points of 0 to"
            f" {n - 1}"
        ),
    )
    return corners


def left_out(x: Array, used: Long) -> str:
    """Return a note about the points of `x` (n, 2) that are not among the `used`
    ones."""
    unused = np.setdiff1d(np.arange(len(x)), used)
    k = unused[0]
    return (
        f"{len(unused):,} of {len(x):,} points are no triangle's corner and were left"
        f" out, the first is point {k} at {shown_point(x[k])}; points after it have"
        " smaller numbers here"
    )


def check_masses(masses: Array) -> None:
    """Raise InputError unless a body can have these `masses`, which are in any unit."""
    lightest, heaviest = _MASSES
    _check_range("masses", masses, lightest, heaviest)
    _check_range("masses", masses, _LIGHTEST * masses.max(), heaviest)


def check_springs(name: str, values: Array) -> None:
    """Raise InputError unless springs can have these rest lengths or stiffnesses."""
    _check_range(name, values, *_OF_SPRINGS[name])


def column(values: ArrayLike, count: int, name: str) -> Array:
    """Return `values` as a new array (count,)."""
    array = numbers(values, name)
    if array.shape != (count,):
        raise InputError(f"{name} must have the shape ({count},), not {array.shape}")
    return array


def _check_range(name: str, array: Array, low: float, high: float) -> None:
    is_allowed = (low <= array) & (array <= high)
    refuse(
        ~is_allowed,
        lambda k: (
            f"{name}[{k}] is {array[k]:g}: it must be a positive number, from {low:g}"
            f" to {high:g}"
        ),
    )


def numbers(values: ArrayLike, name: str) -> Array:
    with suppress(TypeError, ValueError, OverflowError):
        if not np.iscomplexobj(values):
            return np.array(values, dtype=np.float64, order="C")
    raise InputError(
        f"{name} must be an array of real numbers that float64 can represent"
    )
