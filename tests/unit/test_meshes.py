"""Meshes of other programs, read by meshio."""

from __future__ import annotations

import re
import subprocess
import sys

import meshio
import numpy as np
import pytest

from taichi_disk.errors import InputError
from taichi_disk.lattice import Lattice, read_lattice
from taichi_disk.lattice.meshes import enclosing_radius

DISK = Lattice.disk(60, seed=3)
RADIUS = enclosing_radius(DISK.positions)  # 1: there are points on the rim
CENTRE = np.array([30.0, -20.0])


def solid(points):
    """Return points (n, 2) in space, in the plane z = 5."""
    return np.column_stack([points, np.full(len(points), 5.0)])


def millimetres(points):
    return solid(25.0 * points + CENTRE)


def write(path, points, *cells):
    # .msh is also a format of Ansys
    format_ = "gmsh22" if path.suffix == ".msh" else None
    meshio.write(path, meshio.Mesh(points, list(cells)), file_format=format_)
    return path


FORMATS = {
    "gmsh.msh": {"file_format": "gmsh22", "binary": False},
    "new.msh": {"file_format": "gmsh"},
    "legacy.vtk": {},
    "paraview.vtu": {},
    "disk.mesh": {},
    "abaqus.inp": {},
}


@pytest.mark.parametrize("name", FORMATS)
def test_the_triangles_of_a_mesh_become_a_disk_of_radius_1(tmp_path, name):
    path = tmp_path / name
    mesh = meshio.Mesh(millimetres(DISK.positions), [("triangle", DISK.triangles)])
    meshio.write(path, mesh, **FORMATS[name])
    disk = read_lattice(path)
    assert disk.origin == name
    assert disk.notes == (
        f"lengths of {name} were multiplied by 0.04: the smallest circle around the"
        " mesh has the radius 1 R",
    )
    expected = Lattice.from_points(DISK.positions, triangles=DISK.triangles)
    assert (disk.bonds == expected.bonds).all()
    shift = expected.positions.mean(axis=0)
    # some formats keep single precision
    assert disk.positions == pytest.approx(expected.positions - shift, abs=2e-6)
    assert disk.positions.mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)


def test_points_without_triangles_and_on_sides_are_left_out_with_a_note(tmp_path):
    start = DISK.triangles
    end = np.roll(DISK.triangles, -1, axis=1)
    on_sides = 0.5 * (DISK.positions[start] + DISK.positions[end]).reshape(-1, 2)
    number = 60 + np.arange(3 * len(start)).reshape(-1, 3)
    construction = [[0.01, 0.02]]
    points = np.concatenate([DISK.positions, on_sides, construction])
    path = write(
        tmp_path / "a.msh",
        millimetres(points),
        ("vertex", [[len(points) - 1]]),
        ("line", [[0, 1]]),
        ("triangle6", np.column_stack([start, number])),
    )
    disk = Lattice.read(path)
    assert disk.disk_points == 60
    assert len(disk.triangles) == len(start)
    assert disk.notes[0].startswith("lengths of a.msh were multiplied by 0.04")
    count = len(points) - 60
    assert disk.notes[1].startswith(
        f"{count} of {len(points)} points belong to no triangle and"
    )


@pytest.mark.parametrize(
    ("points", "cells", "message"),
    [
        (solid(DISK.positions), ("line", [[0, 1]]), "the mesh has no triangles"),
        (
            solid(DISK.positions),
            ("quad", [[0, 1, 2, 3]]),
            "the mesh has 1 cells of the kind quad: mesh the disk with triangles only",
        ),
        (
            np.column_stack([DISK.positions, DISK.positions[:, 0]]),
            ("triangle", DISK.triangles),
            "the mesh is not flat: its corners extend over 1.99333 along z",
        ),
        (
            solid(DISK.positions),
            ("triangle", np.append(DISK.triangles, DISK.triangles[4:5], axis=0)),
            f"triangle {len(DISK.triangles)}, ",
        ),
        (solid(0.0 * DISK.positions), ("triangle", DISK.triangles), "has the radius 0"),
    ],
)
def test_a_mesh_that_is_no_disk_is_refused_in_a_sentence(
    tmp_path, points, cells, message
):
    path = write(tmp_path / "a.vtu", points, cells)
    with pytest.raises(InputError) as refusal:
        read_lattice(path)
    text = str(refusal.value)
    assert text.startswith(f"lattice.file: {path}: ")
    assert message in text


@pytest.mark.parametrize(
    "name", ["a.msh", "a.vtu", "a.vtk", "a.xdmf", "a.inp", "a.stl"]
)
@pytest.mark.parametrize("content", [b"", b"nonsense\n", b"\x00\xff" * 100])
def test_a_damaged_mesh_is_refused_and_nothing_is_printed(
    tmp_path, capfd, name, content
):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"^lattice.file: {re.escape(str(path))}: "):
        read_lattice(path)
    assert capfd.readouterr() == ("", "")


def test_without_meshio_the_message_says_how_to_install_it(tmp_path, monkeypatch):
    path = write(tmp_path / "a.vtu", solid(DISK.positions), ("line", [[0, 1]]))
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(InputError, match=r"pip install '\.\[export\]'"):
        read_lattice(path)


def test_meshio_is_imported_only_for_a_mesh():
    code = (
        "import sys, taichi_disk.lattice, taichi_disk.scenes;"
        " sys.exit('meshio' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("seed", range(20))
def test_the_enclosing_circle_is_the_smallest(seed):
    rng = np.random.default_rng(seed)
    points = rng.standard_normal((rng.integers(2, 40), 2)) * [1.0, rng.uniform(0.01, 1)]
    radius = enclosing_radius(points)
    # A circle around the points has at least the radius of each pair and triple.
    circles = [0.5 * np.linalg.norm(p - q) for p in points for q in points]
    best = max(circles)
    centres = smallest_by_search(points)
    assert best <= radius * (1 + 1e-12)
    assert radius == pytest.approx(centres, rel=1e-6)


def smallest_by_search(points):
    """Return the smallest greatest distance of a centre from the points, by subgradient
    steps (Badoiu and Clarkson 2003)."""
    from scipy.optimize import minimize

    def greatest(centre):
        return np.linalg.norm(points - centre, axis=1).max()

    start = points.mean(axis=0)
    options = {"xatol": 1e-12, "fatol": 1e-14, "maxiter": 4000}
    for _ in range(4):
        found = minimize(greatest, start, method="Nelder-Mead", options=options)
        start = found.x
    return found.fun


def test_points_on_a_circle_give_its_radius_however_they_are_spaced():
    angle = np.random.default_rng(0).uniform(0, 2 * np.pi, 200)
    points = np.stack([np.cos(angle), np.sin(angle)], axis=1) * 7.0 + [3.0, -5.0]
    assert enclosing_radius(points) == pytest.approx(7.0, rel=1e-12)
