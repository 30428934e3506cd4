"""Read lattices and velocities from files, and the user-supplied initial state of a
run."""

from __future__ import annotations

import hashlib
import stat
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from taichi_disk.errors import InputError
from taichi_disk.lattice.custom import numbers
from taichi_disk.lattice.lattice import Lattice, disk_of, disk_rows
from taichi_disk.lattice.triangles import Array

_ZIP_ERRORS = RuntimeError, EOFError, zipfile.BadZipFile, zlib.error
# size limit of a file; a disk and a wall of 2,000,000 points each take 430,000,000
MAX_BYTES = 500_000_000


@contextmanager
def reading(path: Path, key: str) -> Iterator[None]:
    """Turn errors within the block into InputErrors with the path and its `key` in the
    section `lattice`."""
    try:
        status = path.stat()
        # a device or a pipe may never end
        if not stat.S_ISREG(status.st_mode) or status.st_size > MAX_BYTES:
            raise InputError(
                f"is not a regular file of at most {MAX_BYTES / 1e6:,.0f} MB"
            )
        yield
    except (
        InputError,
        OSError,
        ValueError,
        TypeError,
        LookupError,
        OverflowError,
        MemoryError,
        *_ZIP_ERRORS,
    ) as error:
        raise InputError(
            f"lattice.{key}: {path}: {getattr(error, 'strerror', None) or error}"
        ) from error


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
    """Return the arrays of a file by name: all of an npz file, `positions` and possibly
    `masses` of a csv file."""
    if path.suffix.lower() == ".csv":
        lines = [
            line.replace('"', "").strip()
            for line in path.read_text(encoding="utf-8-sig").splitlines()
        ]
        lines = [line for line in lines if line and not line.startswith("#")]
        header = bool(lines) and lines[0].lower().replace(" ", "") in (
            "x,y",
            "x,y,mass",
        )
        if len(lines) == header:
            raise InputError("has no points")
        table = np.loadtxt(lines[header:], delimiter=",", ndmin=2)
        return (
            _Arrays(positions=table[:, :2], masses=table[:, 2])
            if table.shape[1] == 3
            else _Arrays(positions=table)
        )
    if path.suffix.lower() != ".npz":
        raise InputError("a lattice is read from a .csv or .npz file")
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


def read_lattice(path: str | Path) -> Lattice:
    """Read the points of a disk from a file and return their lattice, made by
    `Lattice.from_points`.

    A csv file has the columns x, y [R] and optionally mass, with or without the header
    "x,y" or "x,y,mass". An npz file has `positions` (n, 2) and optionally `bonds`,
    `rest_lengths`, `triangles`, `stiffness` and `masses`, like lattice.npz of a run.
    Positions beyond `disk_points`, an elastic wall, are ignored. A user-supplied
    lattice that a run has stored (`unloaded`, see docs/output.md) is restored bit for
    bit.

    Raises InputError with the file's name if the file cannot be read or its points do
    not form a disk.
    """
    path = Path(path)
    with reading(path, "file"):
        data = read_arrays(path)
        if "unloaded" in data:
            return _restored(data)
        points = len(data["positions"])
        if (n := points_of_disk(data, points)) < points:
            data |= disk_rows(data, n)
        optional = {
            name: data.get(name)
            for name in ("rest_lengths", "triangles", "stiffness", "masses")
        }
        return replace(
            Lattice.from_points(data["positions"], data.get("bonds"), **optional),
            origin=path.name,
        )


def _restored(data: Mapping[str, Any]) -> Lattice:
    x, none = data["unloaded"], np.empty(0, np.int32)
    disk = disk_rows(data, len(x)) | {"positions": x, "origin": str(data["origin"])}
    return Lattice(
        **disk,
        disk_points=len(x),
        disk_surface=data["disk_surface"],
        wall_surface=none,
        wall_boundary=none,
    )


class OwnStart(NamedTuple):
    """User-supplied initial state of a run, which replaces the scene's random disk or
    its velocities."""

    disk: Lattice | None = None
    velocities: Array | None = None  # (N, 2) [c]

    @property
    def digest(self) -> str:
        arrays: tuple[Any, ...] = ()
        if disk := self.disk:
            arrays = (
                disk.positions,
                disk.bonds,
                disk.rest_lengths,
                disk.stiffness,
                disk.masses,
            )
        data = b"".join(
            array.tobytes() for array in (*arrays, self.velocities) if array is not None
        )
        return hashlib.sha256(data).hexdigest() if data else ""

    def repeating(self, scene: Any) -> Any:
        """Return `scene` with the keys that read this initial state from lattice.npz in
        the folder of the scene."""
        files = {"file": self.disk, "velocities": self.velocities}
        named = {
            key: "lattice.npz" for key, array in files.items() if array is not None
        }
        return replace(scene, lattice=replace(scene.lattice, **named))


def own_start(section: Any, lattice: Lattice | None, velocities: Any) -> OwnStart:
    """Return the initial state of a run. `section` names the files of a lattice or
    velocities that are None.

    If the file holds a wall as well, only the disk's velocities are used. Raises
    InputError with the file's name.
    """
    if lattice is None and section.file != "none":
        lattice = read_lattice(section.file)
    if velocities is None and section.velocities != "none":
        with reading(path := Path(section.velocities), "velocities"):
            data = read_arrays(path)
            velocities = data["velocities"]
            velocities = velocities[: points_of_disk(data, len(velocities))]
    velocities = None if velocities is None else numbers(velocities, "velocities")
    return OwnStart(None if lattice is None else disk_of(lattice), velocities)
