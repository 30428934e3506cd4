"""Read a mesh of triangles from a file of another program, by meshio."""

from __future__ import annotations

import io
import re
from concurrent.futures import BrokenExecutor
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from taichi_disk.base.errors import InputError, pip_install, printable, reason
from taichi_disk.base.processes.pool import Pool, result_of
from taichi_disk.mechanics.lattice.triangles import Array, Long

# largest extent out of the plane over the mesh's size; in single precision 1e-7 is lost
_FLATNESS = 1e-6
# limits of reading: time [s] and memory [MB], and what each MB of the file adds. The
# process itself takes 600 MB.
TIME = 30.0
MEMORY = 4000.0
MEMORY_FACTOR = 20.0
EQUAL_MASSES = (
    "all points have the same mass, so a part that is meshed more finely is heavier"
)
Mesh: TypeAlias = tuple[Array, Long, tuple[str, ...]]


def read_mesh(path: Path) -> Mesh:
    """Return points (n, 2) [R] and triangles (t, 3) of a mesh in a plane of two axes,
    and a note on the plane unless it is that of x and y.

    Corners make the triangles, also if there are points on the sides. Raises InputError
    if meshio is missing or cannot read the file, if the mesh is not flat or has cells
    of another kind.
    """
    # meshio has endless loops for some damaged files, which no signal ends, and may
    # fill the memory: another process reads.
    megabytes = path.stat().st_size / 1e6
    with Pool(1, memory=int(1e6 * (MEMORY + MEMORY_FACTOR * megabytes))) as pool:
        try:
            return result_of(pool.submit(_mesh_of, path), TIME + megabytes)
        except TimeoutError:
            raise _unreadable("it takes too long") from None
        except BrokenExecutor as error:
            raise _unreadable(f"it ends with {error}") from None


def _mesh_of(path: Path) -> Mesh:
    mesh = _read(path)
    triangles = _triangles_of(mesh)
    points = np.asarray(mesh.points, np.float64)
    size = np.ptp(points[np.unique(triangles)], axis=0)
    axes = np.sort(np.argsort(-size, kind="stable")[:2])
    if (np.delete(size, axes) > _FLATNESS * size.max()).any():
        sizes = " x ".join(f"{one:g}" for one in size)
        raise InputError(f"the mesh is not flat: its corners extend over {sizes}")
    notes: tuple[str, ...] = (EQUAL_MASSES,)
    if axes.tolist() != [0, 1]:
        names = " and ".join("xyz"[axis] for axis in axes)
        notes = (f"{path.name} lies in the plane of {names}", *notes)
    return points[:, axes], triangles, notes


def _read(path: Path) -> Any:
    try:
        import meshio
    except ImportError:
        raise InputError(
            "a lattice is read from a .csv, .txt, .tsv or .npz file; for meshes meshio"
            f" is needed: {pip_install('meshio')}"
        ) from None
    if re.search(rb"^\*INCLUDE", path.read_bytes(), re.M | re.I):
        raise InputError("it includes another file: write both into one (*INCLUDE)")
    # meshio prints why it cannot read a file, and then ends the process.
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            return meshio.read(path)
    except ModuleNotFoundError as error:
        fault = reason(error)
    except (Exception, SystemExit) as error:
        words = " ".join(printed.getvalue().split()) or str(error)
        fault = printable(words, width=200) or f"it is no {path.suffix} file"
    raise _unreadable(fault)


def _unreadable(fault: str) -> InputError:
    return InputError(
        f"meshio cannot read this file ({fault}): write its points as a table (.csv)"
        " with the columns x and y, name a drawing (.svg) as lattice.outline, or give"
        " points and triangles to Lattice.from_points"
    )


def _triangles_of(mesh: Any) -> Long:
    """Return the corners (t, 3) of all triangles."""
    triangles = []
    for block in mesh.cells:
        kind = block.type.removeprefix("VTK_LAGRANGE_").lower()
        if kind.startswith("triangle"):
            triangles.append(np.asarray(block.data)[:, :3].astype(np.int64))
        elif block.dim > 1:
            raise InputError(
                f"the mesh has {len(block.data)} cells of the kind {block.type}: mesh"
                " the disk with triangles only"
            )
    if not triangles:
        groups = ", ".join(mesh.field_data) or "none"
        raise InputError(
            f"the mesh has no triangles (physical groups: {groups}); if there are"
            " groups, gmsh leaves out what is in none: add a Physical Surface"
        )
    return np.concatenate(triangles)
