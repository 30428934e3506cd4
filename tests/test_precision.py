"""Single precision: rounding stays far below the error of the step, even for strains of 1e-9."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
from reference import Model
from worlds import disk, disk_and_wall, matched, moving_down

from taichi_disk.errors import InputError
from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Physics
from taichi_disk.scene_file import load_scene
from taichi_disk.study.endurance import ABOVE, BELOW, BOUNDED, LIMITS, Rest
from taichi_disk.study.hard_cases import CASES, judge

ULP = 2.0**-24  # relative rounding of f32


@pytest.fixture(scope="module")
def single() -> Iterator[None]:
    from taichi_disk.model import runtime

    runtime.start("cpu", precision="f32")
    yield


def world_of(lattice, physics, velocities, dt=1e-3, **own):
    from taichi_disk.model.world import World

    return World(lattice, physics, velocities, dt, **own)


def test_forces_of_strains_of_1e_9_are_right_to_six_digits(single):
    # As differences of coordinates of order R in f32 they would be noise: 6e-8 R against 1e-9 x 0.1 R.
    lattice = disk(60)
    stretched = lattice.positions * (1.0 + 1e-9)
    world = world_of(lattice, Physics(), np.zeros((1, 60, 2)), positions=stretched[None])
    force, energy = world.forces()[0], world.first_row[COLUMNS.index("elastic"), 0]
    i, j = lattice.bonds.T
    span = lattice.positions[i] - lattice.positions[j]
    pull = 1e-9 * span  # k_a s e with s = 1e-9 L
    expected = np.zeros_like(force)
    np.add.at(expected, i, -pull)
    np.add.at(expected, j, pull)
    assert np.abs(force - expected).max() < 30 * ULP * np.abs(pull).max()
    assert energy == pytest.approx(0.5 * np.sum((1e-9 * lattice.rest_lengths) ** 2), rel=1e-6)


@pytest.mark.parametrize("wall", ["rigid", "elastic"])
def test_forces_in_contact_agree_with_the_reference(single, wall):
    lattice = disk(60, height=0.02) if wall == "rigid" else disk_and_wall(60, 80, height=0.02)
    physics = Physics(k_b=1.0, eta=0.3, wall=wall, load=0.01 if wall == "rigid" else 0.0)
    if wall == "elastic":
        physics = replace(matched(lattice, physics), boundary="pinned")
    rng = np.random.default_rng(1)
    x = lattice.positions + 1e-3 * rng.standard_normal(lattice.positions.shape)
    v = 1e-2 * rng.standard_normal((1, *lattice.positions.shape))
    world = world_of(lattice, physics, v, positions=x[None])
    expected = Model.of(lattice, physics).force(x, v[0])
    # a y is rounded to 300 x 6e-8 of coordinates of order R: 2e-5 of the contact force at worst.
    assert np.abs(world.forces()[0] - expected).max() < 2e-5 * np.abs(expected).max()
    np.testing.assert_allclose(world.positions()[0], x, atol=2e-10)
    # Half a kick by the largest contact force, some 3 c, is taken off and put back.
    np.testing.assert_allclose(world.velocities()[0], v[0], atol=4.0 * ULP)


def test_a_free_disk_flies_straight_and_stays_undeformed(single):
    # In its own frame nothing moves: nothing is rounded but the step.
    lattice = disk(60)
    world = world_of(lattice, Physics(), moving_down(lattice, 0.02), 1e-2)
    row = dict(zip(COLUMNS, world.advance(1, 5000)[0, :, 0], strict=True))
    np.testing.assert_allclose(world.positions()[0], lattice.positions - [0.0, 1.0], rtol=0, atol=ULP)
    # The time series adds up coordinates rounded to f32.
    assert row["com_y"] == pytest.approx(lattice.positions[:, 1].mean() - 1.0, abs=2.0 * ULP)
    assert row["com_vy"] == pytest.approx(-0.02, abs=1e-15)
    assert row["elastic"] == 0.0


def test_a_lane_of_eight_has_the_bytes_of_a_single_run(single):
    lattice = disk(60, height=0.04)
    physics = Physics(k_b=1e-3, eta=0.1, wall="rigid")
    speeds = np.linspace(0.01, 0.08, 8)
    v = np.concatenate([moving_down(lattice, speed) for speed in speeds])
    many = world_of(lattice, physics, v)
    one = world_of(lattice, physics, v[5:6])
    many.advance(1, 700)
    one.advance(1, 700)
    np.testing.assert_array_equal(many.positions()[5], one.positions()[0])
    np.testing.assert_array_equal(many.velocities()[5], one.velocities()[0])
    state = many.export_state()
    expected = many.advance(2, 50)
    many.import_state(state)
    np.testing.assert_array_equal(many.advance(2, 50), expected)


def test_a_stretched_lattice_is_refused(single):
    lattice = disk(30)
    with pytest.raises(ValueError, match="rest lengths"):
        world_of(replace(lattice, rest_lengths=1.01 * lattice.rest_lengths), Physics(), np.zeros((1, 30, 2)))


@pytest.mark.validate
@pytest.mark.parametrize("pressed", [False, True], ids=["free", "pressed on the wall"])
@pytest.mark.parametrize(("integrator", "eta_star"), LIMITS)
def test_the_limit_of_the_step_is_that_of_double_precision(single, integrator, eta_star, pressed):
    world = None
    for k_a in (1e-3, 1.0, 1e3):
        rest = Rest(integrator, eta_star, k_a, pressed)
        world = rest.world(0.98 * rest.limit.stated, world)
        assert rest.growth(world, BELOW) < (BOUNDED, BELOW + 1)
        world = rest.world(1.05 * rest.limit.true, world)
        assert rest.growth(world, ABOVE)[1] < ABOVE
    world.destroy()


@pytest.mark.parametrize(
    "case", [pytest.param(one, id=one.name, marks=() if one.quick else pytest.mark.validate) for one in CASES]
)
def test_a_hard_case_ends_in_single_precision_as_it_should(single, case):
    case = case.in_single_precision()
    assert case.failings(judge(case)) == []


SMALL = ["lattice.points=150", "time.safety=0.3"]
CASES = {
    "eta* = 0": ("exponential_wall", "material.eta_star=0"),
    "slow": ("exponential_wall", "material.eta_star=0", "impact.velocity=0.003"),
    "eta* = 100": ("exponential_wall", "material.eta_star=100"),
    "reset": ("absorbing_wall", "wall.points=180", "wall.width=3.4"),
}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name == "eta* = 0" else pytest.mark.validate) for name in CASES]
)
def test_restitution_differs_from_double_precision_by_less_than_the_error_of_the_step(name, tmp_path):
    from taichi_disk import run

    scene, *settings = CASES[name]
    e = {}
    for precision in ("f64", "f32"):
        result = run(
            load_scene(scene, [*SMALL, *settings, f"time.precision={precision}"]), tmp_path / precision, video=False
        )
        assert result.summary["precision"] == precision
        assert abs(result.summary["energy"]["closing_imbalance"]) < 2e-5
        e[precision] = result.headline["restitution"]
    # Measured 2e-8 to 4e-7 with 1099 points; the automatic step's own error is some 2e-6.
    assert 0.0 < abs(e["f64"] - e["f32"]) < 1e-6


@pytest.mark.parametrize(
    ("points", "least"), [(60, "0.0001001"), pytest.param(1099, "0.0011", marks=pytest.mark.validate)]
)
def test_a_relaxation_that_f32_cannot_reach_is_refused_and_what_is_advised_is_reached(points, least, tmp_path):
    from taichi_disk import run

    small = [f"lattice.points={points}", "time.precision=f32"]
    with pytest.raises(InputError, match=f"at best: write compression.tolerance: {least} or more"):
        load_scene("compression", small)
    with pytest.raises(InputError, match=r"at best: write f64$"):
        load_scene("compression", ["lattice.points=10000", "time.precision=f32"])
    result = run(load_scene("compression", [*small, f"compression.tolerance={least}"]), tmp_path / "a", video=False)
    newton = ["compression.method=newton", f"lattice.points={points}"]
    exact = run(load_scene("compression", newton), tmp_path / "b", video=False)
    # Forces at rest to `least` of P/N: xi to a part of that, and what is left of the roll.
    assert result.headline["xi"] == pytest.approx(exact.headline["xi"], rel=1e-3)
