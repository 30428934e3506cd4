"""Meshes of other programs, read by meshio."""

import re
import signal
import subprocess
import sys
import time
from contextlib import nullcontext
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace

import meshio
import numpy as np
import pytest

from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.lattice import Lattice, meshes

DISK = Lattice.disk(60, seed=3)


@pytest.fixture
def here(monkeypatch):
    """Read meshes in this process, because another one takes a while to start."""
    pool = nullcontext(SimpleNamespace(submit=lambda read, path: read(path)))
    monkeypatch.setattr(meshes, "Pool", lambda *_, **__: pool)
    monkeypatch.setattr(meshes, "result_of", lambda mesh, _: mesh)


def solid(points):
    """Return points (n, 2) in space, in the plane z = 5."""
    return np.column_stack([points, np.full(len(points), 5.0)])


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


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", FORMATS)
def test_the_triangles_of_a_mesh_become_a_disk(tmp_path, name):
    path = tmp_path / name
    mesh = meshio.Mesh(solid(DISK.positions), [("triangle", DISK.triangles)])
    meshio.write(path, mesh, **FORMATS[name])
    disk = Lattice.read(path)
    assert disk.origin == name
    assert disk.notes == (meshes.EQUAL_MASSES,)
    assert (disk.triangles == DISK.triangles).all()
    # some formats keep single precision
    assert disk.positions == pytest.approx(DISK.positions, abs=1e-7)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("axes", "note"), [((0, 1), ()), ((0, 2), ("x and z",)), ((1, 2), ("y and z",))]
)
def test_a_mesh_is_flat_in_any_plane_of_axes_in_single_precision(tmp_path, axes, note):
    points = np.zeros((60, 3))
    points[:, axes] = DISK.positions
    noise = 3.5e-8 * np.random.default_rng(0).standard_normal((60, 3))
    path = write(tmp_path / "a.vtu", points + noise, ("triangle", DISK.triangles))
    disk = Lattice.read(path)
    assert disk.positions == pytest.approx(DISK.positions, abs=1e-6)
    assert disk.notes[:-1] == tuple(f"a.vtu lies in the plane of {one}" for one in note)


@pytest.mark.usefixtures("here")
@pytest.mark.skipif(find_spec("h5py") is not None, reason="h5py is installed")
def test_a_package_that_a_format_needs_is_named(tmp_path):
    path = tmp_path / "a.med"
    path.write_bytes(b"-")
    with pytest.raises(InputError, match=r"\(it needs h5py: .* install .*'h5py'\): "):
        Lattice.read(path)


def test_points_without_triangles_and_on_sides_are_left_out_with_a_note(tmp_path):
    start = DISK.triangles
    end = np.roll(DISK.triangles, -1, axis=1)
    on_sides = 0.5 * (DISK.positions[start] + DISK.positions[end]).reshape(-1, 2)
    number = 60 + np.arange(3 * len(start)).reshape(-1, 3)
    construction = [[0.01, 0.02]]
    points = np.concatenate([DISK.positions, on_sides, construction])
    cells = ("triangle6", np.column_stack([start, number]))
    others = ("vertex", [[len(points) - 1]]), ("line", [[0, 1]])
    disk = Lattice.read(write(tmp_path / "a.msh", solid(points), *others, cells))
    assert (disk.disk_points, len(disk.triangles)) == (60, len(start))
    assert disk.notes[1].startswith(f"{len(points) - 60} of {len(points)} points are")
    assert disk.notes[1].endswith("; points after it have smaller numbers here")


FLAT = solid(DISK.positions)
TWICE = np.append(DISK.triangles, DISK.triangles[4:5], axis=0)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("points", "cells", "message"),
    [
        (FLAT, ("line", [[0, 1]]), "the mesh has no triangles"),
        (
            FLAT,
            ("quad", [[0, 1, 2, 3]]),
            "the mesh has 1 cells of the kind quad: mesh the disk with triangles only",
        ),
        (
            np.column_stack([DISK.positions, DISK.positions[:, 0]]),
            ("triangle", DISK.triangles),
            "the mesh is not flat: its corners extend over 1.99333 x 1.99479 x",
        ),
        (FLAT, ("triangle", TWICE), f"triangle {len(DISK.triangles)}, "),
        (solid(0.0 * DISK.positions), ("triangle", DISK.triangles), "is flat"),
        # lengths are radii
        (25.0 * FLAT, ("triangle", DISK.triangles), "in units of the disk's radius R"),
    ],
)
def test_a_mesh_that_is_no_disk_is_refused_in_words(tmp_path, points, cells, message):
    path = write(tmp_path / "a.vtu", points, cells)
    text = re.escape(f"lattice.file: {path}: ") + ".*" + re.escape(message)
    with pytest.raises(InputError, match=f"^{text}"):
        Lattice.read(path)


