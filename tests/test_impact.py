"""The two impacts as scenes: where they start, when they end, and the numbers they give."""

from __future__ import annotations

import numpy as np
import pytest
from reference import Model
from scipy.integrate import solve_ivp
from worlds import computed

from taichi_disk import load_scene
from taichi_disk.errors import SimulationError
from taichi_disk.model.physics import Physics
from taichi_disk.scenes import build
from taichi_disk.scenes.impact import contact_interval

SMALL = ("lattice.points=150", "time.safety=0.3")  # about the step of 1099 points: see test_energy
WALL = (*SMALL, "wall.points=180", "wall.width=3.4")


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("exponential_wall", SMALL),
        ("exponential_wall", (*SMALL, "impact.velocity=3e-3", "wall.a=3000", "wall.V0=7")),
        ("absorbing_wall", WALL),
        ("absorbing_wall", (*WALL, "impact.velocity=0.05")),
    ],
)
def test_the_disk_starts_out_of_the_walls_reach(name, settings):
    # The wall's potential at the start is below 1e-10 of the kinetic energy, and no more than needed: the way is short.
    setup = build(load_scene(name, settings))
    x, v = setup.lattice.positions, setup.velocities
    n = setup.lattice.disk_points
    kinetic = 0.5 * setup.lattice.masses[0] * np.sum(v**2)
    np.testing.assert_array_equal(v[:n], np.tile([0.0, -setup.velocity], (n, 1)))
    np.testing.assert_array_equal(v[n:], 0.0)
    assert kinetic == pytest.approx(0.5 * setup.velocity**2)
    physics = setup.physics
    height = x[:n, 1] if name == "exponential_wall" else x[setup.lattice.disk_surface, 1]
    potential = np.sum(physics.V0 * np.exp(-physics.a * height))
    assert 0.5e-10 * kinetic < potential < 1.0000001e-10 * kinetic
    assert x[:n, 1].min() == pytest.approx(setup.gap, rel=1e-12)


def test_a_gap_by_hand_is_kept():
    setup = build(load_scene("exponential_wall", (*SMALL, "impact.gap=0.25")))
    assert setup.lattice.positions[:, 1].min() == pytest.approx(0.25, rel=1e-12)


def reference_impact(setup, eta_star, end, rtol=1e-10):
    """DOP853 on the same lattice: (e, contact time) with the wall's force looked at 4000 times.

    The physics is the paper's, written out here: eta = eta* m c/R, m = M/N.
    """
    paper = Physics(k_a=1.0, k_b=1e-3, eta=eta_star / 150, wall="rigid", a=300.0, V0=150.0)
    model = Model.of(setup.lattice, paper)
    n = len(setup.lattice.positions)

    def rate(_t, y):
        x, v = y.reshape(2, n, 2)
        return np.concatenate([v, model.force(x, v) / model.mass]).ravel()

    start = np.concatenate([setup.lattice.positions, setup.velocities]).ravel()
    t = np.linspace(0.0, end, 4001)
    y = solve_ivp(rate, (0.0, end), start, method="DOP853", rtol=rtol, atol=1e-3 * rtol, t_eval=t).y
    x, v = y[: 2 * n].reshape(n, 2, -1), y[2 * n :].reshape(n, 2, -1)
    force = model.a * model.V0 * np.exp(-model.a * x[:, 1]).sum(axis=0)
    inside = t[force >= 0.01 * force.max()]
    return v[:, 1, -1].mean() / setup.velocity, inside[-1] - inside[0]


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize(
    ("eta_star", "velocity"),
    [
        (10.0, 0.02),
        pytest.param(0.0, 3e-3, marks=pytest.mark.validate),
        pytest.param(0.0, 0.05, marks=pytest.mark.validate),
        pytest.param(100.0, 0.02, marks=pytest.mark.validate),
    ],
)
def test_restitution_and_contact_time_equal_those_of_dop853(eta_star, velocity):
    settings = (*SMALL, f"material.eta_star={eta_star}", f"impact.velocity={velocity}", "time.sample_interval=0.02")
    setup, outcome = computed("exponential_wall", *settings)
    columns = outcome.columns
    values = setup.headline(columns).values
    e, duration = reference_impact(setup, eta_star, columns["t"][-1])
    # The error that 1099 points have at the automatic step, dt^2-bound: 2e-5.
    assert values["restitution"] == pytest.approx(e, abs=2e-5)
    # The reference's times stand on a grid of 1/4000 of the whole.
    assert values["contact_time"] == pytest.approx(duration, abs=2 * columns["t"][-1] / 4000)
    assert values["restitution"] == columns["com_vy"][-1] / velocity


