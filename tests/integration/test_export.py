"""Trajectories, as other libraries read them, contain the model's quantities."""

import tracemalloc
import xml.etree.ElementTree as ElementTree
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import non_uniform

from taichi_disk import load_scene
from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.mechanics.fields import Triangles, point_stress
from taichi_disk.mechanics.lattice import Lattice, with_wall
from taichi_disk.mechanics.physics import ElasticWall, Model, Springs
from taichi_disk.runs.output import export
from taichi_disk.runs.output.export import check_export, export_run

TIMES = np.array([0.0, 0.5, 1.0])
SINGLE = {"rtol": 1e-6, "atol": 1e-7}
# A small non-uniform disk that sinks onto an elastic wall and is squeezed.
LATTICE = non_uniform(with_wall(Lattice.disk(40, seed=1), 60, 3.0, seed=1))
MODEL = Model(Springs(1.3, 0.2, 0.5), ElasticWall(300.0, 150.0, 0.1))
SCENE = load_scene("absorbing_wall", ["lattice.points=40", "lattice.seed=1"])
SCENARIO = SimpleNamespace(stored_scene=SCENE, lattice=LATTICE, model=MODEL)


def state(t):
    x = LATTICE.positions.copy()
    n = LATTICE.disk_points
    x[:n, 1] += x[LATTICE.wall_surface, 1].max() + 0.05 - 0.03 * t - x[:n, 1].min()
    x[:n] *= [1.0 + 0.01 * t, 1.0]
    x += 1e-4 * np.random.default_rng(0).standard_normal(x.shape)
    v = np.zeros_like(x)
    v[:n] = [0.01, -0.03]
    return x, v


def truth(t):
    """Return the springs' and the contact's quantities by plain formulae."""
    x, _ = state(t)
    i, j = LATTICE.bonds.T
    stretch = np.linalg.norm(x[i] - x[j], axis=1) - LATTICE.rest_lengths
    contact = MODEL.wall.forces(LATTICE, x)
    contact[LATTICE.disk_points :] = 0.0
    energy = LATTICE.stiffness * (0.5 * 1.3 * stretch**2 + 0.25 * 0.2 * stretch**4)
    tension = LATTICE.stiffness * (1.3 * stretch + 0.2 * stretch**3)
    return {
        "strain": stretch / LATTICE.rest_lengths,
        "tension": tension,
        "energy": energy,
        "contact_force": contact,
    }


# The balls that particle programs draw leave half of a typical spring visible.
BALL = 0.25 * np.median(LATTICE.rest_lengths)


def close(found, expected):
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-14)


def tensor(x):
    """Return the stress at the points as XX, YY, ZZ, XY, XZ, YZ."""
    xx, yy, xy = point_stress(Triangles(LATTICE), MODEL.springs, x).T
    return np.stack([xx, yy, 0.0 * xx, xy, 0.0 * xx, 0.0 * xx], axis=1)


def exported(folder, format):
    return export_run(SCENARIO, ((t, *state(t)) for t in TIMES), folder, format)


def test_npz_holds_every_quantity_at_every_time(tmp_path):
    file = np.load(exported(tmp_path, "npz"))
    np.testing.assert_array_equal(file["t"], TIMES)
    for k, t in enumerate(TIMES):
        x, v = state(t)
        true = truth(t)
        np.testing.assert_array_equal(file["positions"][k], x)
        np.testing.assert_array_equal(file["velocities"][k], v)
        for name in ("strain", "tension", "energy"):
            close(file[f"springs_{name}"][k], true[name])
        close(file["points_contact_force"][k], true["contact_force"])
        close(file["elastic_energy"][k], true["energy"].sum())
        kinetic = 0.5 * (0.01**2 + 0.03**2)
        assert file["kinetic_energy"][k] == pytest.approx(kinetic, rel=1e-12)
        close(file["wall_energy"][k], MODEL.wall.energy(LATTICE, x))
    assert file["points_contact_force"][-1].any()
    for name in ("bonds", "triangles", "rest_lengths", "masses", "disk_points"):
        np.testing.assert_array_equal(file[name], getattr(LATTICE, name))
    np.testing.assert_array_equal(file["stiffness"], LATTICE.stiffness)
    assert [path.name for path in tmp_path.iterdir()] == ["trajectory.npz"]


