"""The pressed disk at rest: stable, and the same by a minimiser and by relaxation."""

import re
from dataclasses import replace

import numpy as np
import pytest
import reference
from bodies import SMALL, computed, disk, pressed
from scipy.optimize import brentq, root

from taichi_disk.base.errors import SimulationError
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.lattice import Lattice, bulk_moduli
from taichi_disk.mechanics.physics import ExponentialWall, Load, Model, Springs
from taichi_disk.mechanics.statics import equilibrium
from taichi_disk.mechanics.statics.equilibrium import (
    place_on_wall,
    resting_angle,
    solve_equilibrium,
    turned,
)

P = 1e-2
ROUNDING = 16 * np.finfo(float).eps  # of a force on a point, in any version of NumPy
WALL = ExponentialWall(300.0, 150.0)
MODEL = pressed(P, k_b=1e-3)


def forces(lattice, model, x):
    """Return the forces by the independent implementation."""
    return reference.Model(lattice, model).force(x, np.zeros_like(x))


def rest_of(lattice, model, **options):
    """Solve by Newton's method from where the wall carries the rigid body."""
    start = place_on_wall(lattice, 0.0, model.wall, model.load.force).positions
    return solve_equilibrium(lattice, model, start, **options)


def xi(lattice, x):
    """Return how much the lowest point has approached the centre of mass."""
    before, after = (p[:, 1].mean() - p[:, 1].min() for p in (lattice.positions, x))
    return before - after


def spread(x):
    return x - x.mean(axis=0)


@pytest.mark.parametrize("rim", [True, False])
@pytest.mark.parametrize("a", [30.0, 30000.0])
@pytest.mark.parametrize("pressure", [1e-3, 5e-2])
def test_it_comes_to_rest_for_soft_and_hard_walls_and_all_loads(rim, a, pressure):
    lattice = Lattice.disk(150, 1, rim, 0.7 if rim else 0.0)
    model = pressed(pressure, k_b=1e-3, wall=ExponentialWall(a, 150.0))
    x = rest_of(lattice, model).positions
    # Allow rounding errors of coordinates up to 2 R times the largest stiffness.
    stiffest = max(model.stiffness(lattice, x).diagonal().max(), 1.0)
    most = 30 * np.finfo(float).eps * stiffest
    assert np.abs(forces(lattice, model, x)).max() < most
    bearing = reference.Model(lattice, model).wall_force(x)[:, 1]
    assert bearing.sum() == pytest.approx(pressure, rel=1e-10)
    assert abs(np.sum(bearing * spread(x)[:, 0])) < 1e-9 * pressure  # no torque
    # The mean stays in place, however far the disk rolls; another call moves nothing.
    assert x[:, 0].mean() == pytest.approx(lattice.positions[:, 0].mean(), abs=1e-12)
    assert solve_equilibrium(lattice, model, x).iterations == 0


def test_a_stiffness_without_an_inverse_is_shifted_further():
    keys = {"lattice.points": 7, "material.k_a": 2.05e-6, "material.k_b": 257.0}
    keys |= {"wall.a": 2.77, "compression.pressure": 1.0}
    scenario = load_scene("compression").with_(keys).scenario()
    force = forces(scenario.lattice, scenario.model, scenario.rest.positions)
    assert np.abs(force).max() < 1e-9


def test_a_hexagon_balanced_on_its_corner_tips_over_onto_a_side():
    angle = np.pi / 6 + np.arange(6) * np.pi / 3
    # two of them at x = 0
    corners = np.round(np.stack([np.cos(angle), np.sin(angle)], axis=1), 15)
    lattice = Lattice.from_points([*corners, [0.0, 0.0]])
    lifted = place_on_wall(lattice, 0.0, WALL, P).positions

    def push(x):
        return forces(lattice, MODEL, x.reshape(-1, 2)).ravel()

    upright = root(push, lifted, method="lm", tol=1e-15)
    start = upright.x.reshape(-1, 2)
    # at rest already, but not stable
    assert np.abs(forces(lattice, MODEL, start)).max() < 1e-13 * P
    rest = solve_equilibrium(lattice, MODEL, start)
    # a strained hexagon, P/k_a = 1e-2
    assert abs(rest.roll) == pytest.approx(np.pi / 6, abs=1e-4)
    height = np.sort(rest.positions[:, 1])
    assert height[1] - height[0] < 1e-9


