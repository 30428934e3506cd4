"""The implicit dashpots of large lattices, by Chebyshev iteration: against the factor, in order, energy and bytes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import Model
from worlds import by_hand, computed, disk, disk_and_wall, matched, moving_down

from taichi_disk.lattice import disk_lattice
from taichi_disk.model import chebyshev
from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import spectrum, step_limit
from taichi_disk.stiffness import laplacian, largest_eigenvalue

pytestmark = pytest.mark.usefixtures("taichi")

N = 60
RIGID = Physics(k_b=1.0, eta=100.0 / N, wall="rigid", integrator="trapezoidal")


@pytest.fixture
def swept(monkeypatch):
    """Small lattices are solved as large ones are, on one core."""
    monkeypatch.setattr(chebyshev, "FACTOR_UP_TO", 0)
    monkeypatch.setattr("taichi_disk.model.world.solver_for", lambda points, kappa: (chebyshev.sweeps_for(kappa), 0.0))


def world_of(lattice, physics, velocities, dt):
    from taichi_disk.model.world import World

    return World(lattice, physics, velocities, dt)


@pytest.mark.parametrize("kappa", [1.01, 1.5, 2.5, 12.0, 100.0])
@pytest.mark.parametrize("more", [0, 3])
def test_sweeps_leave_the_residue_and_solve_for_the_momentum_exactly(kappa, more):
    sweeps = chebyshev.sweeps_for(kappa) + more
    eigenvalues = np.linspace(1.0, kappa, 1001)
    inverse, *weights = chebyshev.weights(kappa, sweeps)
    assert len(weights) == sweeps
    before = now = np.ones(1001)  # the error in each mode; the solution is zero
    for w in weights:
        before, now = now, before + w * (now - eigenvalues * now * inverse - before)
    bound = chebyshev.residue(kappa, sweeps)
    assert bound * kappa <= chebyshev.TOLERANCE
    np.testing.assert_allclose(np.abs(now).max(), bound, rtol=1e-3)
    assert abs(now[0]) < 1e-14


def test_fewer_sweeps_would_not_do():
    for kappa in (1.5, 2.5, 12.0):
        sweeps = chebyshev.sweeps_for(kappa)
        assert sweeps == chebyshev.LEAST or kappa * chebyshev.residue(kappa, sweeps - 1) > chebyshev.TOLERANCE


@pytest.mark.parametrize(("rim", "spacing"), [(True, 0.7), (False, 0.0)])
def test_the_largest_rate_is_bounded_from_above(rim, spacing):
    for points in (3, 60, 1000):
        lattice = disk_lattice(points, 1, rim=rim, min_spacing=spacing)
        exact = largest_eigenvalue(laplacian(lattice.bonds, points), np.ones(points))
        assert exact <= chebyshev.largest_rate(lattice.bonds, points) <= 1.4 * exact
    pair = by_hand([(0.0, 0.0), (1.0, 0.0), (3.0, 0.0)], [(0, 1)], 1.0)
    assert chebyshev.largest_rate(pair.bonds, 3) == pytest.approx(2.0)


def case(name):
    """Lattice, physics and velocities."""
    if name == "rigid":
        lattice, physics = disk(N, height=0.03), RIGID
    else:
        lattice = disk_and_wall(N, 80, height=0.03)
        physics = replace(RIGID, wall="elastic")
        physics = matched(lattice, physics) if name == "matched" else replace(physics, boundary=name)
        if name == "reset":
            physics = replace(physics, reset_interval=0.02)
    v = moving_down(lattice, 0.05)
    v += 0.01 * np.random.default_rng(0).standard_normal(v.shape)
    if name == "pinned":
        v[0, lattice.wall_boundary] = 0.0
    return lattice, physics, v


@pytest.mark.parametrize("name", ["rigid", "matched", "reset", pytest.param("pinned", marks=pytest.mark.validate)])
def test_many_sweeps_give_what_the_factor_gives(name, swept, monkeypatch):
    lattice, physics, v = case(name)
    monkeypatch.setattr(chebyshev, "TOLERANCE", 1e-13)
    by_sweeps = world_of(lattice, physics, v, 5e-3)
    monkeypatch.undo()
    by_factor = world_of(lattice, physics, v, 5e-3)
    assert by_sweeps.sweeps > 10
    assert by_factor.sweeps == 0
    assert {"factor", "row", "column", "order"}.isdisjoint(by_sweeps.fields)
    assert {"neighbours", "iteration"}.isdisjoint(by_factor.fields)
    assert ("outer" in by_sweeps.fields) == (name == "matched")
    rows = [world.advance(5, 6) for world in (by_sweeps, by_factor)]
    np.testing.assert_allclose(by_sweeps.positions(), by_factor.positions(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_sweeps.velocities(), by_factor.velocities(), rtol=0, atol=1e-12)
    np.testing.assert_allclose(by_sweeps.forces(), by_factor.forces(), rtol=0, atol=1e-11)
    np.testing.assert_allclose(rows[0], rows[1], rtol=0, atol=1e-11)


@pytest.mark.parametrize("name", ["rigid", pytest.param("reset", marks=pytest.mark.validate)])
def test_as_few_sweeps_as_are_made_keep_order_two(name, swept):
    lattice, physics, v = case(name)
    v = moving_down(lattice, 0.05)
    if name == "rigid":
        v[0, :, 0] += 0.02 * lattice.positions[:, 1]
    physics = replace(physics, reset_interval=0.12 if name == "reset" else 0.0)
    end, found, sweeps = 1.92, [], []
    interval = physics.reset_interval or None
    exact = Model.of(lattice, physics).solve(lattice.positions, v[0], end, rtol=1e-10, reset_interval=interval)
    for steps in (960, 1920, 3840):
        world = world_of(lattice, physics, v, end / steps)
        world.advance(1, steps)
        found.append([np.abs(world.positions()[0] - exact[0]).max(), np.abs(world.velocities()[0] - exact[1]).max()])
        sweeps.append(world.sweeps)
    errors = np.array(found)
    assert 3 <= sweeps[2] <= sweeps[0] <= 6
    np.testing.assert_allclose(np.log2(errors[:-1] / errors[1:]), 2.0, atol=0.1)


def test_an_impact_comes_out_as_with_the_factor_and_its_ledger_closes(swept, monkeypatch):
    settings = ("lattice.points=300", "material.eta_star=100", "time.integrator=trapezoidal")
    setup, by_sweeps = computed("exponential_wall", *settings)
    monkeypatch.undo()
    _, by_factor = computed("exponential_wall", *settings)
    e, expected = (setup.headline(one.columns).values["restitution"] for one in (by_sweeps, by_factor))
    assert by_sweeps.facts["dt"] == by_factor.facts["dt"]
    assert e != expected
    assert e == pytest.approx(expected, abs=1e-5)
    assert abs(by_sweeps.facts["energy"]["closing_imbalance"]) < 1e-6
    assert by_sweeps.facts["energy"]["worst_imbalance"] < 1e-4


@pytest.mark.parametrize("eta_star", [3.0, 30.0, 300.0])
def test_a_free_disk_is_stable_close_to_the_undamped_limit_and_keeps_its_momentum(eta_star, swept):
    lattice = disk(N)
    physics = Physics(eta=eta_star / N, integrator="trapezoidal")
    v = 1e-4 * np.random.default_rng(0).standard_normal((1, N, 2))
    world = world_of(lattice, physics, v, 0.98 * step_limit(spectrum(lattice, physics), physics, 0.0))
    rows = np.concatenate([world.first_row[None], world.advance(40, 500)])[:, :, 0]
    column = {name: rows[:, k] for k, name in enumerate(COLUMNS)}
    assert column["kinetic"].max() <= column["kinetic"][0]
    assert column["kinetic"][-1] + column["elastic"][-1] < 0.5 * column["kinetic"][0]
    drift = np.ptp([column["com_vx"], column["com_vy"]], axis=1)
    assert drift.max() < 1e-14 * np.abs(v).max() * N * 20_000


def test_a_saved_state_goes_on_with_the_same_bytes(swept):
    lattice, physics, v = case("rigid")
    world = world_of(lattice, physics, v, 5e-3)
    world.advance(1, 7)
    state = world.export_state()
    expected = world.advance(3, 5)
    world.advance(1, 11)
    world.import_state(state)
    np.testing.assert_array_equal(world.advance(3, 5), expected)
    assert world.restart(lattice, physics, v, 5e-3)
    assert not world.restart(lattice, physics, v, 1e-4)  # needs fewer sweeps: other kernels
