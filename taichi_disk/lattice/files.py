"""Read lattices and velocities from files, and the user-supplied initial state of a
run."""

from __future__ import annotations

import hashlib
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from taichi_disk.errors import InputError, printable
from taichi_disk.lattice.custom import numbers, point_array
from taichi_disk.lattice.lattice import Lattice, checked_disk, disk_of, disk_rows
from taichi_disk.lattice.meshes import read_mesh
from taichi_disk.lattice.tables import read_table
from taichi_disk.lattice.triangles import Array
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
_TABLES = (".csv", ".txt", ".tsv")


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
    if path.suffix.lower() in _TABLES:
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


def read_lattice(path: str | Path) -> Lattice:
    """Read the points of a disk, or a mesh, from a file and return their lattice, made
    by `Lattice.from_points`.

    A table (.csv, .txt, .tsv) has the columns x, y [R] and optionally mass, see
    `read_table`. An npz file has `positions` (n, 2) and optionally `bonds`,
    `rest_lengths`, `triangles`, `stiffness` and `masses`, like lattice.npz of a run.
    Positions beyond `disk_points`, an elastic wall, are ignored. A user-supplied
    lattice that a run has stored (`unloaded`, see docs/output.md) is restored bit for
    bit. Other files are meshes, see `read_mesh`.

    Raises InputError with the file's name if the file cannot be read or its points do
    not form a disk.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    with reading(path, "file"):
        if suffix not in _TABLES and suffix != ".npz":
            mesh = read_mesh(path)
            lattice = Lattice.from_points(mesh.points, triangles=mesh.triangles)
            notes = mesh.notes + lattice.notes
            return replace(lattice, origin=path.name, notes=notes)
        data = read_arrays(path)
        if "unloaded" in data:
            return checked_disk(_restored(data))
        points = len(np.atleast_1d(data["positions"]))
        disk_points = points_of_disk(data, points)
        if disk_points < points:
            data |= _rows_of_disk(data, disk_points)
        lattice = Lattice.from_points(
            data["positions"],
            data.get("bonds"),
            data.get("rest_lengths"),
            triangles=data.get("triangles"),
            stiffness=data.get("stiffness"),
            masses=data.get("masses"),
        )
        return replace(lattice, origin=path.name)


def _restored(data: Mapping[str, Any]) -> Lattice:
    x = point_array(data["unloaded"])
    rows = _rows_of_disk(data, len(x))
    none = np.empty(0, np.int32)
    return Lattice(
        positions=x,
        bonds=rows["bonds"],
        rest_lengths=rows["rest_lengths"],
        masses=rows["masses"],
        disk_points=len(x),
        disk_surface=data["disk_surface"],
        wall_surface=none,
        wall_boundary=none,
        triangles=rows["triangles"],
        origin=str(data["origin"]),
        stiffness=rows.get("stiffness"),
    )


def _rows_of_disk(data: Mapping[str, Any], n: int) -> dict[str, Any]:
    """Return the rows of the first `n` points for each array of a file that belongs to
    points, springs or triangles."""
    for name, width in (("bonds", 2), ("triangles", 3)):
        shape = np.shape(data.get(name, np.empty((0, width))))
        if len(shape) != 2 or shape[1] != width:
            raise InputError(f"{name} must have the shape (any, {width}), not {shape}")
    for name in ("rest_lengths", "stiffness"):
        if name in data and np.shape(data[name]) != (len(data["bonds"]),):
            shape = np.shape(data[name])
            raise InputError(
                f"{name} must have the shape ({len(data['bonds'])},), as there are"
                f" bonds, not {shape}"
            )
    return _Arrays(disk_rows(data, n))


class OwnStart(NamedTuple):
    """User-supplied initial state of a run, which replaces the scene's random disk or
    its velocities."""

    disk: Lattice | None = None
    velocities: Array | None = None  # (N, 2) [c]

    @property
    def digest(self) -> str:
        """SHA-256 of all arrays that a run reads; "" if there are none."""
        arrays = {}
        if self.disk is not None:
            arrays = {
                name: getattr(self.disk, name)
                for name in (
                    "positions",
                    "bonds",
                    "rest_lengths",
                    "masses",
                    "stiffness",
                    "triangles",
                    "disk_surface",
                )
            }
        arrays["velocities"] = self.velocities
        return digest_of(arrays)

    def repeating(self, scene: Any) -> Any:
        """Return `scene` with the keys that read this initial state from lattice.npz in
        the folder of the scene."""
        files = {}
        if self.disk is not None:
            files["file"] = "lattice.npz"
        if self.velocities is not None:
            files["velocities"] = "lattice.npz"
        return replace(scene, lattice=replace(scene.lattice, **files))


def digest_of(arrays: Mapping[str, Array | None]) -> str:
    """Return the SHA-256 of the names, forms and numbers of those arrays that are not
    None, or "" if there are none."""
    digest = hashlib.sha256()
    present = {name: array for name, array in arrays.items() if array is not None}
    for name, array in present.items():
        digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
        digest.update(array.tobytes())
    if not present:
        return ""
    return digest.hexdigest()


def own_start(section: Any, lattice: Lattice | None, velocities: Any) -> OwnStart:
    """Return the initial state of a run. `section` names the files of a lattice or
    velocities that are None.

    If the file holds a wall as well, only the disk's velocities are used. Raises
    InputError, with the name of a file, unless they form a body.
    """
    velocities = own_velocities(section, velocities)
    if lattice is not None:
        return OwnStart(checked_disk(lattice), velocities)
    if section.file != "none":
        return OwnStart(disk_of(read_lattice(section.file)), velocities)
    return OwnStart(None, velocities)


def own_velocities(section: Any, velocities: Any) -> Array | None:
    """Return `velocities`, or those in the file that `section` names, as an array; None
    if there are none."""
    if velocities is None and section.velocities != "none":
        path = Path(section.velocities)
        with reading(path, "velocities"):
            if path.suffix.lower() != ".npz":
                raise InputError("velocities are read from an .npz file")
            data = read_arrays(path)
            velocities = data["velocities"]
            velocities = velocities[: points_of_disk(data, len(velocities))]
    if velocities is None:
        return None
    return numbers(velocities, "velocities")
