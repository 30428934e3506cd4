"""The energy ledger: kinetic + elastic + wall + load + dissipated + absorbed + sliding stays what it was.

Leapfrog keeps a modified energy, E + h^2 E_2 + ..., so that what is missing at any instant falls as h^2; after an
impact, where the state is smooth again, far less is missing than amid it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import Model
from worlds import again, computed, disk, disk_and_wall, matched, moving_down

from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Physics

pytestmark = pytest.mark.usefixtures("taichi")

N = 60
ENERGIES = ("kinetic", "elastic", "wall", "load", "dissipated", "absorbed", "sliding")
VV, TRAPEZOIDAL = "velocity_verlet", "trapezoidal"

# The limit of the step grows as 1/sqrt(N): at N = 150 this safety takes the step that 1099 points get automatically,
# about 0.017 R/c, for which the bounds below are stated.
SMALL = ("lattice.points=150", "time.safety=0.3")
WALL = (*SMALL, "wall.points=180", "wall.width=3.4")
AUTOMATIC = {
    "eta* = 0": ("exponential_wall", *SMALL, "material.eta_star=0"),
    "eta* = 10": ("exponential_wall", *SMALL),
    "eta* = 100": ("exponential_wall", *SMALL, "material.eta_star=100"),
    "eta* = 100, explicit": (
        "exponential_wall",
        *SMALL,
        "material.eta_star=100",
        "time.integrator=velocity_verlet",
    ),
    "reset": ("absorbing_wall", *WALL),
    "reset, eta* = 10": ("absorbing_wall", *WALL, "material.eta_star=10"),
    "reset, eta* = 10, implicit": (
        "absorbing_wall",
        *WALL,
        "material.eta_star=10",
        "time.integrator=trapezoidal",
    ),
    "pinned": ("absorbing_wall", *WALL, "wall.boundary=pinned"),
    "dashpot": ("absorbing_wall", *WALL, "wall.boundary=dashpot"),
    "compression": ("compression", *SMALL, "compression.tolerance=1e-3"),
}
FAST_AUTOMATIC = {"eta* = 0", "eta* = 100", "reset, eta* = 10", "compression"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in FAST_AUTOMATIC else pytest.mark.validate) for name in AUTOMATIC]
)
def test_energy_is_accounted_for_at_the_automatic_step(name):
    setup, outcome = computed(*AUTOMATIC[name])
    columns, energy = outcome.columns, outcome.facts["energy"]
    # `total` is what it says, and the summary's figures follow from the columns.
    total = sum(columns[one] for one in ENERGIES)
    np.testing.assert_allclose(columns["total"], total, rtol=1e-13)
    scale = setup.energy_scale(columns)
    if name != "compression":
        assert scale == pytest.approx(columns["kinetic"][0], rel=1e-12)
    lost = (total - total[0]) / scale
    assert energy["closing_imbalance"] == pytest.approx(lost[-1], abs=1e-12)
    assert energy["worst_imbalance"] == pytest.approx(np.abs(lost).max(), abs=1e-12)
    assert abs(energy["closing_imbalance"]) < 2e-5
    assert energy["worst_imbalance"] < 1e-4
    # Losses only grow. (Centred sums may dip by their own error.)
    for one in ("dissipated", "absorbed"):
        assert np.diff(columns[one]).min() >= -1e-6 * scale


def bounce(scene):
    """Lattice, velocities and physics of a disk just above a wall, moving straight down."""
    if scene == "rigid":
        lattice = disk(N, height=0.05)
        return lattice, moving_down(lattice, 0.05), Physics(k_b=1.0, wall="rigid")
    if scene == "compression":
        lattice = disk(N, height=0.045)
        return lattice, moving_down(lattice, 0.0), Physics(wall="rigid", load=0.05)
    lattice = disk_and_wall(N, 80, height=0.05)
    physics = Physics(k_b=1.0, wall="elastic")
    if scene == "matched":
        physics = matched(lattice, physics)
    else:
        physics = replace(physics, boundary="reset", reset_interval=0.12)
    return lattice, moving_down(lattice, 0.05), physics


END, LOOKS = 1.92, 16
LEDGERS = [
    ("rigid", 0.0, VV, False),
    ("rigid", 20.0, VV, False),
    ("rigid", 100.0, TRAPEZOIDAL, False),
    ("compression", 20.0, VV, False),
    ("matched", 0.0, VV, True),
    ("matched", 20.0, VV, False),
    ("matched", 100.0, TRAPEZOIDAL, False),
    ("reset", 0.0, VV, False),
    ("reset", 20.0, VV, True),
    ("reset", 20.0, TRAPEZOIDAL, False),
]


@pytest.mark.parametrize(
    ("scene", "eta_star", "integrator"),
    [pytest.param(*case, marks=() if fast else pytest.mark.validate) for *case, fast in LEDGERS],
)
def test_what_is_missing_falls_with_the_square_of_the_step(scene, eta_star, integrator):
    from taichi_disk.model.world import World

    lattice, velocities, physics = bounce(scene)
    physics = replace(physics, eta=eta_star / N, integrator=integrator)
    world, worst = None, []
    for stride in (120, 240):
        h = END / LOOKS / stride
        if world is None or physics.reset_interval:
            world = World(lattice, physics, velocities, h)
        else:
            again(world, lattice.positions[None], velocities, h)
        rows = np.concatenate([world.first_row[None], world.advance(LOOKS, stride)])[:, :, 0]
        total = sum(rows[:, COLUMNS.index(name)] for name in ENERGIES)
        worst.append(np.abs(total - total[0]).max())
    world.destroy()
    assert worst[0] / worst[1] == pytest.approx(4.0, abs=0.4)
    assert worst[1] < 1e-4 * 0.5 * 0.05**2


@pytest.mark.parametrize(
    ("scene", "eta_star", "integrator"),
    [("rigid", 1.0, VV), ("rigid", 20.0, TRAPEZOIDAL), ("matched", 3.0, VV)],
)
def test_what_is_missing_once_the_disk_has_come_to_rest_in_itself_falls_with_the_fourth_power(
    scene, eta_star, integrator
):
    """Where nothing vibrates any more E_2 is gone; what the dashpots took is summed to the order of what is left."""
    from taichi_disk.model.world import World

    lattice = disk(N, height=0.12) if scene == "rigid" else disk_and_wall(N, 80, height=0.12)
    physics = Physics(k_b=1.0, wall="rigid" if scene == "rigid" else "elastic")
    physics = replace(matched(lattice, physics) if scene == "matched" else physics, eta=eta_star / N)
    physics = replace(physics, integrator=integrator)
    closing = []
    for steps in (400, 800):
        world = World(lattice, physics, moving_down(lattice, 0.05), 9.0 / steps)
        rows = np.concatenate([world.first_row[None], world.advance(1, steps)])[:, :, 0]
        total = sum(rows[:, COLUMNS.index(name)] for name in ENERGIES)
        closing.append(total[1] - total[0])
        world.destroy()
    assert closing[0] / closing[1] == pytest.approx(16.0, rel=0.2)
    assert abs(closing[1]) < 3e-6 * 0.5 * 0.05**2


@pytest.mark.parametrize("integrator", [TRAPEZOIDAL, pytest.param(VV, marks=pytest.mark.validate)])
def test_losses_are_booked_where_they_happen(integrator):
    # dissipated = int eta sum |v_i - v_j|^2 dt over the springs, absorbed = int sum Z v^2 dt over the boundary, by the
    # trapezoidal rule over every step: both sums are O(h^2) from the integrals.
    from taichi_disk.model.world import World

    lattice, velocities, physics = bounce("matched")
    physics = replace(physics, eta=20.0 / N, integrator=integrator)
    # The boundary is already on the move, or it would take until the wave arrives.
    velocities[0, lattice.disk_points :] = [0.01, -0.02]
    h, steps = 1e-3, 800
    world = World(lattice, physics, velocities, h)
    i, j = lattice.bonds.T

    def powers(v):
        springs = physics.eta * np.sum((v[i] - v[j]) ** 2)
        return np.array([springs, np.sum(physics.impedance * v[lattice.wall_boundary] ** 2)])

    power = [powers(velocities[0])]
    for _ in range(steps):
        row = world.advance(1, 1)[0, :, 0]
        power.append(powers(world.velocities()[0]))
    lost = h * (np.sum(power, axis=0) - 0.5 * (power[0] + power[-1]))
    assert lost.min() > 1e-6
    np.testing.assert_allclose(row[[COLUMNS.index("dissipated"), COLUMNS.index("absorbed")]], lost, rtol=1e-3)
    world.destroy()


def test_what_a_point_loses_by_sliding_over_the_bent_wall_is_booked():
    # Where the surface is bent, l jumps as a point passes from one spring to the next: at any step the energy changes
    # by that much, and what is missing beyond it falls with the square of the step.
    from taichi_disk.model.world import World

    lattice = disk_and_wall(N, 80, height=0.05)
    velocities = moving_down(lattice, 0.3)
    velocities[0, :N, 0] = 0.2
    physics = Physics(wall="elastic", boundary="pinned")
    world, missing, slid = None, [], []
    for stride in (100, 200):
        h = 4.0 / 40 / stride
        if world is None:
            world = World(lattice, physics, velocities, h)
        else:
            again(world, lattice.positions[None], velocities, h)
        rows = np.concatenate([world.first_row[None], world.advance(40, stride)])[:, :, 0]
        total = sum(rows[:, COLUMNS.index(name)] for name in ENERGIES)
        missing.append(np.abs(total - total[0]).max())
        slid.append(rows[-1, COLUMNS.index("sliding")])
    world.destroy()
    assert missing[0] / missing[1] == pytest.approx(4.0, abs=0.4)
    assert slid[0] == pytest.approx(slid[1], rel=0.2) and abs(slid[1]) > 100 * missing[1]


def test_wall_potential_is_counted_from_the_threshold():
    # A point that comes into reach brings no energy: V0 (exp(-a l) - exp(-a threshold)).
    from taichi_disk.model.world import World

    lattice = disk_and_wall(N, 80, height=0.009)
    physics = Physics(wall="elastic", a=50.0, V0=1.0, threshold=0.01)
    world = World(lattice, physics, moving_down(lattice, 0.0), 1e-3)
    model = Model.of(lattice, physics)
    expected = sum(np.exp(-50.0 * c[4]) - np.exp(-0.5) for c in model.contacts(lattice.positions))
    assert 0.0 < expected < 0.2
    assert world.first_row[COLUMNS.index("wall"), 0] == pytest.approx(expected, rel=1e-12)
    world.destroy()
