"""Impacts at an angle, with spin and friction: impulse, torque, other programs."""

import re
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from bodies import advance, computed
from numpy.testing import assert_allclose, assert_array_equal

from taichi_disk.experiments.computation.diagnostics import (
    energy_gained,
    summary,
    warnings,
)
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.integrators import VELOCITY_VERLET
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.simulation.observables import INDEX, split

SMALL = ("lattice.points=60", "material.eta_star=0", "impact.velocity=0.05")
SLIDING = (*SMALL, "impact.angle=1.2", "wall.friction=0.1")
STICKING = (*SMALL, "impact.angle=0.3", "wall.friction=0.5", "impact.spin=0.02")
ROWS = ("time.sample_interval=1e-6",)  # a row for each step


def impact(kernels, *settings):
    """Return scenario, outcome and results of a throw at the rigid wall."""
    throw = ("exponential_wall", *settings)
    scenario, outcome = computed(kernels, *throw, estimate=False)
    return scenario, outcome, scenario.result(outcome.series)


def inertia(scenario):
    """Return the moment of inertia of the unloaded disk about its centre [M R^2]."""
    x = scenario.lattice.positions
    return np.mean(np.sum((x - x.mean(axis=0)) ** 2, axis=1))


def test_a_disk_that_slides_takes_mu_times_the_normal_impulse(kernels):
    _, outcome, found = impact(kernels, *SLIDING, "material.eta_star=100")
    assert found["tangential_impulse"] == pytest.approx(
        -0.1 * found["normal_impulse"], rel=1e-12
    )
    # dashpots are explicit, however strong, if there is friction
    assert outcome.summary["integrator"] == "velocity_verlet"
    assert abs(outcome.summary["energy"]["closing_imbalance"]) < 1e-4


@pytest.mark.parametrize("throw", [SLIDING, STICKING], ids=["slides", "sticks"])
def test_spin_and_sideways_velocity_change_by_just_what_the_wall_does(throw, kernels):
    # Compute the wall's force from the motion alone: spring forces cancel and have no
    # torque, so the sum of m a is the wall's force, and its torque about the centre
    # changes the angular momentum. (The half force of the first step is negligible.)
    scenario, outcome, found = impact(kernels, *throw, *ROWS, "impact.gap=0.11")
    columns = outcome.series
    h = outcome.summary["dt"]
    wall = scenario.model.wall
    torque = 0.0
    push = 0.0
    for _, x, v in outcome.replay(columns["t"]):
        normal = wall.a * wall.V0 * np.exp(-wall.a * x[:, 1])
        _, both = wall.contact_forces(scenario.lattice, x, v, scenario.model.springs)
        tangential = np.zeros_like(normal)
        tangential[x[:, 1] < wall.reach] = both[:, 0]
        arm = x - x.mean(axis=0)
        torque += h * np.sum(arm[:, 0] * normal - arm[:, 1] * tangential)
        push += h * tangential.sum()
    change = columns["angular_momentum"][-1] - columns["angular_momentum"][0]
    # NumPy cannot know when within a step a point begins or ceases to stick.
    allowed = 1e-12 if throw is SLIDING else 2e-3 * abs(change)
    assert change == pytest.approx(torque, abs=allowed)
    assert found["tangential_impulse"] == pytest.approx(push, abs=allowed)
    assert abs(push) > 1e-3
    assert found["spin_after"] - scenario.scene.impact.spin == pytest.approx(
        change / inertia(scenario), rel=1e-9
    )


def test_every_point_obeys_coulomb_at_every_step(kernels):
    # The force on a pushed point minus springs and normal force is friction: mu times
    # the normal force against the next velocity, or less if that velocity is 0.
    mu = 0.5
    h = 0.01
    slid = 0
    stuck = 0
    masses = np.random.default_rng(2).uniform(0.5, 2.0, 60)
    body = Lattice.from_points(Lattice.disk(60).positions, masses=masses)
    scenario = load_scene("exponential_wall", STICKING).scenario(body)
    lattice = scenario.lattice
    model = scenario.model
    simulation = kernels.simulation(
        lattice, model, VELOCITY_VERLET, scenario.velocities, h
    )
    for _ in range(900):
        simulation.advance(1)
        x, v, f = simulation.snapshot().vectors
        others = model.springs.forces(lattice, x)[:, 0]
        friction = f[:, 0] - others
        coming = v[:, 0] + h / lattice.masses * f[:, 0]
        most = mu * model.wall.forces(lattice, x)[:, 1]
        assert (np.abs(friction) <= most * (1 + 1e-9) + 1e-13).all()
        pushed = most > 1e-8
        moving = pushed & (np.abs(coming) > 1e-14)
        sliding = -most * np.sign(coming)
        assert_allclose(friction[moving], sliding[moving], rtol=1e-6, atol=1e-12)
        slid += int(moving.sum())
        stuck += int((pushed & ~moving).sum())
    assert min(slid, stuck) > 50
    assert simulation.now[INDEX["com_vy"]] > 0.0


