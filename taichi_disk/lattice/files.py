"""Read the arrays of lattices and velocities from files."""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk.errors import InputError, printable
from taichi_disk.lattice.tables import read_table
from taichi_disk.text_files import check_file, read_text

# size limit of a file; a disk and a wall of 2,000,000 points each take 430,000,000
MAX_BYTES = 500_000_000
_ERRORS = (
    InputError,
    OSError,
    ValueError,
    TypeError,
    LookupError,
    OverflowError,
    MemoryError,
    # of a damaged zip file
    RuntimeError,
    EOFError,
    zipfile.BadZipFile,
    zlib.error,
)
TABLES = (".csv", ".txt", ".tsv")


@contextmanager
def reading(path: Path, key: str) -> Iterator[None]:
    """Turn errors within the block into InputErrors with the path and its `key` in the
    section `lattice`."""
    try:
        check_file(path, MAX_BYTES)
        yield
    except _ERRORS as error:
        what = getattr(error, "strerror", None) or str(error)
        label = printable(str(path), width=1000)
        if not what.startswith(label):
            what = f"{label}: {what}"
        raise InputError(f"lattice.{key}: {what}") from error


def file_digest(file: str) -> str:
    """Return the SHA-256 of a file named in `lattice`, or "" for `none`. Raises
    InputError if it cannot be read."""
    if file == "none":
        return ""
    with reading(Path(file), "file"):
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()


class _Arrays(dict[str, Any]):
    def __missing__(self, name: str) -> Any:
        raise InputError(
            f"has no array {name}, only {', '.join(self) or 'none at all'}"
        )


def read_arrays(path: Path) -> dict[str, Any]:
    """Return the arrays of an npz file by name, or `positions` and possibly `masses` of
    a table."""
    if path.suffix.lower() in TABLES:
        positions, masses = read_table(read_text(path, MAX_BYTES))
        if masses is None:
            return _Arrays(positions=positions)
        return _Arrays(positions=positions, masses=masses)
    # NumPy would take a broken zip file for a pickle
    with zipfile.ZipFile(path) as archive:
        if sum(item.file_size for item in archive.infolist()) > MAX_BYTES:
            raise InputError(f"unpacked it has more than {MAX_BYTES / 1e6:,.0f} MB")
    with np.load(path) as data:
        return _Arrays(data)


def points_of_disk(data: Mapping[str, Any], points: int) -> int:
    """Return the number of the disk's points, which precede those of an elastic wall,
    in a file of `points` points."""
    n = np.asarray(data.get("disk_points", points))
    if n.shape or n.dtype.kind not in "iu" or not 0 <= n <= points:
        raise InputError(
            f"disk_points must be a whole number up to {points}, the number of points,"
            f" not {n}"
        )
    return int(n)


def rows_of_disk(data: Mapping[str, Any], n: int) -> dict[str, Any]:
    """Return the rows of the first `n` points for each array of a file that belongs to
    points, springs or triangles."""
    for name, width in (("bonds", 2), ("triangles", 3)):
        shape = np.shape(data.get(name, np.empty((0, width))))
        if len(shape) != 2 or shape[1] != width:
            raise InputError(f"{name} must have the shape (any, {width}), not {shape}")
    for name in ("rest_lengths", "stiffness"):
        if name in data:
            springs = len(data["bonds"])
            shape = np.shape(data[name])
            if shape != (springs,):
                raise InputError(
                    f"{name} must have the shape ({springs},), as there are bonds, not"
                    f" {shape}"
                )
    return _Arrays(disk_rows(data, n))


def disk_rows(arrays: Mapping[str, Any], n: int) -> dict[str, Any]:
    """Return the rows of the first `n` points for each of a lattice's `arrays` that is
    not None."""
    rows: dict[str, Any] = {"positions": slice(n), "masses": slice(n)}
    if arrays.get("bonds") is not None:
        of_disk = (arrays["bonds"] < n).all(axis=1)
        rows |= {"bonds": of_disk, "rest_lengths": of_disk, "stiffness": of_disk}
    if arrays.get("triangles") is not None:
        rows["triangles"] = (arrays["triangles"] < n).all(axis=1)
    return {
        name: arrays[name][chosen]
        for name, chosen in rows.items()
        if arrays.get(name) is not None
    }
