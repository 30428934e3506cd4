"""Compression by relaxation: the same equilibrium as Newton's, reached from where the disk would come to lie."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import Model
from scipy.optimize import brentq
from worlds import computed

from taichi_disk import load_scene
from taichi_disk.lattice import disk_lattice
from taichi_disk.newton import compress, lowest_lie, roll_angle
from taichi_disk.quasistatic import press
from taichi_disk.scenes import build

SMALL = ("lattice.points=150", "time.safety=0.3")  # about the step of 1099 points: see test_energy


def xi_of(lattice, rest):
    """Centre of mass to lowest point, unloaded minus loaded, the unloaded disk turned as the loaded one lies."""
    angle = roll_angle(lattice.positions, rest)
    y = np.sin(angle) * lattice.positions[:, 0] + np.cos(angle) * lattice.positions[:, 1]
    return (y.mean() - y.min()) - (rest[:, 1].mean() - rest[:, 1].min())


SEEDS = [(150, 0)]
SLOW = [(150, 1), (150, 2), (150, 3), (1099, 0), (1099, 1)]


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize(
    ("points", "seed"), [*SEEDS, *(pytest.param(*case, marks=pytest.mark.validate) for case in SLOW)]
)
def test_relaxation_finds_newtons_equilibrium(points, seed):
    safety = 0.3 if points == 150 else 0.8
    settings = (f"lattice.points={points}", f"lattice.seed={seed}", f"time.safety={safety}")
    setup, outcome = computed("compression", *settings)
    physics = setup.physics
    rest = compress(
        setup.lattice, physics.k_a, physics.k_b, physics.a, physics.V0, physics.load, start=setup.lattice.positions
    )
    values = setup.headline(outcome.columns).values
    # What is left is the end of the roll, which is slowest on the coarsest disk.
    assert values["xi"] == pytest.approx(xi_of(setup.lattice, rest.positions), rel=2e-5)

    # At the end nothing pulls on any point any more, by forces that share no code with the run; the load P/N is the
    # scale. (The last slow roll, over hours, is what remains.)
    x = outcome.positions
    force = Model.of(setup.lattice, physics).force(x, np.zeros_like(x))
    assert np.abs(force).max() < 1e-3 * physics.load / points
    wall = physics.a * physics.V0 * np.exp(-physics.a * x[:, 1]).sum()
    assert wall == pytest.approx(physics.load, rel=1e-6)
    assert outcome.columns["wall_force"][-1] == pytest.approx(wall, rel=1e-12)
    assert outcome.columns["kinetic"][-1] < 1e-9 * physics.load**2

    # xi by its definition, from the arrays.
    start = setup.lattice.positions[:, 1]
    direct = (start.mean() - start.min()) - (x[:, 1].mean() - x[:, 1].min())
    assert values["xi"] == pytest.approx(direct, abs=values["xi_extrapolated"] + 1e-12)
    assert values["xi_nominal"] == pytest.approx(
        1.0 - (x[:, 1].mean() - x[:, 1].min()), abs=values["xi_extrapolated"] + 1e-12
    )


@pytest.mark.parametrize("seed", range(3))
def test_a_laid_down_disk_does_not_roll(seed):
    setup = build(load_scene("compression", (*SMALL, f"lattice.seed={seed}")))
    lattice, physics = setup.lattice, setup.physics
    rest = compress(
        lattice, physics.k_a, physics.k_b, physics.a, physics.V0, physics.load, start=lattice.positions
    ).positions
    assert abs(roll_angle(lattice.positions, rest)) < 1e-6
    # It is the lattice itself, turned and lifted: every spring at rest.
    d = lattice.positions[lattice.bonds[:, 0]] - lattice.positions[lattice.bonds[:, 1]]
    np.testing.assert_allclose(np.hypot(*d.T), lattice.rest_lengths, rtol=0, atol=1e-13)
    # The wall bears a thousandth of the load at the start.
    wall = physics.a * physics.V0 * np.exp(-physics.a * lattice.positions[:, 1]).sum()
    assert wall == pytest.approx(1e-3 * physics.load, rel=1e-9)


@pytest.mark.parametrize("rim", [True, False])
def test_it_does_not_matter_how_the_lattice_is_turned_when_it_is_put_down(rim):
    settings = (*SMALL, "compression.method=newton", f"lattice.rim={str(rim).lower()}", "lattice.min_spacing=0")
    scene = load_scene("compression", settings)
    disk = disk_lattice(150, 0, rim, 0.0)
    found = []
    for angle in (0.0, 1.0, -2.0):
        turned = disk.positions @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
        setup = build(scene, replace(disk, positions=turned))
        found.append(setup.headline(press(setup).columns).values["xi"])
    assert found == pytest.approx([found[0]] * 3, rel=1e-9)


@pytest.mark.parametrize("a", [300.0, 3000.0])
def test_a_rigid_disk_lies_with_its_centre_of_mass_as_low_as_it_can(a):
    disk = disk_lattice(150, 4)
    arm = disk.positions - disk.positions.mean(axis=0)
    depth = 1 / a + 2e-3 / np.pi

    def height(angle):
        y = np.sin(angle) * arm[:, 0] + np.cos(angle) * arm[:, 1]
        return brentq(lambda h: np.exp(-(y + h) / depth).sum() - 1.0, 0.5, 2.0, xtol=1e-14)

    best = lowest_lie(disk, 1.0, a, 1e-3)
    # Points inside the disk weigh less than exp(-10) here.
    assert all(height(best) <= height(angle) + 1e-7 for angle in np.linspace(-np.pi, np.pi, 500))


@pytest.mark.usefixtures("taichi")
def test_newton_scene_leaves_no_force(tmp_path):
    from taichi_disk import run

    scene = load_scene("compression", (*SMALL, "compression.method=newton"))
    result = run(scene, tmp_path, video=False)
    final, start = np.load(tmp_path / "final.npz"), np.load(tmp_path / "lattice.npz")
    x = final["positions"]
    model = Model(
        start["bonds"],
        start["rest_lengths"],
        start["masses"][0],
        150,
        k_b=1e-3,
        rigid=True,
        load=scene.compression.pressure,
    )
    assert np.abs(model.force(x, np.zeros_like(x))).max() < 1e-9 * 0.01 / 150
    np.testing.assert_array_equal(final["velocities"], 0.0)
    xi = (start["positions"][:, 1].mean() - start["positions"][:, 1].min()) - (x[:, 1].mean() - x[:, 1].min())
    assert result.headline["xi"] == pytest.approx(xi, rel=1e-12)
    assert result.summary["integrator"] == "newton"
    # An equilibrium is a minimum: the energy is lower than anywhere around.
    rng = np.random.default_rng(0)
    for _ in range(20):
        assert model.potential(x + 1e-6 * rng.standard_normal(x.shape)) > model.potential(x)


@pytest.mark.parametrize("pressure", [4e-3, pytest.param(1e-2, marks=pytest.mark.validate), 1.6e-2])
def test_xi_is_near_that_of_the_continuum(pressure):
    # Michell's series for one contact and a uniform body force: xi = P/(pi E) {ln(pi E R/P) - (1 + nu)/4}, with the
    # moduli of a stretch test. The wall is not quite hard and the lattice not quite a continuum: this one lies 2 to
    # 7 % lower.
    from taichi_disk.moduli import bulk_moduli

    setup = build(load_scene("compression", ("compression.method=newton", f"compression.pressure={pressure}")))
    xi = setup.headline(press(setup).columns).values["xi"]
    moduli = bulk_moduli(1099, 0, 1.0, 0.7)
    E, nu = moduli.young, moduli.poisson
    law = pressure / (np.pi * E) * (np.log(np.pi * E / pressure) - (1 + nu) / 4)
    assert xi == pytest.approx(law, rel=0.1)
