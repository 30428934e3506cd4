"""The pressed disk's equilibrium: at rest, stable, and the same as an independent minimiser finds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import minimize, root

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice, bond_lengths, disk_lattice
from taichi_disk.newton import compress, rigid_balance
from taichi_disk.triangulation import triangulate

K_A, K_B, A, V0, P = 1.0, 1e-3, 300.0, 150.0, 1e-2


def potential(lattice, x, a=A, V0=V0, pressure=P, k_a=K_A):
    """Energy and force, bond by bond and point by point, from the paper's formulas."""
    i, j = lattice.bonds.T
    d = x[i] - x[j]
    r = np.hypot(*d.T)
    s = r - lattice.rest_lengths
    wall = V0 * np.exp(-a * x[:, 1])
    energy = np.sum(k_a * s**2 / 2 + K_B * s**4 / 4) + wall.sum() + pressure * x[:, 1].mean()
    pull = ((k_a * s + K_B * s**3) / r)[:, None] * d
    force = np.zeros_like(x)
    np.subtract.at(force, i, pull)
    np.add.at(force, j, pull)
    force[:, 1] += a * wall - pressure / len(x)
    return energy, force


def xi(lattice, x):
    """How much nearer the lowest point has come to the centre of mass."""
    before, after = (p[:, 1].mean() - p[:, 1].min() for p in (lattice.positions, x))
    return before - after


def spread(x):
    return x - x.mean(axis=0)


@pytest.mark.parametrize("rim", [True, False])
@pytest.mark.parametrize("a", [30.0, 300.0, 3000.0, 30000.0])
@pytest.mark.parametrize("pressure", [1e-3, 5e-2])
def test_it_comes_to_rest_for_soft_and_hard_walls_and_all_loads(rim, a, pressure):
    for seed in (0, 1, 2):
        disk = disk_lattice(200, seed, rim, 0.7 if rim else 0.0)
        rest = compress(disk, K_A, K_B, a, V0, pressure)
        # Springs of length 0.1 on points at heights near 1 round to about 1e-15; the goal is four times that.
        assert np.abs(potential(disk, rest.positions, a, pressure=pressure)[1]).max() < 1e-14


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_wall_bears_the_load_and_exerts_no_torque(seed):
    disk = disk_lattice(1099, seed)
    x = compress(disk, K_A, K_B, A, V0, P).positions
    bearing = A * V0 * np.exp(-A * x[:, 1])
    assert bearing.sum() == pytest.approx(P, rel=1e-10)
    assert np.sum(bearing * (x[:, 0] - x[:, 0].mean())) == pytest.approx(0, abs=1e-10 * P)


@pytest.mark.parametrize(("points", "seed"), [(40, 0), (40, 1), (80, 2)])
def test_it_is_the_minimum_that_bfgs_finds(points, seed):
    disk = disk_lattice(points, seed)
    rest = compress(disk, K_A, K_B, A, V0, P)
    start = disk.positions + np.array([0.0, rigid_balance(disk.positions[:, 1], A, V0, P)])
    found = minimize(
        lambda x: potential(disk, x.reshape(-1, 2))[0],
        start.ravel(),
        jac=lambda x: -potential(disk, x.reshape(-1, 2))[1].ravel(),
        method="BFGS",
        options={"gtol": 1e-12, "maxiter": 20000},
    ).x.reshape(-1, 2)
    # BFGS stalls where the energy rounds, eps U = 2e-18: displacements of the soft modes to about 1e-6.
    assert xi(disk, rest.positions) == pytest.approx(xi(disk, found), rel=1e-5)


@pytest.mark.parametrize("seed", [0, 3, 4])
def test_every_small_displacement_costs_energy_but_sliding(seed):
    disk = disk_lattice(150, seed)
    x = compress(disk, K_A, K_B, A, V0, 5e-2).positions
    lowest, _ = potential(disk, x, pressure=5e-2)
    rng = np.random.default_rng(seed)
    arm = spread(x)
    rolling = np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    for move in [rolling, -rolling, *rng.standard_normal((20, 150, 2))]:
        move = move - [move[:, 0].mean(), 0.0]
        assert potential(disk, x + 1e-4 * move, pressure=5e-2)[0] > lowest
    slid = potential(disk, x + np.array([0.1, 0.0]), pressure=5e-2)[0]
    assert slid == pytest.approx(lowest, rel=1e-13)


def test_rolling_is_reported_and_leaves_the_centre_of_mass_where_it_was():
    # Far from rest at the start: this lattice's centre of mass lies to the side.
    disk = disk_lattice(1099, 1)
    rest = compress(disk, K_A, K_B, A, V0, 1e-3)
    assert abs(rest.roll) > 1
    # The strained disk differs from the turned one by no more than the order of P/k_a.
    c, s = np.cos(rest.roll), np.sin(rest.roll)
    turned = spread(disk.positions) @ np.array([[c, s], [-s, c]])
    assert np.abs(spread(rest.positions) - turned).max() < 10 * 1e-3 / K_A
    assert rest.positions[:, 0].mean() == pytest.approx(disk.positions[:, 0].mean(), abs=1e-12)