CURVE = """$MeshFormat
2.2 0 8
$EndMeshFormat
$PhysicalNames
1
1 7 "rim"
$EndPhysicalNames
$Nodes
2
1 0 0 0
{last} 1 0 0
$EndNodes
$Elements
1
1 1 2 7 1 1 {last}
$EndElements
"""


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.msh", CURVE.format(last=2), r"\(physical groups: rim\); if there"),
        ("a.inp", "*NODE\n1,0,0\n*Include,INPUT=a.inp\n", "it includes another file"),
        ("a.dat", "0 1\n", r"it is no .dat file\): write its points as a table"),
        ("a.xyz", "0\n", r"write its points as a table \(.csv\)"),
    ],
)
def test_a_file_that_meshio_cannot_read_gets_advice(tmp_path, name, content, message):
    (tmp_path / name).write_text(content)
    with pytest.raises(InputError, match=message):
        Lattice.read(tmp_path / name)


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize("name", ["a.msh", "a.vtu", "a.inp", "a.dat"])
@pytest.mark.parametrize("content", [b"", b"nonsense\n", b"\x00\xff" * 100])
def test_a_damaged_mesh_is_refused_and_nothing_printed(tmp_path, capfd, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(InputError, match=f"^lattice.file: {re.escape(str(path))}: "):
        Lattice.read(path)
    assert capfd.readouterr() == ("", "")


def test_a_mesh_that_fills_the_memory_is_refused(tmp_path):
    # meshio makes a table of all numbers up to the largest
    (tmp_path / "a.msh").write_text(CURVE.format(last=2 * 10**9))
    with pytest.raises(InputError, match=r"cannot read .*\(Unable to allocate"):
        Lattice.read(tmp_path / "a.msh")


def test_without_meshio_the_message_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "meshio", None)
    with pytest.raises(InputError, match=r"pip install .*'meshio'"):
        meshes._read(tmp_path / "a.vtu")


ENDLESS = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\n"


def test_a_mesh_whose_reading_never_ends_is_refused_in_time(tmp_path, monkeypatch):
    (tmp_path / "a.ply").write_text(ENDLESS)
    monkeypatch.setattr(meshes, "TIME", 0.5)
    with pytest.raises(InputError, match=r"cannot read this file \(it takes too long"):
        Lattice.read(tmp_path / "a.ply")


def test_one_signal_ends_the_reading_of_a_mesh_that_never_ends(tmp_path):
    (tmp_path / "a.ply").write_text(ENDLESS)
    words = ["-m", "taichi_disk", "check", "compression", "--set=lattice.file=a.ply"]
    process = subprocess.Popen([sys.executable, *words], cwd=tmp_path)
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    for _ in range(500):  # until the process that reads has begun
        if children.read_text():
            break
        time.sleep(0.02)
    process.send_signal(signal.SIGTERM)
    assert process.wait(10.0) == 130


@pytest.mark.validate
@pytest.mark.parametrize("suffix", [*meshio.extension_to_filetypes, ".npz", ".csv"])
def test_a_cut_file_of_any_kind_is_read_whole_or_refused(tmp_path, monkeypatch, suffix):
    path = tmp_path / f"a{suffix}"
    if suffix == ".npz":
        np.savez(path, positions=DISK.positions)
    elif suffix == ".csv":
        np.savetxt(path, DISK.positions, delimiter=",", header="x,y", comments="")
    else:
        try:
            meshio.write(path, meshio.Mesh(FLAT, [("triangle", DISK.triangles)]))
        except BaseException as error:
            pytest.skip(f"meshio does not write it: {error}")
    content = path.read_bytes()
    monkeypatch.setattr(meshes, "TIME", 5.0)
    for part in (0.02, 0.3, 0.7):
        path.write_bytes(content[: int(part * len(content))])
        with pytest.raises(InputError, match=r"^lattice\.file: "):
            Lattice.read(path)
