"""Read the arrays of lattices and velocities from files."""

from __future__ import annotations

import hashlib
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from taichi_disk.base.errors import (
    InputError,
    reason,
    shown_path,
    whole_number,
)
from taichi_disk.base.text_files import check_file

Arrays: TypeAlias = dict[str, Any]  # of a lattice, by name
# size limit of a file; a disk and a wall of 2,000,000 points each take 430,000,000
MAX_BYTES = 500_000_000
TABLES = (".csv", ".txt", ".tsv")
# arrays of a lattice, and the array that says to which points their rows belong
_OWNERS = {
    "bonds": "bonds",
    "rest_lengths": "bonds",
    "stiffness": "bonds",
    "triangles": "triangles",
}


@contextmanager
def reading(path: Path, key: str) -> Iterator[None]:
    """Turn errors within the block into InputErrors with the path and its `key` in the
    section `lattice`."""
    try:
        check_file(path, MAX_BYTES)
        yield
    except Exception as error:  # a damaged file may cause any
        what = reason(error)
        label = shown_path(path)
        if not what.startswith(label):
            what = f"{label}: {what}"
        raise InputError(f"lattice.{key}: {what}") from error


def file_digest(section: Any, key: str) -> str:
    """Return the SHA-256 of the file that `key` of the section `lattice` names, or ""
    for `none`. Raises InputError if it cannot be read."""
    file = getattr(section, key)
    if file == "none":
        return ""
    with reading(Path(file), key):
        return hashlib.sha256(Path(file).read_bytes()).hexdigest()


class _Arrays(Arrays):
    def __missing__(self, name: str) -> Any:
        raise InputError(
            f"has no array {name}, only {', '.join(self) or 'none at all'}"
        )


def read_arrays(path: Path) -> Arrays:
    """Return the arrays of an npz file by name."""
    # NumPy would take a broken zip file for a pickle
    with zipfile.ZipFile(path) as archive:
        if sum(item.file_size for item in archive.infolist()) > MAX_BYTES:
            raise InputError(f"unpacked it has more than {MAX_BYTES / 1e6:,.0f} MB")
    with np.load(path) as data:
        return _Arrays(data)


def points_of_disk(data: Arrays, points: int) -> int:
    """Return the number of the disk's points, which precede those of an elastic wall,
    in a file of `points` points."""
    n = np.asarray(data.get("disk_points", points)).tolist()
    return whole_number(n, "disk_points", points, 0, ", the number of points")


def disk_rows(arrays: Arrays, n: int) -> Arrays:
    """Return those rows of a lattice's `arrays` that belong to the first `n` points,
    their springs or triangles."""
    rows = {}
    for name, owner in _OWNERS.items():
        array = arrays.get(name)
        if array is not None:
            of_disk = np.less(arrays[owner], n).all(axis=-1)
            rows[name] = np.asarray(array)[of_disk]
    for name in ("positions", "masses"):
        if arrays.get(name) is not None:
            rows[name] = np.asarray(arrays[name])[:n]
    return rows