def hexagon():
    """A regular hexagon and its centre, standing on a corner."""
    angle = np.pi / 6 + np.arange(6) * np.pi / 3
    corner = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    corner[np.abs(corner) < 1e-15] = 0.0
    mesh = triangulate(np.concatenate([corner, [[0.0, 0.0]]]))
    none = np.empty(0, dtype=np.int32)
    length = bond_lengths(mesh.positions, mesh.bonds)
    return Lattice(mesh.positions, mesh.bonds, length, np.full(7, 1 / 7), 7, mesh.outline, none, none)


def test_a_hexagon_on_its_corner_tips_over_onto_a_side():
    disk = hexagon()
    rest = compress(disk, K_A, K_B, A, V0, P)
    assert abs(rest.roll) == pytest.approx(np.pi / 6, abs=1e-4)  # a strained hexagon, P/k_a = 1e-2
    height = np.sort(rest.positions[:, 1])
    assert height[1] - height[0] < 1e-9


def test_started_at_rest_on_its_corner_it_tips_over_too():
    disk = hexagon()
    lift = rigid_balance(disk.positions[:, 1], A, V0, P)
    start = (disk.positions + np.array([0.0, lift])).ravel()
    upright = root(lambda x: potential(disk, x.reshape(-1, 2))[1].ravel(), start, method="lm", tol=1e-15).x
    upright = upright.reshape(-1, 2)
    assert np.abs(potential(disk, upright)[1]).max() < 1e-15
    rest = compress(disk, K_A, K_B, A, V0, P, start=upright)
    assert abs(rest.roll) == pytest.approx(np.pi / 6, abs=1e-4)


def test_V0_only_shifts_the_height():
    # V0 exp(-a y) = (10 V0) exp(-a (y + ln(10)/a)).
    disk = disk_lattice(200, 0)
    low, high = (compress(disk, K_A, K_B, A, factor * V0, P).positions for factor in (1, 10))
    assert high - low == pytest.approx(np.broadcast_to([0.0, np.log(10) / A], low.shape), abs=1e-9)


def test_only_the_ratios_of_the_forces_matter():
    disk = disk_lattice(200, 0)
    one = compress(disk, 1.0, 0.0, A, V0, P).positions
    literal = compress(disk, 1 / 1099, 0.0, A, V0 / 1099, P / 1099).positions
    assert literal == pytest.approx(one, abs=1e-9)


def test_restarted_at_rest_it_stays_and_leaves_its_start_alone():
    disk = disk_lattice(200, 0)
    rest = compress(disk, K_A, K_B, A, V0, P)
    start = rest.positions.copy()
    again = compress(disk, K_A, K_B, A, V0, P, start=start)
    assert again.iterations == 0
    assert (start == rest.positions).all()


def test_iterations_are_reported_and_their_number_is_kept():
    disk = disk_lattice(200, 0)
    seen = []
    rest = compress(disk, K_A, K_B, A, V0, P, on_iteration=lambda k, residual: seen.append((k, residual)))
    assert [k for k, _ in seen] == list(range(rest.iterations + 1))
    assert seen[-1][1] == rest.residual
    with pytest.raises(SimulationError, match=f"within {rest.iterations - 1} Newton iterations"):
        compress(disk, K_A, K_B, A, V0, P, max_iterations=rest.iterations - 1)


def test_the_last_iterations_converge_fast():
    seen = []
    compress(disk_lattice(1099, 0), K_A, K_B, A, V0, P, on_iteration=lambda k, residual: seen.append(residual))
    assert len(seen) <= 12
    assert seen[-1] < 1e-8 * seen[-4]


def test_rigid_balance_bears_the_load():
    heights = disk_lattice(1099, 0).positions[:, 1]
    for a in (30.0, 30000.0):
        y = heights + rigid_balance(heights, a, V0, P)
        assert np.sum(a * V0 * np.exp(-a * y)) == pytest.approx(P, rel=1e-11)


@pytest.mark.validate
def test_a_fine_disk_on_a_hard_wall_follows_the_continuum():
    # xi = P/(pi E) (ln(pi E R/P) - (1 + nu)/4): one contact, uniform body force, from the centre of mass.
    disk = disk_lattice(17_600, 0)
    young, poisson = 1.10, 0.286
    for pressure in (4e-3, 1e-2):
        measured = xi(disk, compress(disk, K_A, K_B, 3000.0, V0, pressure).positions)
        law = pressure / (np.pi * young) * (np.log(np.pi * young / pressure) - (1 + poisson) / 4)
        assert measured == pytest.approx(law, rel=0.08)
