"""Impacts as scenes: start, end, and restitution and contact time compared with an
independent solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import reference
from bodies import SMALL, WALL, advance, computed
from numpy.testing import assert_array_equal

from taichi_disk.computation.contact import contact_interval
from taichi_disk.computation.outcome import compute
from taichi_disk.integrators import INTEGRATORS, TRAPEZOIDAL, VELOCITY_VERLET
from taichi_disk.lattice import Lattice, OwnStart, bulk_moduli
from taichi_disk.scenes import load_scene

LONG = pytest.mark.validate
# a corner of it hits again
TURNING = ("lattice.points=5", "lattice.seed=2", "impact.turn=0.51")


def reference_impact(scenario, end):
    """Return e at `end` and the contact time by DOP853 on the same lattice, with 4000
    samples of the wall's force."""
    model = reference.Model(scenario.lattice, scenario.model)
    t = np.linspace(0.0, end, 4001)
    states = model.solve(scenario.lattice.positions, scenario.velocities, t, rtol=1e-10)
    force = np.array([model.wall_force(x)[:, 1].sum() for x, _ in states])
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
        pytest.param(0.0, 3e-3, marks=LONG),
        pytest.param(0.0, 0.05, marks=LONG),
        pytest.param(100.0, 0.02, marks=LONG),
    ],
)
def test_restitution_and_contact_time_equal_those_of_dop853(
    eta_star, velocity, kernels
):
    settings = (
        *SMALL,
        f"material.eta_star={eta_star}",
        f"impact.velocity={velocity}",
        "time.sample_interval=0.02",
    )
    scenario, outcome = computed(kernels, "exponential_wall", *settings)
    values = scenario.result(outcome.series)
    end = outcome.series["t"][-1]
    # until the wall's last potential is energy of the flight
    end += 8.0 / (scenario.model.wall.a * velocity)
    e, duration = reference_impact(scenario, end)
    # The error of 1099 points at the automatic step is below 2e-5, and so is its
    # estimate.
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

    eta = {"viscosity": 10.0 / 1099}
    few = thrown(300, **eta)
    many = thrown(1099, **eta)
    scatter = few.std(ddof=1)
    assert abs(few.mean() - many.mean()) < 3.0 * scatter < 0.01
    assert_array_equal(thrown(1099, eta_star=10.0), many)  # eta_star/N, bit for bit
    assert thrown(300, eta_star=10.0).mean() < many.mean() - 20.0 * scatter


def reset_impact(kernels, points, *settings):
    small = (
        f"lattice.points={points}",
        f"wall.points={points + 10}",
        "wall.width=3.4",
        "impact.velocity=0.05",
    )
    scenario, outcome = computed(
        kernels, "absorbing_wall", *small, "wall.reset_interval=0.02", *settings
    )
    return scenario, outcome, scenario.result(outcome.series)["restitution"]


@pytest.mark.validate
@pytest.mark.parametrize("points", [30, 60])
def test_an_automatic_step_resolves_the_vibrations_excited_by_resets_with_dashpots(
    points, kernels
):
    for eta_star, integrator in ((10.0, VELOCITY_VERLET), (100.0, TRAPEZOIDAL)):
        own = (f"material.eta_star={eta_star}", f"time.integrator={integrator.name}")
        scenario, outcome, found = reset_impact(kernels, points, *own)
        if integrator is VELOCITY_VERLET:
            model = reference.Model(scenario.lattice, scenario.model)
            start = scenario.lattice.positions
            end = outcome.series["t"][-1]
            _, v = model.solve_with_resets(
                start, scenario.velocities, end, 0.02, rtol=1e-8
            )
            e = v[:points, 1].mean() / scenario.velocity
            # The energy balance, with kicks that a reset cuts in half, does not require
            # a shorter step.
            assert outcome.summary["attempts"] == 1
        # compare with the other integrator at a tenth of the step that strong dashpots
        # allow
        else:
            explicit = (own[0], "time.integrator=velocity_verlet", "time.dt=1e-4")
            e = reset_impact(kernels, points, *explicit)[2]
        assert abs(found - e) < 3e-5
        assert abs(found - e) <= outcome.summary["error_estimate"]["restitution"] < 6e-5


@pytest.mark.validate
def test_a_spin_that_strong_dashpots_damp_is_no_blow_up_and_e_is_that_of_dop853(
    kernels,
):
    settings = (
        "lattice.points=20",
        "material.eta_star=40",
        "impact.spin=0.5",
        "impact.velocity=0.02",
    )
    scenario, outcome = computed(kernels, "exponential_wall", *settings)
    e, _ = reference_impact(scenario, outcome.series["t"][-1])
    error = outcome.summary["error_estimate"]["restitution"]
    assert abs(scenario.result(outcome.series)["restitution"] - e) < error < 1e-4
    assert outcome.summary["energy"]["scale"] == pytest.approx(
        0.5 * (scenario.velocities**2).sum() / 20, rel=1e-12
    )


