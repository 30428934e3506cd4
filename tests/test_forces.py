"""The forces of the whole model against plain NumPy (`reference`), and against the slope of the energy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp
from reference import Model
from scipy.sparse.linalg import spsolve
from worlds import again, disk, disk_and_wall, matched

from taichi_disk.model.physics import Physics

pytestmark = pytest.mark.usefixtures("taichi")

RIGID = Physics(k_b=2.0, eta=0.3, wall="rigid", load=0.02)
ELASTIC = Physics(k_b=2.0, wall="elastic", boundary="none")


def world_of(lattice, physics, velocities, dt=1e-3, **lanes):
    from taichi_disk.model.world import World

    return World(lattice, physics, velocities, dt, **lanes)


def shaken(lattice, seed, amplitude=0.02):
    """The lattice's points displaced at random, so that bonds are stretched by several per cent, and velocities."""
    rng = np.random.default_rng(seed)
    shape = lattice.positions.shape
    return lattice.positions + amplitude * rng.uniform(-1, 1, shape), 0.1 * rng.standard_normal(shape)


def assert_equal_forces(force, expected):
    # Each force is a sum of some ten terms of its own size: rounding only. 1e-13 of the largest force.
    np.testing.assert_allclose(force, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


def at_rest(lattice, physics, velocities):
    if physics.boundary == "pinned":
        velocities[lattice.wall_boundary] = 0.0
    return velocities


CASES = {
    "free": (disk(), Physics(k_a=0.7)),
    "rigid wall, cubic springs, load, dashpots": (disk(height=0.03), RIGID),
    "rigid wall, implicit dashpots": (disk(height=0.03), replace(RIGID, integrator="trapezoidal")),
    "elastic wall": (disk_and_wall(height=0.03), ELASTIC),
    "elastic wall, dashpots, pinned": (disk_and_wall(height=0.03), replace(ELASTIC, eta=0.3, boundary="pinned")),
    "elastic wall, matched": (disk_and_wall(height=0.03), matched(disk_and_wall(), ELASTIC)),
    "elastic wall, implicit, matched": (
        disk_and_wall(height=0.03),
        replace(matched(disk_and_wall(), ELASTIC), eta=0.3, integrator="trapezoidal"),
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_forces_equal_plain_numpy(name):
    lattice, physics = CASES[name]
    model = Model.of(lattice, physics)
    world = None
    for seed in range(3):
        x, v = shaken(lattice, seed)
        v = at_rest(lattice, physics, v)
        if world is None:
            world = world_of(lattice, physics, v[None])
        again(world, x[None], v[None])
        if physics.wall == "elastic":
            assert len(list(model.contacts(x))) >= 3
        assert_equal_forces(world.forces()[0], model.force(x, v))
        row = dict(zip(columns(), world.first_row[:, 0], strict=True))
        assert row["elastic"] == pytest.approx(model.elastic(x), rel=1e-12)
        assert row["wall"] == pytest.approx(model.wall(x), rel=1e-11)
        assert row["kinetic"] == pytest.approx(0.5 * model.mass * np.sum(v**2), rel=1e-12)
        upward = model.force(x, v) - replace(model, rigid=False, disk_surface=np.zeros(0, int)).force(x, v)
        assert row["wall_force"] == pytest.approx(upward[: lattice.disk_points, 1].sum(), rel=1e-9)
    world.destroy()


def columns():
    from taichi_disk.model.observables import COLUMNS

    return COLUMNS


@pytest.mark.parametrize("name", ["rigid wall, cubic springs, load, dashpots", "elastic wall"])
def test_force_is_minus_the_slope_of_the_energy(name):
    # f_i = -dU/dx_i by central differences, step d: error d^2 U'''/6, with U''' ~ a^3 U at the wall, plus
    # rounding eps U/d. Checked on U as the world reports it and on the reference's, at points near the wall.
    lattice, physics = CASES[name]
    physics = replace(physics, eta=0.0)
    model = Model.of(lattice, physics)
    x, v = shaken(lattice, 7, 0.005)
    v[:] = 0.0
    world = world_of(lattice, physics, v[None])
    energies = [columns().index(one) for one in ("elastic", "wall", "load")]

    def reported(x):
        again(world, x[None], v[None])
        return world.first_row[energies, 0].sum()

    again(world, x[None], v[None])
    force = world.forces()[0]
    scale = np.abs(force).max()
    lowest = np.argsort(lattice.positions[: lattice.disk_points, 1])[:4]
    under = lattice.wall_surface[np.argsort(np.abs(x[lattice.wall_surface, 0] - x[lowest[0], 0]))[:3]]
    others = np.random.default_rng(3).integers(0, len(x), 8)
    d = 2e-7
    for i in [*lowest, *under, *others]:
        for c in (0, 1):
            step = np.zeros_like(x)
            step[i, c] = d
            for potential in (reported, model.potential):
                slope = (potential(x + step) - potential(x - step)) / (2 * d)
                assert abs(force[i, c] + slope) < 1e-7 * scale
    world.destroy()


SLOW = [pytest.param(boundary, marks=pytest.mark.validate) for boundary in ("pinned", "none")]


@pytest.mark.parametrize("boundary", ["dashpot", *SLOW])
def test_implicit_velocity_solves_its_equation(boundary):
    # (1 + h/2 (eta L + Z)/m) u = v_{k-1/2} + h/2 F/m, F the forces without dashpots; then f = (u - v_{k-1/2}) 2 m/h.
    lattice = disk_and_wall(height=0.03)
    physics = replace(ELASTIC, eta=0.4, integrator="trapezoidal", boundary=boundary)
    if boundary == "dashpot":
        physics = matched(lattice, physics)
    x, v = shaken(lattice, 1)
    v = at_rest(lattice, physics, v)
    h, n = 5e-3, len(x)
    world = world_of(replace(lattice, positions=x), physics, v[None], h)
    world.advance(1, 5)
    state = world.export_state()
    x, before = state.vectors[0, :, :, 0], state.vectors[1, :, :, 0]
    conservative = replace(Model.of(lattice, physics), eta=0.0, impedance=None, pinned=False).force(x, 0 * x)

    i, j = lattice.bonds.T
    ones = np.ones(len(i))
    weights = sp.coo_matrix((np.r_[ones, ones], (np.r_[i, j], np.r_[j, i])), shape=(n, n)).tocsr()
    laplacian = sp.diags(np.asarray(weights.sum(axis=1)).ravel()) - weights
    m = lattice.masses[0]
    moving = np.ones(n, bool)
    if boundary == "pinned":
        moving[lattice.wall_boundary] = False
    expected = np.zeros((n, 2))
    for c in (0, 1):
        z = np.zeros(n)
        if boundary == "dashpot":
            z[lattice.wall_boundary] = physics.impedance[:, c]
        A = (sp.identity(n) + h / (2 * m) * (physics.eta * laplacian + sp.diags(z))).tocsc()
        right = before[:, c] + h / (2 * m) * conservative[:, c]
        expected[moving, c] = spsolve(A[moving][:, moving], right[moving])
    np.testing.assert_allclose(world.velocities()[0], expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    force = 2 * m / h * (expected - before)
    # A difference of nearly equal velocities: what rounding leaves is eps v 2 m/h.
    np.testing.assert_allclose(world.forces()[0], force, rtol=0, atol=1e-11 * np.abs(force).max())
    world.destroy()


@pytest.mark.parametrize("lanes", [4, pytest.param(8, marks=pytest.mark.validate)])
def test_lanes_feel_their_own_velocity_dashpot_and_load(lanes):
    lattice = disk(height=0.03)
    x, _ = shaken(lattice, 2)
    v = np.stack([shaken(lattice, 10 + w)[1] for w in range(lanes)])
    eta, load = np.linspace(0.1, 0.8, lanes), np.linspace(0.05, 0.01, lanes)
    world = world_of(replace(lattice, positions=x), RIGID, v, eta=eta, load=load)
    for w in range(lanes):
        model = replace(Model.of(lattice, RIGID), eta=eta[w], load=load[w])
        assert_equal_forces(world.forces()[w], model.force(x, v[w]))
    world.destroy()


def test_lanes_of_an_elastic_wall_find_their_own_contacts():
    lattice = disk_and_wall(height=0.03)
    states = [shaken(lattice, 20 + w) for w in range(4)]
    x, v = (np.stack(part) for part in zip(*states, strict=True))
    x[:, : lattice.disk_points, 0] += np.array([-0.3, 0.0, 0.1, 0.4])[:, None]
    world = world_of(lattice, ELASTIC, v)
    again(world, x, v)
    for w in range(4):
        assert_equal_forces(world.forces()[w], Model.of(lattice, ELASTIC).force(x[w], v[w]))
    world.destroy()


def test_a_lane_moves_as_it_would_alone():
    # A single run takes its springs in blocks of four, lanes one by one; each point still adds up its springs in
    # the same order: on x86-64 the states are even equal in every byte. Energies are summed in another order.
    lattice = disk(height=0.02)
    v = np.stack([shaken(lattice, 30 + w)[1] for w in range(4)]) * 0.1
    eta = np.array([0.0, 0.1, 0.2, 0.4])
    together = world_of(lattice, RIGID, v, eta=eta)
    rows = together.advance(1, 200)
    alone = world_of(lattice, RIGID, v[2:3], eta=eta[2:3])
    row = alone.advance(1, 200)
    np.testing.assert_allclose(together.positions()[2], alone.positions()[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(together.velocities()[2], alone.velocities()[0], rtol=0, atol=1e-14)
    np.testing.assert_allclose(rows[0, :, 2], row[0, :, 0], rtol=1e-11, atol=1e-14)
    together.destroy()
    alone.destroy()


def test_unequal_implicit_dashpots_in_lanes_are_refused():
    lattice = disk(12)
    with pytest.raises(ValueError, match="same eta"):
        world_of(lattice, replace(RIGID, integrator="trapezoidal"), np.zeros((2, 12, 2)), eta=[0.1, 0.2])
