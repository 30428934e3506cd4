"""A disk of points and springs of your own, from arrays or a file, checked."""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice.disk import MAX_POINTS, MIN_POINTS, hexagonal_spacing
from taichi_disk.lattice.lattice import (
    Array,
    Lattice,
    Long,
    bond_lengths,
    delaunay,
    distinct_sides,
    double_area,
    pair_keys,
    tiled,
)

_SMALLEST, _LARGEST = 0.5, 2.0  # half the larger extent [R]
_OFF_CENTRE = 0.1  # of the centre of mass from x = 0 [R]
_COINCIDENT = 1e-6  # distance of two points, in hexagonal spacings
_LONG = 3.0  # a sliver's outer side over the median spring
_FLAT = 0.25  # a sliver's height over its outer side
_GAP = 5.0  # longest spring over the median; points at random have some of 4.4


def custom_lattice(
    points: ArrayLike, springs: ArrayLike | None = None, rest_lengths: ArrayLike | None = None
) -> Lattice:
    """A disk-like body of your own: one piece, without holes, made of triangles; every point has the mass 1/n [M].

    Springs that are not given join Delaunay neighbours. Slivers along the hull are left out: a triangle whose outer
    side is longer than 3 times the median spring or 4 times the triangle's height, if its third point lies inside
    (after Duckham et al., Pattern Recognition 41, 3224, 2008). Springs that are given must make triangles; they may
    cross one another if the Delaunay triangles are among these.

    Args:
        points: (n, 2) [R], the radius about 1, the centre of mass near x = 0. The scene chooses the height.
        springs: (m, 2) pairs of indices into `points`.
        rest_lengths: (m,) [R]; without, the springs are at rest at `points`.

    Raises:
        InputError: The points or springs are no such body; the message says where.
    """
    x = _checked_points(points)
    if springs is None:
        if rest_lengths is not None:
            raise InputError("rest_lengths need the springs that they belong to")
        triangles = _delaunay(x)
        lattice, _ = _body(x, None, _without_slivers(x, triangles), triangles)
        _check_gaps(lattice)
        return lattice
    bonds = _checked_springs(springs, len(x))
    lattice, order = _body(x, bonds, *_triangles_of(x, bonds))
    if rest_lengths is None:
        return lattice
    rest, rank = _checked_lengths(rest_lengths, len(bonds)), np.argsort(order)
    return replace(lattice, rest_lengths=rest[np.argsort(pair_keys(rank[bonds], len(x)))])


def read_lattice(path: str | Path) -> Lattice:
    """The disk of the points in a file, made by `custom_lattice`.

    Either a csv file of two columns x, y [R], with or without the header "x,y"; or an npz file with `positions` (n, 2)
    and perhaps `bonds` (m, 2) and `rest_lengths` (m,), such as lattice.npz of a run. An elastic wall, which is the
    positions beyond `disk_points`, is not read, nor are masses.

    Raises InputError, with the file's name, if it cannot be read or its points are no disk.
    """
    path = Path(path)
    readers = {".csv": _read_csv, ".npz": _read_npz}
    if path.suffix.lower() not in readers:
        raise InputError(f"{path}: a lattice is read from a .csv or .npz file")
    try:
        return replace(custom_lattice(*readers[path.suffix.lower()](path)), origin=path.name)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror or error}") from error
    except (InputError, ValueError, TypeError, IndexError, OverflowError, zipfile.BadZipFile, zlib.error) as error:
        raise InputError(f"{path}: {error}") from error


def disk_of(lattice: Lattice) -> Lattice:
    """The disk of `lattice`, without its elastic wall if there is one.

    Raises InputError where it is no `Lattice`, or its masses are not equal, 1 M in all.
    """
    if not isinstance(lattice, Lattice):
        raise InputError(f"lattice: must be a Lattice, see Lattice.from_points, not {type(lattice).__name__}")
    n = lattice.disk_points
    if not np.allclose(lattice.masses, 1.0 / n, rtol=1e-9, atol=0.0):
        raise InputError(f"lattice: every point must have the mass 1/{n} M")
    if not len(lattice.wall_surface):
        return lattice
    springs, corners, none = lattice.bonds[:, 1] < n, lattice.triangles.max(axis=1) < n, lattice.wall_surface[:0]
    return replace(
        lattice,
        positions=lattice.positions[:n],
        bonds=lattice.bonds[springs],
        rest_lengths=lattice.rest_lengths[springs],
        masses=lattice.masses[:n],
        wall_surface=none,
        wall_boundary=none,
        triangles=lattice.triangles[corners],
    )


def file_digest(file: str) -> str:
    """A hash of the file that a scene takes its lattice from, "" for `none`. Raises InputError if it cannot be read."""
    try:
        return "" if file == "none" else hashlib.sha256(Path(file).read_bytes()).hexdigest()
    except OSError as error:
        raise InputError(f"lattice.file: {file}: {error.strerror or error}") from None


def _read_csv(path: Path) -> tuple[Array]:
    lines = [line.replace('"', "").strip() for line in path.read_text(encoding="utf-8-sig").splitlines()]
    lines = [line for line in lines if line and not line.startswith("#")]
    header = bool(lines) and lines[0].lower().replace(" ", "") == "x,y"
    if len(lines) == header:
        raise InputError("has no points")
    return (np.loadtxt(lines[header:], delimiter=",", ndmin=2),)