def test_a_throw_and_its_mirror_image_are_mirror_images(kernels):
    scene = load_scene("exponential_wall", [*STICKING, "material.eta_star=10"])
    body = scene.body()
    mirrored = replace(
        body,
        positions=body.positions * [-1.0, 1.0],
        triangles=body.triangles[:, ::-1].copy(),
    )
    other = scene.with_(
        {"impact.angle": -scene.impact.angle, "impact.spin": -scene.impact.spin}
    )
    runs = []
    for case, lattice in ((scene, body), (other, mirrored)):
        scenario = case.scenario(lattice)
        runs.append(compute(scenario, estimate=False))
    assert_array_equal(runs[0].positions * [-1.0, 1.0], runs[1].positions)
    assert runs[0].series["com_vx"][-1] != 0.0


def test_a_run_with_e_above_1_says_which_energy_became_flight(kernels):
    # the rim is not exactly centred at the centre of mass
    throw = (*SMALL, "lattice.points=150")
    scenario, outcome, found = impact(kernels, *throw, "impact.spin=0.3")
    assert found["restitution"] > 1.01
    assert "tangential_impulse" not in found  # 0 without friction
    (text,) = outcome.summary["warnings"]
    rotation = inertia(scenario) * (0.3**2 - found["spin_after"] ** 2) / 0.05**2
    assert text.startswith("e exceeds one")
    gained = outcome.summary["gained_from"]
    assert gained.startswith(f"{rotation:+.3g} from spin, +0 from flight along")
    assert gained in text and "with a smaller spin" in text
    _, outcome, found = impact(kernels, *throw)
    assert found["restitution"] < 1.0
    assert not outcome.summary["warnings"]
    assert "gained_from" not in outcome.summary


# 2e-4 of a slow throw along a soft wall become flight.
SLOW = (
    *("exponential_wall", "lattice.points=60", "material.eta_star=0"),
    *("impact.velocity=0.01", "impact.angle=0.8766", "wall.friction=0.1895"),
    *("wall.a=0.4008", "wall.V0=1.884e-10"),
)


def test_a_gain_of_e_is_compared_with_its_error_and_is_the_sum_of_its_parts(kernels):
    dashpots = "material.eta_star=0.001"
    scenario, outcome = computed(kernels, *SLOW, dashpots, estimate=False)
    assert not energy_gained(scenario, outcome.series, 1e-3)
    gained = energy_gained(scenario, outcome.series, 1e-4)
    _, e = scenario.primary(outcome.series)
    assert sum(gained.values()) == pytest.approx(e**2 - 1.0, rel=1e-5)
    assert gained["friction"] < -0.5 and -0.01 < gained["dashpots"] < -1e-3


def test_vibration_at_the_start_may_become_flight(kernels):
    settings = ("lattice.points=40", "material.eta_star=0", "impact.velocity=0.005")
    scenario = load_scene("exponential_wall", settings).scenario()
    v = 0.05 * np.random.default_rng(0).standard_normal((40, 2))
    v -= v.mean(axis=0) + [0.0, 0.005]
    outcome = compute(replace(scenario, velocities=v))
    gained = energy_gained(outcome.scenario, outcome.series, None)
    assert gained["vibration"] > 0.01
    # e counts the small potential of the wall at both ends, too
    _, e = outcome.scenario.primary(outcome.series)
    assert sum(gained.values()) == pytest.approx(e**2 - 1.0, rel=3e-3)


THROWS = list(product((0.2, 0.6, 1.0, 1.3), (0.1, 0.3, 0.8), (0.0, 0.03)))


