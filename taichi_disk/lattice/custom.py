"""Points and springs of your own, from arrays or a file: read and checked."""

from __future__ import annotations

import hashlib
import stat
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.errors import InputError
from taichi_disk.lattice.random_points import MAX_POINTS, MIN_POINTS, hexagonal_spacing
from taichi_disk.lattice.triangles import Array, Long, double_area, pair_keys

_SMALLEST, _LARGEST = 0.5, 2.0  # half the larger extent [R]
_OFF_CENTRE = 0.1  # of the points' mean from x = 0 [R]
_COINCIDENT = 1e-6  # distance of two points, in hexagonal spacings
_BROKEN = RuntimeError, EOFError, zipfile.BadZipFile, zlib.error  # what zip files raise
MASSES = 1e-150, 1e150, 1e15  # least, most, and largest ratio: beyond it a step or a sum is no number any more
STIFFNESS, REST_LENGTHS = (1e-12, 1e12), (1e-9, 1e3)
LARGEST = 500_000_000  # bytes of a file: 2,000,000 points over as large a wall take 430,000,000


def checked_points(points: ArrayLike) -> Array:
    from taichi_disk.lattice.spatial import cKDTree

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
        raise InputError(f"the points' mean lies at x = {x[:, 0].mean():.4g} R: move them to x = 0")
    for i, j in sorted(cKDTree(x).query_pairs(_COINCIDENT * hexagonal_spacing(n))):
        raise InputError(f"points {i} and {j} are the same, ({x[i, 0]:.6g}, {x[i, 1]:.6g})")
    return x


def checked_springs(springs: ArrayLike, n: int) -> Long:
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


def checked_triangles(triangles: ArrayLike, x: Array, springs: Long | None) -> Long:
    """Counter-clockwise."""
    corners, n = np.asarray(triangles), len(x)
    if corners.ndim != 2 or corners.shape[1] != 3 or not np.issubdtype(corners.dtype, np.integer):
        raise InputError(f"triangles must be whole numbers of shape (t, 3), not {corners.dtype} of {corners.shape}")
    corners = corners.astype(np.int64)
    for k in np.flatnonzero((corners < 0).any(axis=1) | (corners >= n).any(axis=1)):
        raise InputError(f"triangle {k} has the corners {corners[k].tolist()}: three points of 0 to {n - 1}")
    turned = double_area(x[corners]) < 0.0
    corners[turned] = corners[turned, ::-1]
    if springs is not None:
        side = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
        for k in np.flatnonzero(~np.isin(pair_keys(side, n), pair_keys(springs, n)).all(axis=1)):
            raise InputError(f"triangle {k}, {corners[k].tolist()}, has a side that is no spring")
    return corners


def positive(values: ArrayLike, count: int, name: str, low: float, high: float, ratio: float = np.inf) -> Array:
    """`values` (count,), from `low` to `high`, the largest at most `ratio` times the smallest. Raises InputError."""
    array = numbers(values, name)
    if array.shape != (count,):
        raise InputError(f"{name} must have the shape ({count},), not {array.shape}")
    for k in np.flatnonzero(~((low <= array) & (array <= high))):
        raise InputError(f"{name}[{k}] is {array[k]:g}: it must be a positive number, from {low:g} to {high:g}")
    least = int(array.argmin())
    if array.max() > ratio * array[least]:
        raise InputError(
            f"{name}[{least}] is {array[least]:g}, less than {1 / ratio:g} of the largest, {array.max():g}"
        )
    return array


def numbers(values: ArrayLike, name: str) -> Array:
    """`values` as float64. Raises InputError, which tells the `name`, where they are no numbers."""
    with suppress(TypeError, ValueError, OverflowError):
        if not np.iscomplexobj(values):
            return np.array(values, dtype=np.float64, order="C")
    raise InputError(f"{name} must be an array of numbers, real ones that float64 can hold")