def _read_npz(path: Path) -> tuple[Any, ...]:
    with path.open("rb") as file:
        data = dict(np.lib.npyio.NpzFile(file))  # np.load takes what is no zip file for a pickle, and says so
    if "positions" not in data:
        raise InputError(f"has no array positions, only {', '.join(data) or 'none at all'}")
    positions, bonds, rest = data["positions"], data.get("bonds"), data.get("rest_lengths")
    n = int(data.get("disk_points", len(positions)))
    if bonds is not None and n < len(positions):
        of_disk = (bonds < n).all(axis=1)
        bonds, rest = bonds[of_disk], None if rest is None else rest[of_disk]
    return positions[:n], bonds, rest


def _body(x: Array, bonds: Long | None, *candidates: Long) -> tuple[Lattice, Long]:
    """`tiled` by the first of the `candidates`, each (t, 3), that makes one piece."""
    for triangles in candidates:
        try:
            return tiled(x, triangles, bonds)
        except SimulationError:
            continue
    raise InputError("the springs' triangles do not make one piece without holes")


def _checked_points(points: ArrayLike) -> Array:
    from scipy.spatial import cKDTree

    x = numbers(points, "points")
    if x.ndim != 2 or x.shape[1] != 2:
        raise InputError(f"points must be an array of shape (n, 2), not {x.shape}")
    n = len(x)
    if not MIN_POINTS <= n <= MAX_POINTS:
        raise InputError(f"a lattice has {MIN_POINTS} to {MAX_POINTS} points, not {n}")
    if not np.isfinite(x).all():
        raise InputError(f"point {np.flatnonzero(~np.isfinite(x).all(axis=1))[0]} is not finite")
    width, height = np.ptp(x, axis=0)
    if not 2 * _SMALLEST <= max(width, height) <= 2 * _LARGEST:
        limits = f"the larger must be between {2 * _SMALLEST:g} and {2 * _LARGEST:g} R"
        size = f"the points extend over {width:.4g} x {height:.4g} R"
        raise InputError(f"{size}: {limits} (lengths are in units of the disk's radius R)")
    if abs(x[:, 0].mean()) > _OFF_CENTRE:
        raise InputError(f"the centre of mass lies at x = {x[:, 0].mean():.4g} R: move the points to x = 0")
    for i, j in sorted(cKDTree(x).query_pairs(_COINCIDENT * hexagonal_spacing(n))):
        raise InputError(f"points {i} and {j} are the same, ({x[i, 0]:.6g}, {x[i, 1]:.6g})")
    return x


def _checked_springs(springs: ArrayLike, n: int) -> Long:
    pairs = np.asarray(springs)
    if pairs.ndim != 2 or pairs.shape[1] != 2 or not np.issubdtype(pairs.dtype, np.integer):
        raise InputError(f"springs must be whole numbers of shape (m, 2), not {pairs.dtype} of shape {pairs.shape}")
    pairs = pairs.astype(np.int64)
    for k in np.flatnonzero((pairs < 0).any(axis=1) | (pairs >= n).any(axis=1) | (pairs[:, 0] == pairs[:, 1])):
        raise InputError(f"spring {k} joins {pairs[k].tolist()}: two different points of 0 to {n - 1}")
    _, first = np.unique(pair_keys(pairs, n), return_index=True)
    for k in np.setdiff1d(np.arange(len(pairs)), first):
        raise InputError(f"spring {k} joins {pairs[k].tolist()}, which are joined already")
    return pairs


def _checked_lengths(rest_lengths: ArrayLike, springs: int) -> Array:
    rest = numbers(rest_lengths, "rest_lengths")
    if rest.shape != (springs,):
        raise InputError(f"rest_lengths must have the shape ({springs},) of the springs, not {rest.shape}")
    for k in np.flatnonzero(~(np.isfinite(rest) & (rest > 0.0))):
        raise InputError(f"rest length {k} is {rest[k]:g}: it must be positive")
    return rest


def numbers(values: ArrayLike, name: str) -> Array:
    """`values` as float64. Raises InputError, which tells the `name`, where they are no numbers."""
    try:
        return np.array(values, dtype=np.float64, order="C")
    except (TypeError, ValueError) as error:
        raise InputError(f"{name} must be an array of numbers") from error


def _triangles_of(x: Array, springs: Long) -> tuple[Long, Long]:
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

    triangles = _delaunay(x)
    side = np.stack([triangles, np.roll(triangles, -1, axis=1)], axis=2)
    joined = np.isin(pair_keys(side, len(x)), pair_keys(springs, len(x))).all(axis=1)
    return triangles[joined], every


def _delaunay(x: Array) -> Long:
    from scipy.spatial import QhullError

    try:
        return delaunay(x)
    except QhullError as error:
        raise InputError("the points lie on one line") from error


def _without_slivers(x: Array, triangles: Long) -> Long:
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
        flat = double_area(x[triangles[outer % len(triangles)]]) < _FLAT * length**2
        # A third point on the outline already would hold its two halves together alone.
        sliver = np.flatnonzero(((length > longest) | flat) & ~np.isin(third, start))
        if not len(sliver):
            return triangles
        sliver = sliver[np.argsort(-length[sliver], kind="stable")]
        one_each = sliver[np.unique(third[sliver], return_index=True)[1]]
        triangles = np.delete(triangles, outer[one_each] % len(triangles), axis=0)


def _check_gaps(lattice: Lattice) -> None:
    length = lattice.rest_lengths
    k, typical = int(length.argmax()), float(np.median(length))
    if length[k] > _GAP * typical:
        (x, y), (u, v) = lattice.positions[lattice.bonds[k]]
        gap = f"a gap of {length[k]:.3g} R, where springs measure {typical:.3g} R"
        raise InputError(
            f"the spring from ({x:.4g}, {y:.4g}) to ({u:.4g}, {v:.4g}) would cross {gap}: fill the gap, or give the "
            "springs"
        )
