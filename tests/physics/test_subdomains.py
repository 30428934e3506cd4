"""Large lattices, stepped by subdomains: the same forces, motion, energies and bits."""

import hashlib
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import reference
from bodies import (
    ELASTIC,
    FALLING,
    FOUR_FORCES,
    disk,
    disk_and_wall,
    matched,
    moving_down,
    non_uniform,
    pressed,
)
from numpy.testing import assert_allclose, assert_array_equal

from taichi_disk.base import runtime
from taichi_disk.mechanics.integrators import (
    TAKAHASHI_IMADA,
    TRAPEZOIDAL,
    VELOCITY_VERLET,
)
from taichi_disk.mechanics.physics import Model, ResetBoundary, Springs, ordering
from taichi_disk.mechanics.simulation.simulation import Simulation


def test_subdomains_share_no_point_and_hold_every_spring_once(monkeypatch):
    bonds = disk(900).bonds
    assert ordering.arrange(bonds, 900).subdomains == 1
    assert ordering.arrange(bonds, ordering.PARALLEL_FROM).subdomains > 1
    monkeypatch.setattr(ordering, "PARALLEL_FROM", 1)
    arrangement = ordering.arrange(bonds, 900)
    assert arrangement.subdomains >= 4
    used = arrangement.source[arrangement.source >= 0]
    assert_array_equal(np.sort(used), np.arange(len(bonds)))
    assert_array_equal(arrangement.ends[arrangement.source >= 0], bonds[used])
    owned = []
    begin = 0
    for c, end in enumerate(arrangement.subdomain_ends):
        inside = arrangement.ends[begin * ordering.BLOCK : end * ordering.BLOCK]
        points = inside[inside < 900]
        assert c * arrangement.subdomain_points <= points.min()
        assert points.max() < (c + 1) * arrangement.subdomain_points
        owned.append(set(inside.ravel().tolist()))
        begin = int(end)
    assert sum(map(len, owned)) == len(set().union(*owned))


CASES = {
    "rigid wall, dashpots, non-uniform": VELOCITY_VERLET,
    "rigid wall, corrected forces": TAKAHASHI_IMADA,
    "elastic wall, reset, four forces": FOUR_FORCES,
    "elastic wall, matched, dashpots": TRAPEZOIDAL,
}


def body(name):
    """Return a disk in contact that moves at random, its model, and the step."""
    eta = 0.02 if "dashpots" in name else 0.0
    if name.startswith("rigid"):
        lattice = disk(900, height=0.02)
        model = pressed(0.02, eta)
    else:
        lattice = disk_and_wall(500, 500)
        boundary = ResetBoundary(1e-2) if "reset" in name else matched(lattice)
        model = Model(Springs(1.0, 2.0, eta), ELASTIC, boundary=boundary)
    lattice = non_uniform(lattice) if "non-uniform" in name else lattice
    rng = np.random.default_rng(0)
    shape = lattice.positions.shape
    v = moving_down(lattice, 0.05) + 0.01 * rng.standard_normal(shape)
    x = lattice.positions + 2e-3 * rng.uniform(-1, 1, shape)
    return replace(lattice, positions=x), model, CASES[name], v, 2e-3


def steps(simulation):
    """Return the rows of 105 steps, and a hash of the whole state after them."""
    rows = simulation.advance(105, 21)[0]
    state = simulation.snapshot()
    content = (state.vectors, state.sums, rows)
    found = hashlib.sha256(b"".join(values.tobytes() for values in content))
    return rows, found.hexdigest()


def both(name):
    """Return the simulations in one piece and in subdomains."""
    serial = Simulation(*body(name))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(ordering, "PARALLEL_FROM", 1)
        cut = Simulation(*body(name))
    assert (serial.arrangement.subdomains, cut.arrangement.subdomains > 3) == (1, True)
    return serial, cut


def elsewhere(name, threads):
    """Return the hashes of both in another process with this number of threads."""
    code = (
        "import sys; sys.path[:0] = ['tests', 'tests/physics'];"
        " from taichi_disk.base import runtime;"
        f" runtime.start(threads={threads}); from test_subdomains import *;"
        f" print(*(steps(simulation)[1] for simulation in both('{name}')))"
    )
    folder = Path(__file__).parents[2]
    command = [sys.executable, "-c", code]
    return subprocess.run(
        command, check=True, cwd=folder, capture_output=True, text=True, timeout=200
    ).stdout.split()


def test_subdomains_move_as_one_body(kernels, monkeypatch):
    lattice = disk(900, height=0.02)
    body = lattice, FALLING, VELOCITY_VERLET, moving_down(lattice, 0.05), 2e-3
    serial = kernels.simulation(*body)
    monkeypatch.setattr(ordering, "PARALLEL_FROM", 1)
    cut = Simulation(*body)
    assert cut.arrangement.subdomains > 3
    for few in (25, 7):
        rows, own = (one.advance(few, 10)[0] for one in (serial, cut))
        assert_allclose(own, rows, rtol=1e-10, atol=1e-13)
    assert_allclose(cut.now, serial.now, rtol=1e-10, atol=1e-13)


@pytest.mark.validate
@pytest.mark.parametrize("name", CASES)
def test_subdomains_on_any_number_of_cores_move_as_one_core_without_them_does(name):
    runtime.start()
    lattice, model, integrator, v, _ = body(name)
    serial, cut = both(name)
    # Dashpots that are solved for act at the velocity in the middle of the first step.
    f = cut.snapshot().vectors[2]
    solved = integrator is TRAPEZOIDAL
    w = v + 0.5 * cut.dt / lattice.masses[:, None] * f if solved else v
    force = reference.Model(lattice, model).force(lattice.positions, w)
    allowed = (1e-11 if solved else 1e-13) * np.abs(force).max()
    assert_allclose(f, force, rtol=0, atol=allowed)
    (rows, _), (own, bits) = found = steps(serial), steps(cut)
    # Only the order of additions differs, so rounding differences grow with the steps.
    assert_allclose(cut.positions(), serial.positions(), rtol=0, atol=1e-11)
    assert_allclose(cut.velocities(), serial.velocities(), rtol=0, atol=1e-11)
    scale = np.maximum(np.abs(rows).max(axis=0), 1e-3)
    assert (np.abs(own - rows) <= 1e-10 * scale).all()
    assert cut.peak_point_force() == pytest.approx(
        serial.peak_point_force(), rel=1e-9, abs=1e-12
    )
    # A saved state goes on bitwise, in any number of launches and of threads.
    before = cut.snapshot()
    expected = cut.advance(20, 10)[0]
    cut.restore(before)
    pieces = np.concatenate([cut.advance(few, 10)[0] for few in (7, 3, 6, 4)])
    assert_array_equal(pieces, expected)
    assert [hashed for _, hashed in found] == elsewhere(name, 1)
    # So does a simulation that starts again.
    again = Simulation(cut.lattice, *body(name)[1:], cut.cache)
    assert again.program is cut.program
    assert steps(again)[1] == bits
