"""Large lattices, stepped chunk by chunk on several cores: the same forces, motion and energies, the same bytes."""

from __future__ import annotations

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from reference import Model
from worlds import disk, disk_and_wall, matched, moving_down

from taichi_disk.model import chebyshev, ordering
from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Physics

RIGID = Physics(k_b=2.0, eta=0.02, wall="rigid", load=0.02)


@pytest.fixture
def large(monkeypatch):
    """Small lattices are cut as large ones are."""
    monkeypatch.setattr(ordering, "PARALLEL_FROM", 1)


def world_of(lattice, physics, velocities, dt=2e-3, **own):
    from taichi_disk.model.world import World

    return World(lattice, physics, velocities, dt, **own)


def test_chunks_share_no_point_and_hold_every_spring_once(large):
    bonds = disk(900).bonds
    one = ordering.arrange(bonds, 900, 1)
    assert one.chunks >= 4
    used = one.source[one.source >= 0]
    np.testing.assert_array_equal(np.sort(used), np.arange(len(bonds)))
    np.testing.assert_array_equal(one.ends[one.source >= 0], bonds[used])
    owned, begin = [], 0
    for c, end in enumerate(one.chunk_ends):
        inside = one.ends[begin * one.block : end * one.block]
        points = inside[inside < 900]
        assert points.min() >= c * one.chunk_points
        assert points.max() < (c + 1) * one.chunk_points
        owned.append(set(inside.ravel().tolist()))
        begin = int(end)
    assert sum(len(points) for points in owned) == len(set().union(*owned))


def test_small_lattices_and_lanes_are_not_cut():
    bonds = disk(900).bonds
    assert ordering.arrange(bonds, 900, 1).chunks == 1
    assert ordering.arrange(bonds, ordering.PARALLEL_FROM, 1).chunks > 1
    assert ordering.arrange(bonds, ordering.PARALLEL_FROM, 8).chunks == 1


def bodies(name: str):
    """Lattice, physics and velocities of a disk in contact that is stretched by some per cent."""
    if name.startswith("rigid"):
        lattice, physics = disk(900, height=0.02), RIGID
        if "fourth order" in name:
            physics = replace(physics, eta=0.0, integrator="vefrl")
        if "trapezoidal" in name:
            physics = replace(physics, integrator="trapezoidal")
    else:
        lattice = disk_and_wall(500, 500, height=0.03)
        physics = Physics(k_b=2.0, wall="elastic", eta=0.02)
        physics = matched(lattice, physics)
        if "reset" in name:
            physics = replace(physics, boundary="reset", reset_interval=1e-2)
        if "trapezoidal" in name:
            physics = replace(physics, integrator="trapezoidal")
    v = moving_down(lattice, 0.05) + 0.01 * np.random.default_rng(0).standard_normal((1, *lattice.positions.shape))
    return lattice, physics, v


CASES = [
    "rigid wall",
    *(
        pytest.param(name, marks=pytest.mark.validate)
        for name in (
            "rigid wall, fourth order",
            "rigid wall, f32",
            "rigid wall, trapezoidal",
            "rigid wall, trapezoidal, f32",
            "elastic wall, reset, trapezoidal",
            "elastic wall, matched, trapezoidal",
            "elastic wall, reset",
            "elastic wall, matched",
            "elastic wall, f32",
        )
    ),
]


@pytest.mark.parametrize("name", CASES)
def test_chunks_move_as_one_core_without_chunks_does(name, monkeypatch):
    from taichi_disk.model import runtime

    single = "f32" in name
    runtime.start("cpu", precision="f32" if single else "f64")
    lattice, physics, v = bodies(name)
    rng = np.random.default_rng(1)
    x = lattice.positions[None] + 2e-3 * rng.uniform(-1, 1, v.shape)
    # One core would solve by a factor (see test_sweeps): it makes the sweeps that chunks need.
    monkeypatch.setattr("taichi_disk.model.world.solver_for", lambda points, kappa: (chebyshev.sweeps_for(kappa), 0.0))
    serial = world_of(lattice, physics, v, positions=x)
    monkeypatch.setattr(ordering, "PARALLEL_FROM", 1)
    cut = world_of(lattice, physics, v, positions=x)
    assert serial.chunks == 1
    assert cut.chunks >= 4
    if not single:
        force = Model.of(lattice, physics).force(x[0], v[0])
        np.testing.assert_allclose(cut.forces()[0], force, rtol=0, atol=1e-13 * np.abs(force).max())
    rows = [world.advance(5, 21) for world in (serial, cut)]
    # Only the order of additions differs; what rounding leaves grows with the steps.
    tolerance = 2e-5 if single else 1e-11
    np.testing.assert_allclose(cut.positions(), serial.positions(), rtol=0, atol=tolerance)
    np.testing.assert_allclose(cut.velocities(), serial.velocities(), rtol=0, atol=tolerance)
    scale = np.abs(rows[0]).max(axis=(0, 2))[:, None]
    assert (np.abs(rows[1] - rows[0]) <= 10 * tolerance * np.maximum(scale, 1e-3)).all()
    # A saved state goes on with the same bytes, in however many launches.
    before = cut.export_state()
    expected = cut.advance(2, 10)
    cut.import_state(before)
    pieces = np.concatenate([cut.advance(1, 10), (cut.advance(1, 7), cut.advance(1, 3))[1]])
    np.testing.assert_array_equal(pieces, expected)


def test_forces_on_the_way_equal_plain_numpy_and_the_ledger_closes(large):
    from taichi_disk.model import runtime

    runtime.start("cpu")
    lattice = disk(900, height=0.06)
    physics = replace(RIGID, eta=0.0)
    world = world_of(lattice, physics, moving_down(lattice, 0.05), 1e-3)
    rows = np.concatenate([world.first_row[None], world.advance(10, 100)])[:, :, 0]
    expected = Model.of(lattice, physics).force(world.positions()[0], world.velocities()[0])
    np.testing.assert_allclose(world.forces()[0], expected, rtol=0, atol=1e-15)  # rounding of places of order R
    total = rows[:, [COLUMNS.index(name) for name in ("kinetic", "elastic", "wall", "load")]].sum(axis=1)
    assert rows[:, COLUMNS.index("elastic")].max() > 1e-4
    assert np.abs(total - total[0]).max() < 1e-5 * rows[0, COLUMNS.index("kinetic")]
    world.destroy()


ELSEWHERE = """
import sys
sys.path.insert(0, "tests")
from taichi_disk.model import ordering, runtime
runtime.start("cpu", threads=int(sys.argv[1]))
ordering.PARALLEL_FROM = 1
from test_chunks import bodies, fingerprint
print(fingerprint(*bodies(sys.argv[2])))
"""


def fingerprint(lattice, physics, v) -> str:
    world = world_of(lattice, physics, v)
    rows = world.advance(3, 101)
    assert world.chunks > 1
    state = world.export_state()
    return hashlib.sha256(state.vectors.tobytes() + state.sums.tobytes() + rows.tobytes()).hexdigest()


@pytest.mark.validate
@pytest.mark.parametrize("name", ["rigid wall, trapezoidal", "rigid wall", "elastic wall, reset"])
def test_one_core_and_two_give_the_same_bytes(name):
    def run(threads: int) -> str:
        command = [sys.executable, "-c", ELSEWHERE, str(threads), name]
        folder = Path(__file__).parent.parent
        return subprocess.run(command, check=True, cwd=folder, capture_output=True, text=True, timeout=120).stdout

    assert run(1) == run(2) == run(2)
