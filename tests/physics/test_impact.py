"""Impacts as scenes: start, end, and results of an independent solver."""

from dataclasses import replace

import numpy as np
import pytest
import reference
from bodies import SMALL, WALL, advance, computed
from numpy.testing import assert_array_equal

from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.integrators import INTEGRATORS

LONG = pytest.mark.validate
# a corner of it hits again
TURNING = ("lattice.points=5", "lattice.seed=2", "impact.turn=0.51")


def reference_impact(scenario, end):
    """Return e at `end` and the contact time by DOP853 on the same lattice."""
    model = reference.Model(scenario.lattice, scenario.model)
    t = np.linspace(0.0, end, 4001)
    states = model.solve(scenario.lattice.positions, scenario.velocities, t, rtol=1e-8)
    force = np.exp(-model.a * states[:, 0, :, 1]).sum(axis=1)  # over a V0
    inside = t[force >= 0.01 * force.max()]
    # 1e-7 of the kinetic energy
    wall = scenario.model.wall.energy(scenario.lattice, scenario.lattice.positions)
    # the speed that it had without the wall
    far = np.sqrt(scenario.velocity**2 + 2.0 * wall)
    return states[-1, 1, :, 1].mean() / far, inside[-1] - inside[0]


@pytest.mark.parametrize(
    ("eta_star", "velocity"),
    [
        (10.0, 0.02),
        pytest.param(0.0, 0.05, marks=LONG),
        pytest.param(100.0, 0.02, marks=LONG),
    ],
)
def test_restitution_and_contact_time_are_those_of_dop853(eta_star, velocity, kernels):
    thrown = (f"material.eta_star={eta_star}", f"impact.velocity={velocity}")
    settings = (*SMALL, *thrown, "time.sample_interval=0.02")
    scenario, outcome = computed(kernels, "exponential_wall", *settings)
    values = scenario.result(outcome.series)
    end = outcome.series["t"][-1]
    # until the wall's last potential is energy of the flight
    end += 8.0 / (scenario.model.wall.a * velocity)
    e, duration = reference_impact(scenario, end)
    # The error of 1099 points at the automatic step is below 2e-5, as its estimate.
    off = abs(values["restitution"] - e)
    assert off < 2e-5
    assert off <= 1.5 * outcome.summary["error_estimate"]["restitution"] < 5e-5
    # The times of the reference have a resolution of 1/4000 of the run.
    assert values["contact_time"] == pytest.approx(duration, abs=2 * end / 4000)
    assert values["restitution"] == pytest.approx(
        outcome.series["com_vy"][-1] / velocity, abs=1e-5
    )


def test_a_viscosity_is_that_of_the_body_and_eta_star_that_of_a_point(kernels):
    def thrown(points, **keys):
        """Return e of three lattices."""
        scenes = (
            load_scene("exponential_wall").with_(points=points, seed=seed, **keys)
            for seed in range(3)
        )
        runs = [compute(scene.scenario(), estimate=False) for scene in scenes]
        return np.array([run.series["com_vy"][-1] for run in runs]) / 0.02

    few = thrown(300, viscosity=0.01)
    many = thrown(1000, viscosity=0.01)
    scatter = few.std(ddof=1)
    assert abs(few.mean() - many.mean()) < 3.0 * scatter < 0.01
    assert_array_equal(thrown(300, eta_star=3.0), few)  # eta_star/N, bit for bit
    assert thrown(300, eta_star=10.0).mean() < many.mean() - 20.0 * scatter


