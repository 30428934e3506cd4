"""Several bounces of one disk under gravity."""

from functools import cache

import numpy as np
import pytest
import reference
from bodies import computed
from numpy.testing import assert_array_equal

from taichi_disk import load_scene, run
from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.experiments.computation.contact import apexes, flights
from taichi_disk.experiments.scenes.bounces import NAMES

LONG = pytest.mark.validate
GRAVITY = 5e-3
DISK = ("exponential_wall", "lattice.points=60", "impact.velocity=0.05")
FALL = (*DISK, f"impact.gravity={GRAVITY}")
# with a step that no run shortens
RINGING = (*FALL, "impact.bounces=6", "material.eta_star=0", "time.dt=0.018")


@cache
def six_bounces(kernels):
    return computed(kernels, *RINGING)


@pytest.fixture
def bounced(kernels):
    return six_bounces(kernels)


def restitutions(outcome):
    found = outcome.summary
    names = [name for name in found if name.startswith("restitution")]
    return np.array([found[name] for name in names])


def test_flights_are_parabolas(bounced):
    columns = bounced[1].series
    for top in apexes(columns):
        rows = slice(top - 100, top)
        t = columns["t"][rows] - columns["t"][top]
        y = columns["com_y"][top] + columns["com_vy"][top] * t - GRAVITY * t**2 / 2.0
        np.testing.assert_allclose(columns["com_y"][rows], y, rtol=0.0, atol=2e-14)


def test_a_restitution_is_the_root_of_the_ratio_of_two_heights(bounced):
    scenario, outcome = bounced
    columns = outcome.series
    tops = apexes(columns)
    highest = columns["com_y"] + columns["com_vy"] ** 2 / (2.0 * GRAVITY)
    fall = 0.05**2 / (2.0 * GRAVITY)
    heights = np.array([fall, *(highest[tops] - scenario.surface)])
    e = restitutions(outcome)
    assert len(e) == 6
    assert outcome.summary["measured"].keys() >= {"restitution", "restitution_6"}
    np.testing.assert_allclose(e, np.sqrt(heights[1:] / heights[:-1]), rtol=1e-6)
    # the wall's potential at the surface is that of the flight
    assert scenario.scene.wall.potential(
        scenario.surface - columns["com_y"][0] + scenario.gap
    ) == pytest.approx(0.5 * 0.05**2)


def test_energy_with_that_of_the_height_is_kept(bounced):
    _, outcome = bounced
    columns = outcome.series
    assert np.ptp(columns["load"]) > 0.9 * 0.05**2 / 2.0
    energy = outcome.summary["energy"]
    assert energy["worst_imbalance"] < 1e-4
    stored = columns["vibration"] + columns["elastic"]
    left = (stored[apexes(columns)[0]] - stored[0]) / columns["translation"][0]
    assert energy["vibration_left"] == pytest.approx(left)
    assert "several bounces, after" in outcome.summary["measured"]["vibration_left"]
    assert outcome.summary["warnings"] == []


@pytest.mark.parametrize(
    "seed, bounces", [(0, 2), *(pytest.param(seed, 6, marks=LONG) for seed in range(3))]
)
def test_each_bounce_is_that_of_an_independent_solver(kernels, seed, bounces):
    # Its force is NumPy's, and its integrator SciPy's DOP853.
    keys = ("lattice.points=40", f"lattice.seed={seed}", f"impact.bounces={bounces}")
    fast = ("impact.velocity=0.1", "impact.gravity=0.04")
    scenario, outcome = computed(kernels, *RINGING, *keys, *fast)
    lattice = scenario.lattice
    model = reference.Model(lattice, scenario.model)
    columns = outcome.series
    times = columns["t"][flights(columns)]
    states = model.solve(lattice.positions, scenario.velocities, times, rtol=1e-8)
    energies = []
    for x, v in states:
        height = lattice.masses @ x[:, 1] - scenario.surface
        vy = lattice.masses @ v[:, 1]
        energies.append(vy**2 / 2.0 + model.wall(x) + 0.04 * height)
    exact = np.sqrt(np.divide(energies[1:], energies[:-1]))
    estimates = outcome.summary["error_estimate"]
    known = [estimates[name] for name in NAMES[:bounces]]
    parts = np.abs(restitutions(outcome) - exact) / known
    # The estimates are neither too small nor much too large.
    assert parts.max() < 1.0
    assert parts.max() > 0.02


