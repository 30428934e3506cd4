"""The elastic wall: a point pushes the ends of the spring below by the lever rule."""

from dataclasses import replace

import numpy as np
import pytest
import reference
from bodies import ELASTIC, V0, WALL, A, computed, disk_and_wall
from numpy.testing import assert_allclose
from scipy.interpolate import BSpline
from scipy.optimize import brentq

from taichi_disk.mechanics.integrators import VELOCITY_VERLET
from taichi_disk.mechanics.physics import (
    Model,
    ResetBoundary,
    SmoothElasticWall,
    Springs,
)
from taichi_disk.mechanics.simulation.observables import INDEX

# Almost no springs, so that only the contact acts.
BARE = Model(Springs(1e-12, 1e-12), ELASTIC, boundary=ResetBoundary(1.0))
LATTICE = disk_and_wall()
N = LATTICE.disk_points


def forces(kernels, x, model=BARE):
    """Return the kernels' forces at rest with the points at `x`."""
    body = replace(LATTICE, positions=x)
    still = np.zeros_like(x)
    simulation = kernels.simulation(body, model, VELOCITY_VERLET, still, 1e-3)
    return simulation.snapshot().vectors[2]


def rough(seed, roughness, low, high):
    """Return positions with a rough surface, and the disk moved along it by `low` to
    `high`. The surface stays ordered in x: a point is over at most one spring."""
    rng = np.random.default_rng(seed)
    x = LATTICE.positions + roughness * rng.uniform(-1, 1, LATTICE.positions.shape)
    x[:N, 0] += rng.uniform(low, high)
    x[LATTICE.wall_surface, 0] = np.sort(x[LATTICE.wall_surface, 0])
    return x


@pytest.mark.parametrize("roughness", [0.0, 0.03, 0.06])
def test_points_find_the_spring_below_and_force_and_torque_balance(roughness, kernels):
    # Compare with a search over all pairs of points and springs. Springs are inclined
    # by up to 45 degrees, the disk is anywhere along the wall, or beyond its ends.
    plain = reference.Model(LATTICE, BARE)
    touching = 0
    for seed in range(12):
        x = rough(seed, roughness, -1.8, 1.8)
        expected = plain.wall_force(x)
        f = forces(kernels, x)
        rows = plain.contacts(x)
        scale = max(float(np.abs(expected).max()), 1.0)
        assert_allclose(f, expected, rtol=0, atol=1e-12 * scale)
        own = ELASTIC.forces(LATTICE, x)
        assert_allclose(own, expected, rtol=0, atol=1e-12 * scale)
        found = ELASTIC.contacts(LATTICE, x)
        assert found.points.tolist() == rows.point.tolist()
        assert LATTICE.wall_surface[found.carriers[:, 0]].tolist() == rows.left.tolist()
        touching += len(rows.point)
        scale = np.abs(f).sum()
        assert np.abs(f.sum(axis=0)).max() <= 1e-13 * scale + 1e-12
        torque = np.sum(x[:, 0] * f[:, 1] - x[:, 1] * f[:, 0])
        assert abs(torque) <= 1e-13 * scale + 1e-12
        moved = np.flatnonzero(np.abs(f).sum(axis=1) > 1e-9)
        assert set(moved) <= {*LATTICE.wall_surface, *LATTICE.disk_surface}
    assert touching > 12


SMOOTH = SmoothElasticWall(A, V0, 0.1)


def smooth_potential(x):
    """Return the potential above SciPy's B-spline through the wall's surface."""
    chain = x[LATTICE.wall_surface]
    # over its control point k at the parameter k
    curve = BSpline(np.arange(len(chain) + 3) - 1.5, chain, 2)
    energy = 0.0
    for px, py in x[LATTICE.disk_surface]:
        if curve(0.5)[0] <= px < curve(len(chain) - 1.5)[0]:
            at = brentq(
                lambda u, px=px: curve(u)[0] - px, 0.5, len(chain) - 1.5, xtol=1e-15
            )
            height = py - curve(at)[1]
            energy += (
                V0 * (np.exp(-A * height) - np.exp(-A * 0.1)) if height < 0.1 else 0.0
            )
    return energy