def test_an_equilibrium_that_is_not_found_is_an_error():
    disk = Lattice.disk(60, 0)
    needed = rest_of(disk, MODEL).iterations
    assert rest_of(disk, MODEL, max_iterations=needed).iterations == needed
    with pytest.raises(SimulationError, match=f"within {needed - 1} Newton iterations"):
        rest_of(disk, MODEL, max_iterations=needed - 1)
    hard = Model(Springs(1e-6), ExponentialWall(1e6, 150.0), Load(1.0))
    message = r"could not lower the energy.*compression\.pressure"
    with pytest.raises(SimulationError, match=message):
        rest_of(Lattice.disk(8, 0), hard)


def test_an_interrupt_ends_newtons_method_between_two_iterations(monkeypatch):
    def interrupted():
        checks.append(None)
        if len(checks) == 2:
            raise KeyboardInterrupt

    checks = []
    monkeypatch.setattr(equilibrium, "raise_if_interrupted", interrupted)
    with pytest.raises(KeyboardInterrupt):
        rest_of(Lattice.disk(60, 0), MODEL)


def test_a_rigid_disk_lies_with_its_centre_of_mass_as_low_as_it_can():
    # Find the height at which a wall exp(-y/L) carries the weight, by bisection, at 500
    # angles. Points inside the disk contribute less than exp(-10) here.
    arm = spread(disk(150, 4).positions)
    depth = 1 / 3000 + 2e-3 / np.pi

    def height(angle):
        y = np.sin(angle) * arm[:, 0] + np.cos(angle) * arm[:, 1]

        def excess(h):
            return np.exp(-(y + h) / depth).sum() - 1.0

        return brentq(excess, 0.5, 2.0, xtol=1e-14)

    best = height(resting_angle(disk(150, 4), 1.0, 3000.0, 1e-3))
    heights = [height(angle) for angle in np.linspace(-np.pi, np.pi, 500)]
    assert best <= min(heights) + 1e-7


def test_it_does_not_matter_how_the_lattice_is_turned_when_it_is_put_down():
    scene = load_scene("compression", ("compression.method=newton",))
    lattice = Lattice.disk(150, 0, False, 0.0)
    found = []
    for angle in (0.0, 1.0, -2.0):
        body = replace(lattice, positions=turned(lattice.positions, angle))
        scenario = scene.scenario(body)
        found.append(scenario.result(compute(scenario, loads=1).series)["xi"])
    assert found == pytest.approx([found[0]] * 3, rel=1e-9)


@pytest.fixture(scope="module")
def loading():
    """Return scene, scenario and outcome of a loading."""
    settings = ("lattice.points=100", "compression.method=newton")
    scene = load_scene("compression", settings)
    scenario = scene.scenario()
    return scene, scenario, compute(scenario)


def test_every_row_of_a_loading_is_an_equilibrium_of_plain_numpy(loading):
    _, scenario, outcome = loading
    lattice = scenario.lattice
    columns = outcome.series
    assert 0.0 < columns["t"][0] < 0.01
    assert columns["t"][-1] == 1.0
    assert (np.diff(columns["t"]) > 0.0).all()
    for row, (t, x, v) in enumerate(outcome.replay(columns["t"])):
        assert t == columns["t"][row]
        assert not v.any()
        plain = reference.Model(lattice, replace(scenario.model, load=Load(t * P)))
        expected = {
            "com_x": x[:, 0].mean(),
            "com_y": x[:, 1].mean(),
            "lowest_y": x[:, 1].min(),
            "wall_force": plain.wall_force(x)[:, 1].sum(),
            "elastic": plain.elastic(x),
            "wall": plain.wall(x),
            "load": t * P * x[:, 1].mean(),
            "total": plain.potential(x),
        }
        assert {name: columns[name][row] for name in expected} == pytest.approx(
            expected, rel=1e-11, abs=1e-17
        )
        assert columns["wall_force"][row] == pytest.approx(t * P, rel=1e-9)
        at_rest = 1e-9 * t * P / 100 + ROUNDING
        assert np.abs(plain.force(x, v)).max() < at_rest
        assert columns["residual"][row] < at_rest
    x = outcome.positions
    values = scenario.result(columns)
    assert np.array_equal(next(outcome.replay(np.array([1.0])))[1], x)
    assert columns["xi"][-1] == pytest.approx(values["xi"], rel=1e-12)
    assert values["xi"] == pytest.approx(xi(lattice, x), rel=1e-12)
    assert values["xi_nominal"] == pytest.approx(
        1.0 - (x[:, 1].mean() - x[:, 1].min()), rel=1e-12
    )