def test_custom_velocities_give_the_run_of_a_scene_with_their_speed(kernels):
    fast = load_scene("exponential_wall", ["lattice.points=40", "impact.velocity=0.5"])
    scene = fast.scenario()
    own = fast.with_(velocity=0.01).scenario(
        own=OwnStart(None, scene.velocities.copy())
    )
    columns = [compute(case, estimate=False).series for case in (own, scene)]
    assert own.result(columns[0]) == scene.result(columns[1])
    assert_array_equal(columns[0]["wall_force"], columns[1]["wall_force"])


@pytest.mark.validate
def test_a_spinning_custom_body_bounces_as_in_dop853(kernels):
    # A round piece of a hexagonal lattice; two springs are too long for their place, so
    # it starts strained.
    i, j = np.meshgrid(np.arange(-4, 5), np.arange(-4, 5), indexing="ij")
    points = 0.3 * np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=-1).reshape(-1, 2)
    plain = Lattice.from_points(points[np.hypot(*points.T) < 1.0])
    rest = plain.rest_lengths.copy()
    rest[[3, 20]] *= 1.02
    settings = [
        "material.eta_star=0",
        "impact.velocity=0.05",
        "impact.spin=0.05",
        "impact.turn=0.3",
    ]
    # It vibrates from the start, also in its highest modes, so the step is 3 % of the
    # limit: phase error 1e-4 per period.
    scene = load_scene("exponential_wall", [*settings, "time.safety=0.03"])
    scenario = scene.scenario(Lattice.from_points(plain.positions, plain.bonds, rest))
    assert np.ptp(scenario.lattice.rest_lengths) > 0.005
    columns = compute(scenario, estimate=False).series
    e, _ = reference_impact(scenario, columns["t"][-1])
    assert scenario.result(columns)["restitution"] == pytest.approx(e, abs=1e-5)
    assert np.ptp(columns["angular_momentum"]) > 1e-4


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        (
            "exponential_wall",
            (*SMALL, "impact.velocity=3e-3", "wall.a=3000", "wall.V0=7"),
        ),
        ("absorbing_wall", (*WALL, "impact.velocity=0.05")),
    ],
)
def test_the_disk_starts_out_of_the_walls_reach(name, settings):
    # The wall's potential at the start is below 1e-7 of the kinetic energy, but not far
    # below: the way is short.
    scenario = load_scene(name, settings).scenario()
    x = scenario.lattice.positions
    v = scenario.velocities
    wall = scenario.model.wall
    n = scenario.lattice.disk_points
    kinetic = 0.5 * scenario.lattice.masses[0] * np.sum(v**2)
    assert (v[:n] == [0.0, -scenario.velocity]).all()
    assert not v[n:].any()
    assert kinetic == pytest.approx(0.5 * scenario.velocity**2)
    height = (
        x[:n, 1] if name == "exponential_wall" else x[scenario.lattice.disk_surface, 1]
    )
    potential = np.sum(wall.V0 * np.exp(-wall.a * height))
    assert 0.5e-7 * kinetic < potential < 1.0000001e-7 * kinetic
    assert x[:n, 1].min() == pytest.approx(scenario.gap, rel=1e-12)


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("exponential_wall", (*SMALL, "material.eta_star=0", "impact.velocity=0.05")),
        pytest.param(
            "exponential_wall",
            (*TURNING, "material.eta_star=0", "impact.velocity=0.05", "wall.a=1000"),
            marks=LONG,
        ),
        pytest.param("absorbing_wall", WALL, marks=LONG),
        pytest.param("absorbing_wall", (*WALL, "wall.boundary=pinned"), marks=LONG),
    ],
)
def test_when_it_ends_the_disk_has_left_for_good(name, settings, kernels):
    # (Without dashpots the disk goes on vibrating, which is the hard case.)
    assert_has_left(kernels, name, *settings)


def test_the_time_limit_allows_ten_contacts_with_a_soft_wall():
    keys = {"lattice.points": 60, "wall.points": 80, "wall.k_a": 1e-4}
    scenario = load_scene("absorbing_wall").with_(keys).scenario()
    # half a period of a mass M on the softer spring constant
    ten_contacts = 10.0 * np.pi * np.sqrt(1.0 / 1e-4)
    flight = 22.0 * (scenario.gap + scenario.shape.outline_depth) / 0.02
    assert scenario.max_time == pytest.approx(ten_contacts + flight, rel=1e-12)


def test_a_soft_disk_that_vibrates_must_rise_by_its_amplitude():
    scene = load_scene("exponential_wall").with_({"material.k_a": 1e-2})
    scenario = scene.with_({"lattice.points": 60}).scenario()
    vibration = 2e-6
    row = {"com_vx": 0.0, "com_vy": 0.01, "com_y": 2.0, "angular_momentum": 0.0}
    row |= {"kinetic": 0.5e-4 + vibration, "elastic": 0.0, "lowest_y": scenario.gap}
    columns = {name: np.array([value]) for name, value in row.items()}
    amplitude = np.sqrt(2.0 * vibration / 1e-2)
    assert scenario.time_to_end(columns) == pytest.approx(amplitude / 0.01)