@pytest.mark.parametrize("roughness", [0.0, 0.03])
def test_smooth_contacts_push_along_gradients_and_keep_momentum(roughness, kernels):
    model = Model(Springs(1e-12, 1e-12), SMOOTH, boundary=ResetBoundary(1.0))
    for seed, place in enumerate((0.0, -1.4, -0.5, 0.9, 1.35, 1.4)):  # at ends, too
        x = rough(seed, roughness, place, place)
        f = forces(kernels, x, model)
        scale = np.abs(f).max()
        assert scale > 1e-3
        own = SMOOTH.forces(LATTICE, x)
        assert_allclose(f, own, rtol=0, atol=1e-12 * max(scale, 1.0))
        assert np.abs(f.sum(axis=0)).max() <= 1e-13 * np.abs(f).sum()
        assert SMOOTH.energy(LATTICE, x) == pytest.approx(
            smooth_potential(x), rel=1e-10
        )
        for i in np.argsort(-np.abs(f).sum(axis=1))[:4]:
            for c in (0, 1):
                moved = [x.copy(), x.copy()]
                moved[0][i, c] -= 1e-7
                moved[1][i, c] += 1e-7
                slope = np.diff([smooth_potential(x) for x in moved])[0] / 2e-7
                assert f[i, c] == pytest.approx(-slope, abs=1e-6 * scale)


@pytest.mark.validate
def test_an_impact_that_slides_over_the_smooth_surface_converges_with_order_2(kernels):
    # A spin moves points from spring to spring: with `springs` the energy jumps there.
    settings = (*WALL, "wall.boundary=pinned", "impact.velocity=0.05")
    settings += ("impact.spin=0.1", "impact.gap=0.08")
    settings += ("time.integrator=velocity_verlet",)
    e = {}
    for contact in ("smooth", "springs"):
        own = (*settings, f"wall.contact={contact}")
        runs = [
            computed(kernels, "absorbing_wall", *own, f"time.dt={dt}", estimate=False)
            for dt in (8e-3, 4e-3, 2e-3)
        ]
        slid = [np.abs(outcome.series["sliding"]).max() for _, outcome in runs]
        assert min(slid) > 1e-8 if contact == "springs" else max(slid) == 0.0
        e[contact] = [
            scenario.result(outcome.series)["restitution"] for scenario, outcome in runs
        ]
    first, second, third = e["smooth"]
    assert (first - second) / (second - third) == pytest.approx(4.0, abs=0.1)
    assert abs(e["springs"][1] - e["springs"][2]) > abs(second - third)


def test_a_surface_of_two_points_is_one_spring_for_either_contact(kernels):
    # No rim and few points: on 4 of 30 such walls the top is a single spring, and a
    # spline needs three points.
    coarse = ("absorbing_wall", "lattice.points=20", "lattice.rim=false")
    settings = (*coarse, "wall.points=120", "lattice.seed=18")
    found = []
    for contact in ("springs", "smooth"):
        scenario, outcome = computed(
            kernels, *settings, f"wall.contact={contact}", estimate=False
        )
        assert len(scenario.lattice.wall_surface) == 2
        found.append(scenario.result(outcome.series)["restitution"])
    assert found[0] == found[1] > 0.8


def test_a_point_that_passes_to_another_spring_loses_the_jump_of_its_potential(kernels):
    # on a bent surface, by the trapezoidal rule over the move
    rng = np.random.default_rng(3)
    x = LATTICE.positions.copy()
    x[LATTICE.wall_surface, 1] += 0.02 * rng.uniform(-1, 1, len(LATTICE.wall_surface))
    v = np.zeros_like(x)
    v[:N, 0] = 100.0  # farther than a spring in a step
    h = 3e-3
    body = replace(LATTICE, positions=x)
    simulation = kernels.simulation(body, BARE, VELOCITY_VERLET, v, h)

    def spring_below(i, at):
        return int(np.searchsorted(at[LATTICE.wall_surface, 0], at[i, 0], "right")) - 1

    def potential(i, k, at):
        start, end = at[LATTICE.wall_surface[k : k + 2]]
        along = end - start
        normal = np.array([-along[1], along[0]]) / np.hypot(*along)
        height = (at[i] - start) @ normal
        if height >= ELASTIC.threshold:
            return 0.0
        return V0 * (np.exp(-A * height) - np.exp(-A * ELASTIC.threshold))

    lost = 0.0
    for _ in range(2):
        (row,) = simulation.advance(1, 1)[0]
        state = simulation.snapshot()
        after = state.vectors[0]
        before = after - h * state.vectors[1]
        passed = 0
        for i in LATTICE.disk_surface:
            old, new = spring_below(i, before), spring_below(i, after)
            is_touching = ELASTIC.contacts(body, after).points
            if old != new and i in is_touching:
                passed += 1
                for at in (before, after):
                    lost += 0.5 * (potential(i, old, at) - potential(i, new, at))
        assert passed > 0
        assert row[INDEX["sliding"]] == pytest.approx(lost, rel=1e-9)
