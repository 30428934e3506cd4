"""Lattices that a run stored: what the file holds is checked as what a user gives."""

import re
from dataclasses import replace

import numpy as np
import pytest
from bodies import ELASTIC, changed, disk_and_wall

from taichi_disk.base import runtime
from taichi_disk.base.errors import InputError
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.integrators import INTEGRATORS
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.lattice.own_start import OwnStart, own_start
from taichi_disk.mechanics.physics import Model, Springs
from taichi_disk.mechanics.simulation.simulation import Simulation

DISK = Lattice.disk(60, seed=3, core_radius=0.5, core_density=2.0, core_stiffness=2.0)
ARRAYS = ("positions", "bonds", "rest_lengths", "masses", "stiffness", "triangles")
STORED = {name: getattr(DISK, name) for name in (*ARRAYS, "disk_surface")}


def store(path, **changes):
    arrays = {**STORED, "unloaded": DISK.positions, "origin": "mine", **changes}
    present = {name: array for name, array in arrays.items() if array is not None}
    np.savez(path, **present)
    return path


INNER = int(np.setdiff1d(np.arange(60), DISK.disk_surface)[0])
OUTLINE = DISK.disk_surface


@pytest.mark.parametrize(
    "outline",
    [None, OUTLINE, np.tile(OUTLINE, 1000), OUTLINE[::-1], changed(OUTLINE, 2, INNER)],
    ids=["none", "own", "repeated", "reversed", "spoilt"],
)
def test_a_stored_lattice_is_restored_bit_for_bit_with_its_triangles_outline(
    tmp_path, outline
):
    disk = Lattice.read(store(tmp_path / "a.npz", disk_surface=outline))
    assert disk.origin == "mine"
    assert disk.notes == ()
    for name, array in STORED.items():
        assert getattr(disk, name).tobytes() == array.tobytes()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"unloaded": DISK.positions * 1e-6}, "the points extend over"),
        ({"unloaded": DISK.positions + [50.0, 0.0]}, "mean lies at x = 5"),
        ({"bonds": DISK.bonds.ravel()}, "springs must be whole numbers of shape (any,"),
        ({"stiffness": 1e20 * DISK.stiffness}, "stiffness[0]"),
        ({"masses": changed(DISK.masses, 5, 1e-300)}, "masses[5] is 1e-300"),
        ({"triangles": DISK.triangles[:7]}, "is no corner of a triangle"),
    ],
)
def test_a_stored_lattice_is_checked_as_what_a_user_gives(tmp_path, changes, message):
    path = store(tmp_path / "a.npz", **changes)
    text = re.escape(f"lattice.file: {path}: ") + ".*" + re.escape(message)
    with pytest.raises(InputError, match=f"^{text}"):
        Lattice.read(path)


def test_velocities_are_an_array_of_a_file_of_arrays(tmp_path):
    (tmp_path / "a.csv").write_text("0,-0.1\n")
    np.savez(tmp_path / "a.npz", u=np.zeros((60, 2)), x=DISK.positions)
    for name, message in (
        ("a.csv", "velocities are read from an .npz file"),
        ("a.npz", "has no array velocities, only u, x"),
    ):
        settings = ["lattice.points=60", f"lattice.velocities={tmp_path / name}"]
        with pytest.raises(InputError, match=message):
            load_scene("exponential_wall", settings).scenario()


@pytest.mark.parametrize("points", [3, 5, 20])
def test_any_random_disk_may_be_given_as_a_lattice(points):
    section = load_scene("exponential_wall").lattice
    for seed in range(20):
        disk = Lattice.disk(points, seed, rim=False, min_spacing=0.0)
        if max(np.ptp(disk.positions, axis=0)) > 1.0:
            assert own_start(section, disk, None).digest == OwnStart(disk).digest


def test_the_digest_covers_every_array_that_is_read():
    digests = {OwnStart(DISK).digest, OwnStart(DISK, np.zeros((60, 2))).digest}
    others = {
        "positions": 2.0 * DISK.positions,
        "bonds": changed(DISK.bonds, -2, [57, 58]),
        "rest_lengths": 2.0 * DISK.rest_lengths,
        "masses": DISK.masses[::-1],
        "stiffness": 2.0 * DISK.stiffness,
        "triangles": np.roll(DISK.triangles, 1, axis=1),
        "disk_surface": np.roll(DISK.disk_surface, 1),
    }
    for name, array in others.items():
        digests.add(OwnStart(replace(DISK, **{name: array})).digest)
    assert len(digests) == 2 + len(others)
    assert OwnStart().digest == ""


def test_fields_are_never_written_beyond_their_ends():
    lattice = disk_and_wall()
    outline = np.tile(lattice.disk_surface, 1000)
    lattice = replace(lattice, disk_surface=outline)
    at_rest = np.zeros_like(lattice.positions)
    model = Model(Springs(1.0, 1.0, 0.1), ELASTIC)
    runtime.start()
    with pytest.raises(ValueError, match="values do not fit into"):
        Simulation(lattice, model, INTEGRATORS["trapezoidal"], at_rest, 0.01)