@pytest.mark.validate
def test_npz_has_one_array_at_a_time_in_memory_however_many_frames(tmp_path):
    def peak(frames):
        states = ((t, *state(t)) for t in np.linspace(0.0, 1.0, frames))
        tracemalloc.start()
        export_run(SCENARIO, states, tmp_path, "npz")
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found

    peak(5)
    # although the file has 3 MB more; NumPy takes 16 MiB of an array at most
    assert peak(200) < peak(20) + 1_000_000


def test_vtu_read_by_meshio_and_vtk(tmp_path):
    meshio = pytest.importorskip("meshio")
    file = ElementTree.parse(exported(tmp_path / "R&D.pvd", "vtu"))
    listed = list(file.iter("DataSet"))
    times = [float(entry.get("timestep", "")) for entry in listed]
    assert times == TIMES.repeat(2).tolist()
    springs, triangles = (tmp_path / entry.get("file", "") for entry in listed[-2:])
    x, v = state(1.0)
    true = truth(1.0)
    mesh = meshio.read(springs)
    np.testing.assert_array_equal(mesh.points[:, :2], x)
    np.testing.assert_array_equal(mesh.point_data["velocity"][:, :2], v)
    close(mesh.point_data["contact_force"][:, :2], true["contact_force"])
    np.testing.assert_array_equal(mesh.cells_dict["line"], LATTICE.bonds)
    close(mesh.cell_data["strain"][0], true["strain"])
    close(mesh.point_data["stress"], tensor(x))
    cells = meshio.read(triangles).cells_dict["triangle"]
    np.testing.assert_array_equal(cells, LATTICE.triangles)

    vtk = pytest.importorskip("vtkmodules.vtkIOXML")
    from vtkmodules.util.numpy_support import vtk_to_numpy

    reader = vtk.vtkXMLUnstructuredGridReader()
    reader.SetFileName(str(triangles))
    reader.Update()
    cells = reader.GetOutput().GetCellData()
    stress = vtk_to_numpy(cells.GetArray("stress"))
    pressure = vtk_to_numpy(cells.GetArray("pressure"))
    assert stress.shape == (len(LATTICE.triangles), 6)
    close(pressure, -0.5 * stress[:, :2].sum(axis=1))


@pytest.mark.validate
def test_xyz_read_by_ovito(tmp_path):
    from ovito.io import import_file

    pipeline = import_file(str(exported(tmp_path, "xyz")))
    assert pipeline.source.num_frames == len(TIMES)
    x, v = state(1.0)
    true = truth(1.0)
    data = pipeline.compute(len(TIMES) - 1)
    # The properties that OVITO recognises, and our own.
    named = {"Particle Type", "Position", "Velocity", "Velocity Magnitude", "Mass"}
    ours = {"contact_force", "pressure", "masses", "momenta"}
    springs = {f"springs_{name}" for name in ("strain", "tension", "energy")}
    known = named | ours | springs | {"Radius", "Stress Tensor"}
    assert set(data.particles.keys()) == known
    stress = data.particles["Stress Tensor"]
    np.testing.assert_allclose(stress, tensor(x), rtol=1e-9, atol=1e-12)
    assert stress.component_names == ("XX", "YY", "ZZ", "XY", "XZ", "YZ")
    types = data.particles.particle_types
    np.testing.assert_array_equal(types != types[0], np.arange(len(x)) >= 40)
    np.testing.assert_allclose(data.particles["Mass"], LATTICE.masses, **SINGLE)
    np.testing.assert_allclose(data.particles.positions[:, :2], x, **SINGLE)
    np.testing.assert_allclose(data.particles["Velocity"][:, :2], v, **SINGLE)
    contact = data.particles["contact_force"][:, :2]
    np.testing.assert_allclose(contact, true["contact_force"], rtol=1e-6, atol=1e-12)
    close(data.attributes["elastic_energy"], true["energy"].sum())


