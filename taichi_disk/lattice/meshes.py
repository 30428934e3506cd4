"""Read a mesh of triangles from a file of another program, by meshio."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from taichi_disk.errors import InputError, install_extra, pip_install
from taichi_disk.lattice.triangles import Array, Long

# largest difference of coordinates along an axis that is left out, over the mesh's size
_FLATNESS = 1e-9


class Mesh(NamedTuple):
    """Points of a mesh, scaled to a disk, and its triangles."""

    points: Array  # (n, 2) [R]; some may belong to no triangle
    triangles: Long  # (t, 3) rows of `points`
    notes: tuple[str, ...]  # what was changed, for the user


def read_mesh(path: Path) -> Mesh:
    """Read the triangles of a mesh, scaled so that the smallest circle around it has
    the radius 1 R, with the mean of its points at the origin.

    Corners make the triangles, also if there are points on the sides. Raises InputError
    if meshio is missing or cannot read the file, if the mesh is not flat or has cells
    of another kind.
    """
    mesh = _read(path)
    triangles = _triangles_of(mesh)
    if len(triangles) == 0:
        raise InputError("the mesh has no triangles")
    points = np.asarray(mesh.points, np.float64)
    corners = np.unique(triangles)
    _check_flat(points[corners])
    x = points[:, :2]
    radius = enclosing_radius(x[corners])
    if not 0.0 < radius < np.inf:
        raise InputError(f"the mesh has the radius {radius:g}")
    notes: tuple[str, ...] = ()
    if abs(radius - 1.0) > 1e-12:
        notes = (
            f"lengths of {path.name} were multiplied by {1.0 / radius:.6g}: the"
            " smallest circle around the mesh has the radius 1 R",
        )
    return Mesh((x - x[corners].mean(axis=0)) / radius, triangles, notes)


def _read(path: Path) -> Any:
    try:
        import meshio
    except ImportError:
        raise InputError(
            "a lattice is read from a .csv or .npz file; for meshes meshio is needed:"
            f" {install_extra('export')}"
        ) from None
    if path.suffix.lower() not in meshio.extension_to_filetypes:
        known = " ".join(sorted(meshio.extension_to_filetypes))
        raise InputError(
            "a lattice is read from a .csv, .txt, .tsv or .npz file, or from a mesh:"
            f" {known}"
        )
    # meshio prints why it cannot read a file, and then ends the process.
    printed = io.StringIO()
    try:
        with redirect_stdout(printed), redirect_stderr(printed):
            return meshio.read(path)
    except ModuleNotFoundError as error:  # such as h5py for XDMF
        raise InputError(
            f"meshio needs {error.name} for this mesh: {pip_install(str(error.name))}"
        ) from None
    except (Exception, SystemExit) as error:
        reason = " ".join(printed.getvalue().split()) or repr(error)
        raise InputError(f"meshio cannot read this mesh ({reason})") from error


def _triangles_of(mesh: Any) -> Long:
    """Return the corners (t, 3) of all triangles."""
    triangles = [np.empty((0, 3), np.int64)]
    for block in mesh.cells:
        kind = block.type.removeprefix("VTK_LAGRANGE_").lower()
        if kind.startswith("triangle"):
            triangles.append(np.asarray(block.data)[:, :3].astype(np.int64))
        elif block.dim > 1:
            raise InputError(
                f"the mesh has {len(block.data)} cells of the kind {block.type}: mesh"
                " the disk with triangles only"
            )
    return np.concatenate(triangles)


def _check_flat(points: Array) -> None:
    size = np.ptp(points, axis=0)
    if points.shape[1] > 2 and size[2] > _FLATNESS * size.max():
        z = points[:, 2]
        raise InputError(
            f"the mesh is not flat: z runs from {z.min():g} to {z.max():g}, and must be"
            " the same for all points"
        )


def enclosing_radius(points: Array) -> float:
    """Return the radius of the smallest circle around `points` (n, 2), by the algorithm
    of Chrystal (1885) and Peirce."""
    # Two points of the convex hull: the lowest, and the one in the flattest direction.
    a = points[np.argmin(points[:, 1])]
    away = points - a
    distance = np.sqrt((away**2).sum(axis=1))
    with np.errstate(invalid="ignore"):
        steepness = np.where(distance > 0.0, away[:, 1] / distance, np.inf)
    b = points[np.argmin(steepness)]
    while True:
        # the point that sees the side from a to b under the smallest angle
        to_a = a - points
        to_b = b - points
        dot = (to_a * to_b).sum(axis=1)
        cross = np.abs(to_a[:, 0] * to_b[:, 1] - to_a[:, 1] * to_b[:, 0])
        c = points[np.argmax(np.arctan2(dot, cross))]
        if dot.max() <= 0.0:
            return 0.5 * float(np.linalg.norm(a - b))
        if (b - a) @ (c - a) < 0.0:
            a = c
        elif (a - b) @ (c - b) < 0.0:
            b = c
        else:
            return _circumradius(a, b, c)


def _circumradius(a: Array, b: Array, c: Array) -> float:
    ab = b - a
    ac = c - a
    double_area = abs(ab[0] * ac[1] - ab[1] * ac[0])
    sides = np.linalg.norm(ab) * np.linalg.norm(ac) * np.linalg.norm(b - c)
    return float(sides / (2.0 * double_area))