@pytest.mark.parametrize("row", [0, 5, 14])
def test_each_load_of_a_loading_compresses_as_much_as_a_run_under_that_load_alone(
    loading, row
):
    scene, _, outcome = loading
    part = outcome.series["t"][row]
    found = outcome.series["xi"][row]
    alone = scene.with_({"compression.pressure": float(part * P)}).scenario()
    # and lies as it would then
    assert abs(alone.rest.roll - loading[1].rest.roll) > 0.05
    assert found == pytest.approx(xi(alone.lattice, alone.rest.positions), rel=1e-8)


def test_a_start_that_is_known_to_be_close_saves_an_iteration(loading):
    _, scenario, _ = loading
    model = replace(scenario.model, load=Load(1.001 * P))
    problem = scenario.lattice, model, scenario.rest.positions
    counts = [solve_equilibrium(*problem, is_close=k).iterations for k in (1, 0)]
    assert counts[0] < counts[1] == solve_equilibrium(*problem).iterations


def test_a_state_at_any_load_is_an_equilibrium_and_a_film_s_is_near_it(loading):
    _, scenario, outcome = loading
    columns = outcome.series
    asked = np.array([0.0, 0.4, 0.5, 1.0])
    for (t, x, _), (same, drawn, _) in zip(
        outcome.replay(asked), outcome.frames(asked), strict=True
    ):
        model = replace(scenario.model, load=Load(t * P))
        assert t == same
        at_rest = 1e-9 * t * P / 100 + ROUNDING
        assert np.abs(forces(scenario.lattice, model, x)).max() < at_rest
        off = np.abs(drawn - x).max()
        assert off == 0.0 if t in columns["t"] else off < 1e-4
    # under no load at all it rests nowhere
    assert t == 1.0
    assert next(outcome.replay(asked))[0] == columns["t"][0]


def test_the_rest_under_the_full_load_alone_is_bitwise_that_of_the_loading(loading):
    scene, scenario, outcome = loading
    alone = compute(scene.scenario(), loads=1)
    assert np.array_equal(alone.positions, outcome.positions)
    assert alone.summary == outcome.summary
    assert scenario.result(alone.series) == scenario.result(outcome.series)
    assert {name: values[-1] for name, values in outcome.series.items()} == {
        name: values[0] for name, values in alone.series.items()
    }


@pytest.mark.parametrize(
    ("settings", "rolls"),
    [(SMALL, False), (("lattice.points=60", "material.eta_star=20"), True)],
)
def test_relaxation_comes_to_newtons_rest(settings, rolls, kernels):
    """It begins at Newton's angle (rolling takes 10^4 R/c), or at the rigid disk's."""
    scene = load_scene("compression", settings)
    scenario = scene.scenario()
    lattice = scenario.lattice
    model = scenario.model
    if rolls:
        angle = resting_angle(scene.body(), 1.0, WALL.a, P)
        assert abs(scenario.rest.roll - angle) > 0.02
        placed = place_on_wall(scene.body(), angle, WALL, 1e-3 * P)
        scenario = replace(scenario, lattice=placed)
    start = scenario.lattice.positions
    outcome = compute(scenario)
    values = scenario.result(outcome.series)
    rest = solve_equilibrium(lattice, model, lattice.positions)
    assert abs(rest.roll) < 1e-6
    # The remaining difference is the end of the roll.
    assert values["xi"] == pytest.approx(xi(lattice, rest.positions), rel=2e-5)
    # It starts as the unloaded lattice, turned and lifted: springs at rest, a
    # thousandth of the load on the wall.
    wall_force = reference.Model(lattice, model).wall_force
    assert np.abs(model.springs.strain(lattice, start)).max() < 1e-12
    assert wall_force(start)[:, 1].sum() == pytest.approx(1e-3 * P, rel=1e-9)
    # At the end no point feels a force, compared with the load P/N.
    x = outcome.positions
    slack = values["xi_extrapolated"] + 1e-12
    assert np.abs(forces(lattice, model, x)).max() < 1e-3 * P / lattice.disk_points
    assert wall_force(x)[:, 1].sum() == pytest.approx(P, rel=1e-6)
    assert values["xi"] == pytest.approx(xi(lattice, x), abs=slack)
    assert values["xi_nominal"] == pytest.approx(
        1.0 - (x[:, 1].mean() - x[:, 1].min()), abs=slack
    )