def test_xyz_is_lines_that_can_be_read_without_a_library(tmp_path):
    lines = exported(tmp_path, "xyz").read_text().splitlines()
    n = len(LATTICE.positions)
    assert len(lines) == len(TIMES) * (n + 2)
    assert lines[0] == str(n)
    species = [line.split()[0] for line in lines[2 : n + 2]]
    assert species == ["X"] * 40 + ["Si"] * (n - 40)
    side = 2.0 * np.abs(state(0.0)[0]).max()
    box = f'Lattice="{side:.12g} 0 0 0 {side:.12g} 0 0 0 1" '
    corner = f"{-side / 2.0:.12g}"
    assert lines[1].startswith(f'{box}Origin="{corner} {corner} -0.5" Program=')
    assert lines[1].endswith(' pbc="F F F"')
    assert " Time=1 kinetic_energy=" in lines[-n - 1]
    header = lines[1].partition("Properties=")[2].split()[0].split(":")
    assert header[:6] == ["species", "S", "1", "pos", "R", "3"]
    names = header[3::3]
    widths = [int(width) for width in header[5::3]]
    # Species are elements, and OVITO or ASE misinterpret no column because of its name.
    assert names[:6] == ["pos", "velo", "mass", "radius", "masses", "momenta"]
    assert names[6:9] == ["contact_force", "Stress", "pressure"]
    assert names[9:] == ["springs_strain", "springs_tension", "springs_energy"]
    rows = np.array([line.split()[1:] for line in lines[-n:]], dtype=float)
    last = dict(zip(names, np.split(rows, np.cumsum(widths)[:-1], axis=1), strict=True))
    x, v = state(1.0)
    true = truth(1.0)
    for name, expected in (
        ("pos", np.pad(x, ((0, 0), (0, 1)))),
        ("velo", np.pad(v, ((0, 0), (0, 1)))),
        ("mass", LATTICE.masses[:, None]),
        ("masses", LATTICE.masses[:, None]),
        ("momenta", LATTICE.masses[:, None] * np.pad(v, ((0, 0), (0, 1)))),
        ("pressure", -0.5 * tensor(x)[:, :2].sum(axis=1, keepdims=True)),
        ("radius", np.full((n, 1), BALL)),
        ("contact_force", np.pad(true["contact_force"], ((0, 0), (0, 1)))),
        ("Stress", tensor(x)),
    ):
        np.testing.assert_allclose(last[name], expected, rtol=1e-10, atol=1e-12)
    assert last["masses"][:40].sum() == pytest.approx(1.0, rel=1e-9)  # M
    assert last["springs_energy"].sum() == pytest.approx(true["energy"].sum(), rel=1e-6)
    at = (LATTICE.bonds == 7).any(axis=1)
    for name in ("strain", "tension"):
        close(last[f"springs_{name}"][7, 0], true[name][at].mean())


def test_what_cannot_be_exported_is_refused_before_a_run(tmp_path, monkeypatch):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.tex").touch()
    for name, format, message in (
        ("a.lammps", None, r"formats are xyz \(\.xyz\), vtu"),
        ("a.xyz", "vtu", r"a\.xyz as vtu: the formats are"),
        ("mine.pvd", None, "is not a writable folder with only numbered pictures"),
        ("lattice.npz", None, "final.npz are taken by runs"),
        ("final.npz", "npz", "final.npz are taken by runs"),
    ):
        with pytest.raises(InputError, match=message):
            check_export(tmp_path / name, format)
    monkeypatch.setattr(export, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"needs the package meshio: .*'meshio'"):
        check_export(tmp_path, "vtu")
    assert check_export(tmp_path, "xyz")[0] == tmp_path / "trajectory.xyz"


@pytest.mark.parametrize("format", sorted(export.FORMATS))
def test_an_export_replaces_an_earlier_one_and_leaves_nothing_half(tmp_path, format):
    def contents():
        return {path: path.is_file() and path.read_bytes() for path in everything()}

    def everything():
        return sorted(tmp_path.rglob("*"))

    def broken():
        yield 0.0, *state(0.0)
        raise SimulationError("the sun went out")

    exported(tmp_path, format)
    before = everything()
    exported(tmp_path, format)
    assert everything() == before
    content = contents()
    with pytest.raises(SimulationError, match="sun"):
        export_run(SCENARIO, broken(), tmp_path, format)
    assert contents() == content