def test_a_body_that_turns_fast_ends_no_sooner_than_its_corners_are_clear():
    scenario = load_scene(
        "exponential_wall", [*TURNING, "material.eta_star=0"]
    ).scenario()
    x = scenario.lattice.positions
    masses = scenario.lattice.masses
    arm = x - masses @ x
    radius = np.hypot(*arm.T).max()
    inertia = masses @ (arm**2).sum(axis=1)
    height = scenario.gap + 0.1
    speed = 0.01
    for spin in (0.0, 1.0, -1.0):
        energy = 0.5 * (speed**2 + inertia * spin**2)
        row = {
            "com_vx": 0.0,
            "com_vy": speed,
            "com_y": scenario.gap + radius - 0.1,
            "lowest_y": height,
        }
        row |= {"angular_momentum": inertia * spin, "kinetic": energy, "elastic": 0.0}
        columns = {name: np.array([value]) for name, value in row.items()}
        assert (scenario.time_to_end(columns) == 0.0) == (spin == 0.0)


def test_when_it_ends_a_rod_that_bends_has_left_for_good(tmp_path, kernels):
    # Its end bends down seven times as far as the rim of a disk with the same energy.
    rod = np.stack(
        np.meshgrid(np.linspace(-1.5, 1.5, 31), np.linspace(-0.15, 0.15, 4)), axis=-1
    )
    np.savetxt(tmp_path / "rod.csv", rod.reshape(-1, 2), delimiter=",")
    settings = (
        f"lattice.file={tmp_path / 'rod.csv'}",
        "impact.turn=0.2",
        "material.eta_star=0",
    )
    assert_has_left(kernels, "exponential_wall", *settings)


def assert_has_left(kernels, name, *settings):
    """Run on for as long again, and check that the disk never touches the wall and
    flies as fast as `run` says."""
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


@pytest.mark.validate
def test_on_a_hard_wall_contact_lasts_as_long_as_hertz_says(kernels):
    # Quasi-static contact of an elastic disk: M xi'' = -F, with F(xi) of the exact law
    # for one contact (Michell's series), xi = F/(pi E) {ln(pi E R/F) - (1 + nu)/4}; E
    # and nu measured on the same kind of lattice. The contact time is a turning time of
    # an energy integral. At v = 0.02 c the wall a = 3000 is harder than the disk; waves
    # and the lattice's scatter are worth several per cent.
    hard = ("wall.a=3000", "wall.V0=1500", "material.eta_star=0")
    scenario, outcome = computed(kernels, "exponential_wall", *hard, estimate=False)
    moduli = bulk_moduli(1099, 0, 1.0, 0.7)
    E = moduli.young
    nu = moduli.poisson
    F = np.geomspace(1e-9, 0.5, 20_000)
    xi = F / (np.pi * E) * (np.log(np.pi * E / F) - (1 + nu) / 4)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (F[1:] + F[:-1]) * np.diff(xi))])
    inside = scenario.velocity**2 > 2 * work
    # dt = dxi/v, with the turning point's square root integrated exactly over each
    # interval: d(v)/(-F).
    v = np.append(np.sqrt(scenario.velocity**2 - 2 * work[inside]), 0.0)
    force = np.append(F[inside], F[inside][-1])
    duration = (
        2 * np.sum(-np.diff(v) / (0.5 * (force[1:] + force[:-1])))
        + 2 * xi[0] / scenario.velocity
    )
    assert scenario.result(outcome.series)["contact_time"] == pytest.approx(
        duration, rel=0.08
    )


@pytest.mark.validate
def test_the_contact_time_on_a_hard_wall_does_not_depend_on_the_rows(kernels):
    # Compare with a row for every step; rows at intervals of 0.05 R/c miss the first
    # and the last push.
    hard = (
        "lattice.points=300",
        "wall.a=12000",
        "wall.V0=6000",
        "material.eta_star=0",
        "impact.velocity=0.05",
    )
    found = {}
    for rows in ("auto", "1e-6"):
        settings = (*hard, f"time.sample_interval={rows}")
        scenario, outcome = computed(
            kernels, "exponential_wall", *settings, estimate=False
        )
        found[rows] = scenario.result(outcome.series)["contact_time"]
    assert found["auto"] == pytest.approx(found["1e-6"], rel=1e-3)
    every = round(0.05 / outcome.series["t"][1])
    start, end = contact_interval(
        {name: values[::every] for name, values in outcome.series.items()}
    )
    assert end - start != pytest.approx(found["1e-6"], rel=3e-3)