@pytest.mark.parametrize(
    "throws",
    [THROWS[2:11:4], pytest.param(THROWS, marks=pytest.mark.validate)],
    ids=["3", "all"],
)
def test_where_points_stick_errors_fall_as_the_square_of_the_step(throws, kernels):
    # Compared with 1/32 of the first step, 0.016 R/c. The time when a point begins to
    # stick is known to within a step, so errors of a single throw fall in jumps. The
    # geometric mean over 24 throws falls with the power 1.85.
    scene = load_scene("exponential_wall", ["lattice.points=150"])
    end = 12.8
    errors = []
    imbalance = []
    for angle, mu, spin in throws:
        keys = {"impact.angle": angle, "impact.spin": spin, "wall.friction": mu}
        scenario = scene.with_({**keys, "material.eta_star": 0}).scenario()
        start = (scenario.lattice, scenario.model, VELOCITY_VERLET, scenario.velocities)
        found = []
        for count in (800, 1600, 3200, 25_600):
            simulation = kernels.simulation(*start, end / count)
            columns = advance(simulation, count, count // 200)
            names = ("com_vx", "com_vy", "angular_momentum")
            found.append([columns[name][-1] for name in names])
            imbalance.append(np.ptp(columns["total"]) / columns["kinetic"][0])
            # friction returns no energy
            assert (np.diff(columns["friction"]) > -1e-12).all()
        errors.append(np.abs(np.array(found[:-1]) - found[-1]).max(axis=1))
    means = np.exp(np.log(errors).mean(axis=0))
    assert 1.6 < 0.5 * np.log2(means[0] / means[2]) < 2.4
    assert means[0] < 1e-7
    assert np.max(errors) < 1e-6
    assert np.max(imbalance[0::4]) < 3e-4
    assert np.max(imbalance[2::4]) < 0.1 * np.max(imbalance[0::4])


def test_a_slow_throw_is_that_of_a_rigid_disk(kernels):
    # On a wall that is softer than the disk the contact lasts long. What sticks then
    # rolls: the impulse that stops the lowest point, v_t + omega R = 0, is -(v_t +
    # omega R)/(1/M + R^2/I) (Stronge, Impact Mechanics, 2000, planar impact). I is
    # .525, for many points lie on the rim. The lattice's scatter is 2 per cent.
    slow = ("material.eta_star=0", "material.k_a=10", "impact.velocity=0.005")
    scenario, _, found = impact(kernels, *slow, "impact.angle=0.3", "wall.friction=1")
    along = 0.005 * np.sin(0.3)
    sticking = -along / (1.0 + 1.0 / inertia(scenario))
    assert found["tangential_impulse"] == pytest.approx(sticking, rel=0.03)
    assert found["spin_after"] == pytest.approx(sticking / inertia(scenario), rel=0.03)
    assert found["tangential_restitution"] == pytest.approx(0.0, abs=0.02)
    # A disk that slides throughout has the spin mu J_n R/I.
    _, _, found = impact(kernels, *slow, "impact.angle=1.2", "wall.friction=0.1")
    normal = 2.0 * 0.005 * np.cos(1.2)
    assert found["tangential_impulse"] == pytest.approx(-0.1 * normal, rel=1e-3)
    assert found["spin_after"] == pytest.approx(
        -0.1 * normal / inertia(scenario), rel=0.03
    )


@pytest.mark.parametrize("angle", [0.9, -0.9])
def test_a_disk_flying_sideways_meets_the_middle_of_an_elastic_wall(angle, kernels):
    wall = ("wall.points=160", "wall.width=4", "wall.boundary=pinned")
    thrown = ("lattice.points=100", "impact.gap=1", f"impact.angle={angle}")
    scenario, outcome = computed(
        kernels, "absorbing_wall", *wall, *thrown, estimate=False
    )
    columns = outcome.series
    found = scenario.result(outcome.series)
    first = int(np.argmax(columns["wall_force"] > 0.01 * columns["wall_force"].max()))
    assert abs(columns["com_x"][first]) < 0.11
    assert abs(columns["com_x"][0]) > 1.2
    # The wall is level and has no friction, so only its dent pushes sideways.
    assert 0.0 < abs(found["tangential_impulse"]) < 0.02 * found["normal_impulse"]
    assert found["normal_impulse"] == pytest.approx(
        (1.0 + found["restitution"]) * 0.02 * np.cos(0.9), rel=1e-12
    )
    assert abs(outcome.summary["energy"]["closing_imbalance"]) < 1e-4


def test_on_an_elastic_wall_a_disk_may_start_anywhere(kernels):
    keys = ["lattice.points=60", "wall.points=100", "impact.offset=-0.4"]
    scene = load_scene("absorbing_wall", keys)
    scenario = scene.scenario()
    plain = scene.with_({"impact.offset": "auto"}).scenario()
    moved = scenario.lattice.positions[:60] - plain.lattice.positions[:60]
    assert_allclose(moved, np.tile([-0.4, 0.0], (60, 1)))
    assert_array_equal(scenario.lattice.positions[60:], plain.lattice.positions[60:])


@pytest.mark.validate
def test_the_stiffer_an_elastic_wall_the_nearer_it_is_to_the_rigid_one(kernels):
    # Kernels, contact and lattice differ; the difference of the results falls as 1/k_a.
    thrown = (*SMALL, "impact.angle=0.7", "impact.spin=0.03")
    _, _, rigid = impact(kernels, *thrown)
    wall = ("wall.points=100", "wall.width=3.4", "wall.boundary=pinned")
    off = []
    sideways = []
    for k_a in (100, 1000):
        own = (*thrown, *wall, f"wall.k_a={k_a}")
        scenario, outcome = computed(kernels, "absorbing_wall", *own, estimate=False)
        found = scenario.result(outcome.series)
        names = ("restitution", "spin_after")
        off.append([abs(found[name] - rigid[name]) for name in names])
        sideways.append(found["tangential_impulse"])
    assert all(8.0 < before / after < 15.0 for before, after in zip(*off, strict=True))
    assert off[1][0] < 1e-4
    assert sideways[0] / sideways[1] == pytest.approx(10.0, rel=0.1)


def test_springs_of_the_elastic_wall_have_a_stiffness_of_their_own():
    few = ["lattice.points=60", "wall.points=100", "material.k_a=2"]
    soft, same, equal = (
        load_scene("absorbing_wall", [*few, *more]).body()
        for more in (["wall.k_a=0.5"], [], ["wall.k_a=2"])
    )
    of_wall = soft.bonds[:, 0] >= 60
    assert same.stiffness is equal.stiffness is None
    assert_array_equal(soft.stiffness, np.where(of_wall, 0.25, 1.0))


def test_results_along_the_wall_do_not_depend_on_how_far_from_it_the_run_ends(kernels):
    # Dashpots brake the rotation of a free disk as long as the run lasts.
    throw = ("lattice.points=100", "material.eta_star=2", "impact.angle=0.8")
    throw += ("wall.friction=0.3", "impact.velocity=0.05")
    found = []
    for gap in ("auto", 0.1, 0.3, 1.0):
        scenario, outcome, numbers = impact(kernels, *throw, f"impact.gap={gap}")
        columns = split(outcome.series, scenario.lattice.inertia)
        left = summary(scenario, columns)["vibration_left"]
        found.append([numbers["spin_after"], numbers["tangential_restitution"], left])
        texts = warnings(scenario, outcome.series)
        (text,) = (text for text in texts if "after the contact" in text)
        assert "axial" in text
    assert_allclose(found, 4 * [found[-1]], rtol=2e-3, atol=1e-5)


@pytest.mark.parametrize(
    ("eta_star", "dashpot", "spin", "is_warned"),
    [
        (0.002, "vector", 0.05, False),
        (0.02, "vector", 0.05, True),
        (0.02, "axial", 0.05, False),
        # the wall turns a disk that hardly spins
        (0, "vector", 1e-6, False),
        (0.002, "vector", 1e-6, False),
    ],
)
def test_a_warning_names_the_spin_that_dashpots_took(
    eta_star, dashpot, spin, is_warned, kernels
):
    spinning = (*SMALL, f"impact.spin={spin}", "impact.gap=0.2")
    dashpots = (f"material.eta_star={eta_star}", f"material.dashpot={dashpot}")
    scenario, outcome, _ = impact(kernels, *spinning, *dashpots)
    texts = warnings(scenario, outcome.series)
    found = [text for text in texts if "angular momentum" in text]
    assert len(found) == is_warned
    assert not is_warned or re.search(
        "took 2% .* before the contact and 2% .* after the contact.*axial", found[0]
    )