@contextmanager
def reading(path: Path, key: str) -> Iterator[None]:
    """What goes wrong within is an InputError with the file's name, and the `key` of `lattice` that names it.

    Raises it, too, for what should not be read at all.
    """
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) or found.st_size > LARGEST:  # to read a device or a pipe might never end
            raise InputError(f"is no regular file of at most {LARGEST / 1e6:,.0f} MB")
        yield
    except (InputError, OSError, ValueError, TypeError, LookupError, OverflowError, *_BROKEN) as error:
        raise InputError(f"lattice.{key}: {path}: {getattr(error, 'strerror', None) or error}") from error


def file_digest(file: str) -> str:
    """A hash of a file that a scene names in `lattice`, "" for `none`. Raises InputError if it cannot be read."""
    if file == "none":
        return ""
    with reading(Path(file), "file"):
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()


class _Arrays(dict[str, Any]):
    def __missing__(self, name: str) -> Any:
        raise InputError(f"has no array {name}, only {', '.join(self) or 'none at all'}")


def read_arrays(path: Path) -> dict[str, Any]:
    """The arrays of an npz file by name; `positions` and perhaps `masses` of a csv file. What it raises has no name."""
    if path.suffix.lower() == ".csv":
        lines = [line.replace('"', "").strip() for line in path.read_text(encoding="utf-8-sig").splitlines()]
        lines = [line for line in lines if line and not line.startswith("#")]
        header = bool(lines) and lines[0].lower().replace(" ", "") in ("x,y", "x,y,mass")
        if len(lines) == header:
            raise InputError("has no points")
        table = np.loadtxt(lines[header:], delimiter=",", ndmin=2)
        return _Arrays(positions=table[:, :2], masses=table[:, 2]) if table.shape[1] == 3 else _Arrays(positions=table)
    if path.suffix.lower() != ".npz":
        raise InputError("a lattice is read from a .csv or .npz file")
    with zipfile.ZipFile(path) as archive:  # NumPy takes what is no zip file for a pickle, and says so
        if sum(one.file_size for one in archive.infolist()) > LARGEST:
            raise InputError(f"unpacked it has more than {LARGEST / 1e6:,.0f} MB")
        for one in archive.infolist():  # NumPy takes the memory that an array claims before it looks for the numbers
            with archive.open(one) as member:
                old = np.lib.format.read_magic(member) == (1, 0)
                read = np.lib.format.read_array_header_1_0 if old else np.lib.format.read_array_header_2_0
                shape, _, kind = read(member)
            if prod(shape) * kind.itemsize > one.file_size:
                raise InputError(f"{one.filename} claims the shape {shape}, for which it has not the numbers")
    with np.load(path) as data:
        return _Arrays(data)


def points_of_disk(data: dict[str, Any], points: int) -> int:
    """How many of the first `points` points in a file are the disk's; the others are an elastic wall's."""
    n = np.asarray(data.get("disk_points", points))
    if n.shape or n.dtype.kind not in "iu" or not 0 <= n <= points:
        raise InputError(f"disk_points must be a whole number up to {points}, the number of points, not {n}")
    return int(n)


def of_disk(data: dict[str, Any]) -> dict[str, Any]:
    """The arguments of `Lattice.from_points` that a file holds."""
    arrays = {"points": data["positions"], "springs": data.get("bonds")}
    arrays |= {name: data.get(name) for name in ("rest_lengths", "stiffness", "triangles", "masses")}
    n = points_of_disk(data, len(arrays["points"]))
    if n < len(arrays["points"]):
        parts = {"springs": ("springs", "rest_lengths", "stiffness"), "triangles": ("triangles",)}
        for first, names in parts.items():
            if (pairs := arrays[first]) is not None:
                ours = (pairs < n).all(axis=1)
                arrays |= {name: one[ours] for name in names if (one := arrays[name]) is not None}
        arrays |= {name: one[:n] for name in ("points", "masses") if (one := arrays[name]) is not None}
    return arrays