@LONG
def test_weak_gravity_changes_the_first_bounce_in_proportion(kernels):
    _, plain = computed(kernels, *DISK)
    gravities = np.array([4e-4, 2e-4, 1e-4])
    changes = []
    for gravity in gravities:
        _, weak = computed(kernels, *DISK, f"impact.gravity={gravity}")
        changes.append(weak.summary["restitution"] - plain.summary["restitution"])
    slopes = np.divide(changes, gravities)
    np.testing.assert_allclose(slopes, slopes[-1], rtol=0.01)
    # At no gravity nothing is left but the error of the step.
    left = changes[-1] - 1e-4 * (2.0 * slopes[-1] - slopes[-2])
    assert abs(left) < plain.summary["error_estimate"]["restitution"]


def test_bounces_go_on_bitwise_as_further_ones(kernels, bounced):
    _, more = bounced
    _, fewer = computed(kernels, *RINGING, "impact.bounces=2")
    assert_array_equal(restitutions(fewer), restitutions(more)[:2])
    rows = len(fewer.series["t"])
    assert_array_equal(fewer.series["com_y"], more.series["com_y"][:rows])


def test_a_disk_bounces_on_a_wall_that_swallows_waves(kernels):
    keys = ("lattice.points=40", "wall.points=60", "wall.width=3.0", "impact.bounces=2")
    speed = ("impact.velocity=0.05", "impact.gravity=8e-3")
    _, outcome = computed(kernels, "absorbing_wall", *keys, *speed)
    e = restitutions(outcome)
    assert len(e) == 2
    assert ((e > 0.2) & (e < 1.0)).all()


# ---- rest


@pytest.mark.parametrize("eta_star, made", [(1.0, 3), (10.0, 0)])
def test_a_damped_disk_comes_to_rest(kernels, eta_star, made):
    keys = (f"material.eta_star={eta_star}", "impact.bounces=20", "impact.gravity=0.01")
    _, outcome = computed(kernels, *DISK, *keys)
    columns = outcome.series
    assert len(apexes(columns)) == made
    assert len(restitutions(outcome)) == max(made, 1)
    assert outcome.summary["warnings"][0].startswith(
        f"{made} of 20 bounces: then the energy of the disk did not suffice to"
    )
    assert "e+" not in outcome.scenario.conclusion(columns)  # 100 %, not 1e+02 %
    # Not even all of its energy would lift it to the height of its start.
    stored = sum(columns[name][-1] for name in ("kinetic", "elastic", "wall", "load"))
    assert stored < 0.01 * columns["com_y"][0]
    assert (outcome.summary["restitution"] == 0.0) == (made == 0)


# ---- what a scene says


def test_a_run_that_ends_too_early_says_how_many_bounces_it_made(kernels):
    text = "has made 2 of 6 bounces by t = 50.* folded, .*: set impact.velocity lower"
    with pytest.raises(SimulationError, match=text):
        computed(kernels, *RINGING, "impact.max_time=50")


def test_the_height_of_a_fall_gives_the_speed():
    scene = load_scene("exponential_wall", ["impact.gravity=0.001", "impact.drop=1.25"])
    assert scene.impact.velocity == pytest.approx(0.05, rel=1e-15)
    assert load_scene(scene.to_yaml()) == scene
    assert scene.impact.rise == pytest.approx(1.25)


@pytest.mark.parametrize(
    "keys, text",
    [
        ("impact.bounces=2", "impact.bounces: nothing falls without gravity"),
        ("impact.drop=2", "impact.drop: .* an impact.gravity above 0, or bounces: 1"),
        ("impact.gravity=1e-3 impact.drop=2 impact.velocity=0.03", "or drop=0"),
        ("impact.gravity=1e-3 impact.velocity=0.05 impact.gap=0.3", "write auto"),
        ("impact.gravity=1e-6", "4e\\+04 R/c, of the paper's disk some 2.4 million"),
        ("impact.gravity=0.1", "write at most 0.002, or a higher velocity"),
        ("impact.gravity=1e-3 impact.drop=0.01", "a drop only a higher drop helps"),
    ],
)
def test_what_cannot_be_meant_is_refused(keys, text):
    with pytest.raises(InputError, match=text):
        load_scene("exponential_wall", keys.split())


@pytest.mark.parametrize(
    "keys", ["impact.angle=0.3", "impact.spin=0.1", "wall.friction=0.2"]
)
def test_only_round_disks_bounce_straight_down(keys):
    with pytest.raises(InputError, match="only round bodies bounce"):
        run(load_scene(FALL[0], [*FALL[1:], keys]), lattices=1)