@pytest.mark.validate
@pytest.mark.parametrize("points", [30, 60])
def test_an_automatic_step_resolves_the_vibrations_excited_by_resets_with_dashpots(
    points, kernels
):
    small = (f"lattice.points={points}", f"wall.points={points + 10}", "wall.width=3.4")
    small += ("impact.velocity=0.05", "wall.reset_interval=0.02")

    def thrown(*own, **options):
        scenario, outcome = computed(kernels, "absorbing_wall", *small, *own, **options)
        return scenario, outcome, scenario.result(outcome.series)["restitution"]

    def assert_within(error, outcome):
        assert error < 3e-5
        assert error <= outcome.summary["error_estimate"]["restitution"] < 6e-5

    explicit = ("material.eta_star=10", "time.integrator=velocity_verlet")
    scenario, outcome, found = thrown(*explicit)
    model = reference.Model(scenario.lattice, scenario.model)
    start = (scenario.lattice.positions, scenario.velocities)
    end = outcome.series["t"][-1]
    _, v = model.solve_with_resets(*start, end, 0.02, rtol=1e-8)
    assert_within(abs(found - v[:points, 1].mean() / scenario.velocity), outcome)
    # The energy balance, whose kicks a reset halves, asks for no shorter step.
    assert outcome.summary["attempts"] == 1

    # compare with the other integrator, at a tenth of the step that dashpots allow
    strong = "material.eta_star=100"
    _, outcome, found = thrown(strong, "time.integrator=trapezoidal")
    _, _, e = thrown(strong, explicit[1], "time.dt=1e-4", estimate=False)
    assert_within(abs(found - e), outcome)


HARD = ("impact.velocity=3e-3", "wall.a=3000", "wall.V0=7")
FAST = ("material.eta_star=0", "impact.velocity=0.05")


@pytest.mark.parametrize(
    "scene",
    [
        ("exponential_wall", *SMALL, *HARD),
        ("absorbing_wall", *WALL, "impact.velocity=0.05"),
    ],
    ids=lambda scene: scene[0],
)
def test_the_disk_starts_out_of_the_walls_reach(scene):
    # The wall's potential at the start is below 1e-7 of the kinetic energy, but not far
    # below: the way is short.
    name, *settings = scene
    scenario = load_scene(name, settings).scenario()
    lattice = scenario.lattice
    v = scenario.velocities
    n = lattice.disk_points
    kinetic = 0.5 * lattice.masses[0] * np.sum(v**2)
    assert (v[:n] == [0.0, -scenario.velocity]).all()
    assert not v[n:].any()
    assert kinetic == pytest.approx(0.5 * scenario.velocity**2)
    height = lattice.positions[:n, 1]
    assert height.min() == pytest.approx(scenario.gap, rel=1e-12)
    if name == "absorbing_wall":
        height = lattice.positions[lattice.disk_surface, 1]
    wall = scenario.model.wall
    potential = np.sum(wall.V0 * np.exp(-wall.a * height))
    assert 0.5e-7 * kinetic < potential < 1.0000001e-7 * kinetic


@pytest.mark.parametrize(
    "scene",
    [
        ("exponential_wall", *SMALL, *FAST),
        pytest.param(("exponential_wall", *TURNING, *FAST, "wall.a=1000"), marks=LONG),
        pytest.param(("absorbing_wall", *WALL), marks=LONG),
        pytest.param(("absorbing_wall", *WALL, "wall.boundary=pinned"), marks=LONG),
    ],
    ids=" ".join,
)
def test_when_it_ends_the_disk_has_left_for_good(scene, kernels):
    # (Without dashpots the disk goes on vibrating, which is the hard case.)
    assert_has_left(kernels, *scene)


def test_the_time_limit_allows_ten_contacts_with_a_soft_wall():
    keys = {"lattice.points": 60, "wall.points": 80, "wall.k_a": 1e-4}
    scenario = load_scene("absorbing_wall").with_(keys).scenario()
    # half a period of a mass M on the softer spring constant
    ten_contacts = 10.0 * np.pi * np.sqrt(1.0 / 1e-4)
    flight = 22.0 * (scenario.gap + scenario.shape.outline_depth) / 0.02
    assert scenario.max_time == pytest.approx(ten_contacts + flight, rel=1e-12)