@pytest.mark.usefixtures("taichi")
def test_the_contact_time_does_not_hang_on_the_rows_where_a_hard_wall_rattles():
    """Against a row for every step; rows 0.05 R/c apart miss the first and the last of the pushes."""
    hard = ("lattice.points=300", "wall.a=12000", "wall.V0=6000", "material.eta_star=0", "impact.velocity=0.05")
    found = {}
    for interval in ("auto", "1e-6"):
        setup, outcome = computed("exponential_wall", *hard, f"time.sample_interval={interval}")
        found[interval] = setup.headline(outcome.columns).values["contact_time"]
    assert found["auto"] == pytest.approx(found["1e-6"], rel=1e-3)
    every = round(0.05 / outcome.columns["t"][1])
    coarse = (outcome.columns[name][::every] for name in ("t", "wall_force", "com_vy"))
    start, end = contact_interval(*coarse)
    assert end - start != pytest.approx(found["1e-6"], rel=3e-3)


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize("tolerance", ["none", "1e-4"])
def test_what_a_run_finds_does_not_hang_on_how_many_rows_are_asked_for(tolerance):
    """Judged from rows 1 R/c apart this disk's energy looked 200 times better kept, and 1e-4 was broken three times."""
    hard = ("lattice.points=9", "lattice.seed=61", "wall.a=14040", "material.eta_star=1", "impact.velocity=0.1")
    found = []
    for interval in ("auto", "1"):
        setup, outcome = computed(
            "exponential_wall", *hard, f"time.tolerance={tolerance}", f"time.sample_interval={interval}"
        )
        found.append((outcome.facts, setup.headline(outcome.columns).values))
    assert found[0] == found[1]


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("exponential_wall", (*SMALL, "material.eta_star=0", "impact.velocity=0.05")),
        pytest.param("absorbing_wall", WALL, marks=pytest.mark.validate),
        pytest.param("absorbing_wall", (*WALL, "wall.boundary=pinned"), marks=pytest.mark.validate),
    ],
)
def test_when_it_ends_the_disk_has_left_for_good(name, settings):
    # Run on for as long again: the wall never touches the disk any more, the centre of mass flies on as it did.
    # (Without dashpots the disk vibrates on, which is the hard case.)
    from taichi_disk.model.observables import COLUMNS
    from taichi_disk.model.world import World

    setup, outcome = computed(name, *settings)
    columns, dt = outcome.columns, outcome.facts["dt"]
    assert columns["com_vy"][-1] > 0.0
    world = World(setup.lattice, setup.physics, setup.velocities[None], dt)
    world.advance(1, outcome.facts["steps"])
    np.testing.assert_array_equal(world.positions()[0], outcome.positions)
    rows = world.advance(2000, max(1, outcome.facts["steps"] // 2000))
    force, v = rows[:, COLUMNS.index("wall_force"), 0], rows[:, COLUMNS.index("com_vy"), 0]
    assert force.max() < 1e-7 * columns["wall_force"].max()
    np.testing.assert_allclose(v, columns["com_vy"][-1], rtol=1e-9)
    world.destroy()


def test_contact_interval_of_a_known_force():
    # F = exp(-|t - t_0|/tau) is 0.01 of its peak at t_0 -+ tau ln 100, and log-linear interpolation is exact on it.
    t = np.linspace(0.0, 30.0, 1001)
    tau, t0 = 1.7, t[500]
    start, end = contact_interval(t, 3.0 * np.exp(-np.abs(t - t0) / tau), t - t0)
    assert start == pytest.approx(t0 - tau * np.log(100.0), abs=1e-9)
    assert end == pytest.approx(t0 + tau * np.log(100.0), abs=1e-9)
    # Two touches: from the first to the last.
    twice = np.exp(-((t - 8.0) ** 2)) + 0.5 * np.exp(-((t - 20.0) ** 2))
    start, end = contact_interval(t, twice, t - t0)
    assert start == pytest.approx(8.0 - np.sqrt(np.log(100.0)), abs=1e-3)
    assert end == pytest.approx(20.0 + np.sqrt(np.log(50.0)), abs=1e-3)


@pytest.mark.usefixtures("taichi")
def test_a_run_that_cannot_end_gives_up_with_advice():
    with pytest.raises(SimulationError, match=r"not left the wall by t = .* impact\.max_time"):
        computed("exponential_wall", *SMALL, "impact.max_time=2.0")


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
def test_on_a_hard_wall_contact_lasts_as_long_as_hertz_says():
    # Quasi-static contact of an elastic disk: M xi'' = -F, with F(xi) of the exact law for one contact (Michell's
    # series), xi = F/(pi E) {ln(pi E R/F) - (1 + nu)/4}; E and nu measured on the same kind of lattice. The contact
    # time is a turning time of an energy integral. At v = 0.02 c the wall a = 3000 is harder than the disk; waves
    # and the lattice's grain are worth several per cent.
    from taichi_disk.moduli import bulk_moduli

    setup, outcome = computed("exponential_wall", "wall.a=3000", "wall.V0=1500", "material.eta_star=0")
    measured = setup.headline(outcome.columns).values["contact_time"]
    moduli = bulk_moduli(1099, 0, 1.0, 0.7)
    E, nu = moduli.young, moduli.poisson
    F = np.geomspace(1e-9, 0.5, 20_000)
    xi = F / (np.pi * E) * (np.log(np.pi * E / F) - (1 + nu) / 4)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (F[1:] + F[:-1]) * np.diff(xi))])
    speed2 = setup.velocity**2 - 2 * work
    inside = speed2 > 0
    # dt = dxi/v, with the turning point's square root integrated exactly over each interval: d(v)/(-F).
    v = np.append(np.sqrt(speed2[inside]), 0.0)
    force = np.append(F[inside], F[inside][-1])
    duration = 2 * np.sum(-np.diff(v) / (0.5 * (force[1:] + force[:-1]))) + 2 * xi[0] / setup.velocity
    assert measured == pytest.approx(duration, rel=0.08)


def test_a_hit_that_no_sample_has_seen_lies_between_the_samples_before_and_after_it() -> None:
    t, v = np.arange(5.0), np.array([-1.0, -1.0, -1.0, 0.9, 0.9])
    assert contact_interval(t, np.zeros(5), v) == (2.0, 3.0)
    assert 1.0 < contact_interval(t, np.array([0.0, 0.0, 1.0, 0.0, 0.0]), v)[0] < 2.0
