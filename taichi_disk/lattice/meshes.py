"""Read a mesh of triangles from a file of another program, by meshio."""

from __future__ import annotations

import io
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk.errors import InputError, install_extra
from taichi_disk.lattice.triangles import Array, Long

# largest difference of coordinates along an axis that is left out, over the mesh's size
_FLATNESS = 1e-9


def read_mesh(path: Path) -> tuple[Array, Long, tuple[str, ...]]:
    """Return points (n, 2) [R] and triangles (t, 3) of a mesh, scaled so that the
    smallest circle around it has the radius 1 R, with the mean of its corners at the
    origin, and what was changed, for the user.

    Corners make the triangles, also if there are points on the sides. Raises InputError
    if meshio is missing or cannot read the file, if the mesh is not flat or has cells
    of another kind.
    """
    mesh = _read(path)
    triangles = _triangles_of(mesh)
    points = np.asarray(mesh.points, np.float64)
    used = np.unique(triangles)
    size = np.ptp(points[used], axis=0)
    if (size[2:] > _FLATNESS * size.max()).any():
        raise InputError(
            f"the mesh is not flat: its corners extend over {size[2]:g} along z, which"
            " must be the same for all points"
        )
    x = points[:, :2]
    corners = x[used]
    radius = enclosing_radius(corners)
    if not 0.0 < radius < np.inf:
        raise InputError(f"the mesh has the radius {radius:g}")
    notes: tuple[str, ...] = ()
    if abs(radius - 1.0) > 1e-12:
        notes = (
            f"lengths of {path.name} were multiplied by {1.0 / radius:.6g}: the"
            " smallest circle around the mesh has the radius 1 R",
        )
    return (x - corners.mean(axis=0)) / radius, triangles, notes


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
    except (Exception, SystemExit) as error:
        reason = " ".join(printed.getvalue().split()) or repr(error)
        raise InputError(f"meshio cannot read this mesh ({reason})") from error


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
        raise InputError("the mesh has no triangles")
    return np.concatenate(triangles)


def enclosing_radius(points: Array) -> float:
    """Return the radius of the smallest circle around `points` (n, 2), by the algorithm
    of Chrystal (1885) and Peirce."""
    z = np.unique(points @ [1.0, 1.0j])
    if len(z) == 1:
        return 0.0
    # a side of the convex hull: the lowest point, and the one in the flattest direction
    a = z[np.argmin(z.imag)]
    others = z[z != a]
    b = others[np.argmin(np.angle(others - a))]
    while True:
        others = z[(z != a) & (z != b)]
        angles = np.abs(np.angle((b - others) / (a - others)))
        least = angles.min(initial=np.pi)
        if least >= np.pi / 2:
            return 0.5 * float(abs(b - a))
        # the point that sees the side from a to b under the smallest angle
        c = others[np.argmin(angles)]
        if ((c - a) / (b - a)).real < 0.0:
            a = c
        elif ((c - b) / (a - b)).real < 0.0:
            b = c
        else:
            return float(0.5 * abs(b - a) / np.sin(least))  # law of sines
