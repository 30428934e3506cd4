"""Reading and validation of user-supplied points and springs, from arrays or files."""

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

_MIN_EXTENT, _MAX_EXTENT = 1.0, 4.0  # [R], larger of width and height
_MAX_OFFSET = 0.1  # distance of the points' mean from x = 0 [R]
_MIN_DISTANCE = 1e-6  # of distinct points, in hexagonal spacings
_ZIP_ERRORS = RuntimeError, EOFError, zipfile.BadZipFile, zlib.error
MASSES = 1e-150, 1e150, 1e15  # minimum, maximum and largest ratio; beyond them steps or sums are not finite
STIFFNESS, REST_LENGTHS = (1e-12, 1e12), (1e-9, 1e3)
MAX_BYTES = 500_000_000  # of a file; a disk and a wall of 2,000,000 points each take 430,000,000


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
    if not _MIN_EXTENT <= max(width, height) <= _MAX_EXTENT:
        limits = f"the larger must be between {_MIN_EXTENT:g} and {_MAX_EXTENT:g} R"
        size = f"the points extend over {width:.4g} x {height:.4g} R"
        raise InputError(f"{size}: {limits} (lengths are in units of the disk's radius R)")
    if abs(x[:, 0].mean()) > _MAX_OFFSET:
        raise InputError(f"the points' mean lies at x = {x[:, 0].mean():.4g} R: shift them so that it is at x = 0")
    for i, j in sorted(cKDTree(x).query_pairs(_MIN_DISTANCE * hexagonal_spacing(n))):
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
    """Validate `triangles` and orient them counter-clockwise."""
    corners, n = np.asarray(triangles), len(x)
    if corners.ndim != 2 or corners.shape[1] != 3 or not np.issubdtype(corners.dtype, np.integer):
        raise InputError(f"triangles must be whole numbers of shape (t, 3), not {corners.dtype} of {corners.shape}")
    corners = corners.astype(np.int64)
    for k in np.flatnonzero((corners < 0).any(axis=1) | (corners >= n).any(axis=1)):
        raise InputError(f"triangle {k} has the corners {corners[k].tolist()}: three points of 0 to {n - 1}")
    clockwise = double_area(x[corners]) < 0.0
    corners[clockwise] = corners[clockwise, ::-1]
    if springs is not None:
        side = np.stack([corners, np.roll(corners, -1, axis=1)], axis=2)
        for k in np.flatnonzero(~np.isin(pair_keys(side, n), pair_keys(springs, n)).all(axis=1)):
            where = f"triangle {k}, {corners[k].tolist()}"
            raise InputError(f"{where}, has a side that is no spring: add the spring or remove the triangle")
    return corners


def positive(values: ArrayLike, count: int, name: str, low: float, high: float, ratio: float = np.inf) -> Array:
    """Validate `values` (count,) between `low` and `high`, the largest at most `ratio` times the smallest."""
    array = numbers(values, name)
    if array.shape != (count,):
        raise InputError(f"{name} must have the shape ({count},), not {array.shape}")
    for k in np.flatnonzero(~((low <= array) & (array <= high))):
        raise InputError(f"{name}[{k}] is {array[k]:g}: it must be a positive number, from {low:g} to {high:g}")
    smallest = int(array.argmin())
    if array.max() > ratio * array[smallest]:
        raise InputError(
            f"{name}[{smallest}] is {array[smallest]:g}, less than {1 / ratio:g} of the largest, {array.max():g}"
        )
    return array


def numbers(values: ArrayLike, name: str) -> Array:
    """Convert `values` to float64. Raises InputError with their `name` if they are not real numbers."""
    with suppress(TypeError, ValueError, OverflowError):
        if not np.iscomplexobj(values):
            return np.array(values, dtype=np.float64, order="C")
    raise InputError(f"{name} must be an array of numbers, real ones that float64 can hold")


@contextmanager
def reading(path: Path, key: str) -> Iterator[None]:
    """Context in which errors become InputErrors with the path and its `key` in the section `lattice`.

    Raises InputError for devices, pipes and files larger than MAX_BYTES.
    """
    try:
        status = path.stat()
        if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_BYTES:  # reading a device or a pipe might never end
            raise InputError(f"is no regular file of at most {MAX_BYTES / 1e6:,.0f} MB")
        yield
    except (InputError, OSError, ValueError, TypeError, LookupError, OverflowError, *_ZIP_ERRORS) as error:
        raise InputError(f"lattice.{key}: {path}: {getattr(error, 'strerror', None) or error}") from error


def file_digest(file: str) -> str:
    """Return the SHA-256 of a file named in `lattice`, or "" for `none`. Raises InputError if it cannot be read."""
    if file == "none":
        return ""
    with reading(Path(file), "file"):
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()


class _Arrays(dict[str, Any]):
    def __missing__(self, name: str) -> Any:
        raise InputError(f"has no array {name}, only {', '.join(self) or 'none at all'}")


def read_arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of a file by name: all of an npz file, `positions` and possibly `masses` of a csv file."""
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
    with zipfile.ZipFile(path) as archive:  # NumPy would report a broken zip file as a pickle
        if sum(item.file_size for item in archive.infolist()) > MAX_BYTES:
            raise InputError(f"unpacked it has more than {MAX_BYTES / 1e6:,.0f} MB")
        for item in archive.infolist():  # NumPy allocates memory by the header, before it reads any numbers
            with archive.open(item) as member:
                is_version_1 = np.lib.format.read_magic(member) == (1, 0)
                read = np.lib.format.read_array_header_1_0 if is_version_1 else np.lib.format.read_array_header_2_0
                shape, _, kind = read(member)
            if prod(shape) * kind.itemsize > item.file_size:
                raise InputError(f"{item.filename} claims the shape {shape} but holds fewer numbers")
    with np.load(path) as data:
        return _Arrays(data)


def points_of_disk(data: dict[str, Any], points: int) -> int:
    """Return the number of points of the disk, which precede those of an elastic wall in a file of `points` points."""
    n = np.asarray(data.get("disk_points", points))
    if n.shape or n.dtype.kind not in "iu" or not 0 <= n <= points:
        raise InputError(f"disk_points must be a whole number up to {points}, the number of points, not {n}")
    return int(n)


def of_disk(data: dict[str, Any]) -> dict[str, Any]:
    """Return the arguments of `Lattice.from_points` from the arrays of a file."""
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