def test_the_film_of_a_narrow_wall_shows_the_whole_disk():
    keys = {"wall.width": 1.0, "wall.points": 80, "lattice.points": 60}
    view = load_scene("absorbing_wall").with_(keys).scenario().view
    assert view[:2] == pytest.approx((-1.15, 1.15))


def time_to_end(scenario, **values):
    """Return the time [R/c] that a run goes on for, by its last row."""
    columns = {name: np.array([value]) for name, value in values.items()}
    return scenario.time_to_end(columns | {"com_vx": [0.0], "elastic": [0.0]})


def test_a_soft_disk_that_vibrates_must_rise_by_its_amplitude():
    keys = {"material.k_a": 1e-2, "lattice.points": 60}
    scenario = load_scene("exponential_wall").with_(keys).scenario()
    vibration = 2e-6
    amplitude = np.sqrt(2.0 * vibration / 1e-2)
    row = {"com_vy": 0.01, "com_y": 2.0, "angular_momentum": 0.0}
    row |= {"kinetic": 0.5e-4 + vibration, "lowest_y": scenario.gap}
    assert time_to_end(scenario, **row) == pytest.approx(amplitude / 0.01)


def test_a_body_that_turns_fast_ends_no_sooner_than_its_corners_are_clear():
    keys = [*TURNING, "material.eta_star=0"]
    scenario = load_scene("exponential_wall", keys).scenario()
    masses = scenario.lattice.masses
    arm = scenario.lattice.positions - masses @ scenario.lattice.positions
    radius = np.hypot(*arm.T).max()
    inertia = masses @ (arm**2).sum(axis=1)
    speed = 0.01
    row = {"com_vy": speed, "com_y": scenario.gap + radius - 0.1}
    row |= {"lowest_y": scenario.gap + 0.1}
    for spin in (0.0, 1.0, -1.0):
        row["angular_momentum"] = inertia * spin
        row["kinetic"] = 0.5 * (speed**2 + inertia * spin**2)
        assert (time_to_end(scenario, **row) == 0.0) == (spin == 0.0)


def test_when_it_ends_a_rod_that_bends_has_left_for_good(tmp_path, kernels):
    # Its end bends down seven times as far as the rim of a disk with the same energy.
    x, y = np.meshgrid(np.linspace(-1.5, 1.5, 31), np.linspace(-0.15, 0.15, 4))
    rod = np.stack([x, y], axis=-1).reshape(-1, 2)
    np.savetxt(tmp_path / "rod.csv", rod, delimiter=",")
    settings = (f"lattice.file={tmp_path / 'rod.csv'}", "material.eta_star=0")
    assert_has_left(kernels, "exponential_wall", *settings, "impact.turn=0.2")


def assert_has_left(kernels, name, *settings):
    """Run on as long again: the disk touches no wall and keeps its speed."""
    scenario, outcome = computed(kernels, name, *settings)
    columns = outcome.series
    steps = outcome.summary["steps"]
    integrator = INTEGRATORS[outcome.summary["integrator"]]
    end = replace(scenario.lattice, positions=outcome.positions)
    simulation = kernels.simulation(
        end, scenario.model, integrator, outcome.velocities, outcome.summary["dt"]
    )
    later = advance(simulation, steps, max(1, steps // 2000))
    assert (
        later["wall_force"].max()
        < 1.01 * columns["wall_force"][-1] + 1e-5 * columns["wall_force"].max()
    )
    assert later["wall_force"][-1] < 1e-7 * columns["wall_force"].max()
    assert columns["com_vy"][-1] > 0.0
    left = scenario.end_truncation_error(columns)
    # far from the wall
    before = np.sqrt(scenario.velocity**2 + 2.0 * columns["wall"][0])
    assert later["com_vy"][-1] / before == pytest.approx(
        scenario.result(columns)["restitution"], abs=left + 1e-9
    )