@pytest.mark.validate
def test_a_compression_within_a_tolerance_ends_as_near_to_newtons_rest(kernels):
    """Without it the disk is at rest while its roll still changes xi by 3e-7 R."""
    settings = ["lattice.points=60", "lattice.seed=9162", "wall.a=44", "wall.V0=22"]
    settings += ["material.k_a=0.76", "material.eta_star=68"]
    settings += ["compression.pressure=4e-3"]
    loose, early = computed(kernels, "compression", *settings)
    off = loose.end_truncation_error(early.series)
    # Newton's rest is rounded, too.
    assert off > 1e-7
    assert 1.05 * off < early.summary["error_estimate"]["xi"] < 1.5 * off
    scenario, outcome = computed(
        kernels, "compression", *settings, "time.tolerance=1e-7"
    )
    assert 0.0 < outcome.summary["error_estimate"]["xi"] <= 1e-7
    rest = solve_equilibrium(
        scenario.lattice, scenario.model, scenario.lattice.positions
    ).positions
    assert scenario.result(outcome.series)["xi"] == pytest.approx(
        xi(scenario.lattice, rest), abs=1e-7
    )
    assert scenario.time_to_end(outcome.series) == 0.0
    assert scenario.time_to_end(early.series) > 0.0
    # Once the disk is at rest, the end is checked at every row.
    longer = outcome.series["t"][-1] - early.series["t"][-1]
    assert 0.0 < longer < 0.5 * scenario.quiet_time
    end = f"{early.series['t'][-1]:.6g}"
    assert re.search(
        rf"at rest by t = {end} .* xi still differs .* Newton's.*time\.tolerance",
        scenario.unfinished(early.series),
    )


def test_xi_is_near_that_of_the_continuum():
    # Michell's series for one contact and a uniform body force: xi = P/(pi E) {ln(pi E
    # R/P) - (1 + nu)/4}, with the moduli of a stretch test. The wall is not quite hard
    # and the lattice not quite a continuum: 2 to 7 % lower.
    lattice = Lattice.disk(1099, 0)
    moduli = bulk_moduli(1099, 0, 1.0, 0.7)
    pressure = 1.6e-2
    E = moduli.young
    nu = moduli.poisson
    law = pressure / (np.pi * E) * (np.log(np.pi * E / pressure) - (1 + nu) / 4)
    found = rest_of(lattice, pressed(pressure, k_b=1e-3)).positions
    assert xi(lattice, found) == pytest.approx(law, rel=0.1)


@pytest.mark.parametrize("method", ["newton", "relaxation"])
def test_springs_strained_without_a_load_rest_before_xi_counts(method, kernels):
    # Springs 1 % longer than their distances only make the body 1 % larger.
    scene = load_scene("compression", [f"compression.method={method}"])
    disk = Lattice.disk(60, 0)
    strained = Lattice.from_points(disk.positions, disk.bonds, 1.01 * disk.rest_lengths)
    found = []
    for lattice in (strained, Lattice.from_points(1.01 * disk.positions)):
        scenario = scene.scenario(lattice)
        outcome = compute(scenario, estimate=False)
        found.append(scenario.result(outcome.series)["xi"])
    assert found[0] == pytest.approx(found[1], rel=1e-6)


def test_xi_keeps_its_sign():
    # The lowest points of this flat bar go down by more than its centre of mass.
    x, y = np.meshgrid(np.linspace(-0.9, 0.9, 14), [0.0, 0.12])
    bar = Lattice.from_points(np.stack([x.ravel(), y.ravel()], axis=1))
    settings = ["compression.method=newton", "compression.pressure=1e-3"]
    scenario = load_scene("compression", settings).scenario(bar)
    unloaded = scenario.lattice.positions[:, 1]
    rest = scenario.rest.positions[:, 1]
    columns = compute(scenario).series
    difference = (unloaded.mean() - unloaded.min()) - (rest.mean() - rest.min())
    assert scenario.result(columns)["xi"] == pytest.approx(difference, rel=1e-9)
    assert difference < 0.0


def test_the_picture_of_a_flat_body_is_as_high_as_that_of_a_disk():
    flat = Lattice.from_points(disk(60).positions * [1.0, 0.5])
    assert load_scene("compression").scenario(flat).view[3] == 2.05
