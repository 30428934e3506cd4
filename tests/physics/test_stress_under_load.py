"""The stress of a disk at rest: what it transmits, and Hertz's pressure."""

import numpy as np
import pytest

from taichi_disk.mechanics.fields import Triangles, stress
from taichi_disk.mechanics.lattice import Lattice, bulk_moduli
from taichi_disk.mechanics.physics import ExponentialWall, Load, Model, Springs
from taichi_disk.mechanics.statics.equilibrium import (
    place_on_wall,
    resting_angle,
    solve_equilibrium,
)


def pressed(points, seed, a, pressure):
    """Return lattice, model and positions of a disk at rest."""
    disk = Lattice.disk(points, seed)
    wall = ExponentialWall(a, 150.0)
    model = Model(Springs(1.0, 1e-3), wall, Load(pressure))
    start = place_on_wall(
        disk, resting_angle(disk, 1.0, a, pressure), wall, pressure
    ).positions
    return disk, model, solve_equilibrium(disk, model, start).positions


@pytest.mark.parametrize("height", [0.5, 1.0, 1.5])
def test_each_level_carries_the_load_of_what_is_above_it(height):
    load = 1e-2
    half = 0.15
    disk, model, x = pressed(1099, 0, 300.0, load)
    tiles = Triangles(disk)
    centre = x[disk.triangles].mean(axis=1)[:, 1] - x[:, 1].min()
    strip = np.abs(centre - height) < half
    downwards = -(tiles.areas(x) * stress(tiles, model.springs, x)[:, 1])[
        strip
    ].sum() / (2.0 * half)
    above = load * (x[:, 1] - x[:, 1].min() > height).mean()
    assert downwards == pytest.approx(above, abs=0.03 * load)


@pytest.mark.validate
def test_the_contact_is_as_wide_as_hertz_says():
    """The half width is b = sqrt(4 P R/(pi E)) of p = 2P/(pi b) sqrt(1 - x^2/b^2),
    whose second moment is P b^2/4."""
    load = 0.03
    disk, model, x = pressed(8_800, 0, 30_000.0, load)
    young = bulk_moduli(8_800, 0, 1.0, 0.7).young
    b = np.sqrt(4.0 * load / (np.pi * young))
    points, forces = model.wall.contact_forces(disk, x)
    place = x[points, 0]
    push = forces[:, 1]
    middle = np.average(place, weights=push)
    assert push.sum() == pytest.approx(load, rel=1e-9)
    assert 2.0 * np.sqrt(
        np.average((place - middle) ** 2, weights=push)
    ) == pytest.approx(b, rel=0.03)
    # The stress just inside the contact scatters by some per cent.
    inner = np.hypot(x[:, 0] - middle, x[:, 1] - x[:, 1].min()) < 0.5 * b
    tiles = Triangles(disk)
    near = inner[disk.triangles].all(axis=1)
    areas = tiles.areas(x)[near]
    corner = x[disk.triangles[near]].mean(axis=1)
    depth = (corner[:, 1] - x[:, 1].min()) / b
    across = (corner[:, 0] - middle) / b
    found = np.average(-stress(tiles, model.springs, x)[near, 1], weights=areas)
    assert found == pytest.approx(
        np.average(_hertz(across, depth), weights=areas) * 2.0 * load / (np.pi * b),
        rel=0.08,
    )


def _hertz(x, z):
    """Return the pressure over its peak at (x, z) half widths, by Flamant's loads."""
    s = np.linspace(-1.0, 1.0, 4001)
    load = np.sqrt(1.0 - s**2)
    d = x[:, None] - s
    return (load * 2.0 / np.pi * z[:, None] ** 3 / (d**2 + z[:, None] ** 2) ** 2).mean(
        axis=1
    ) * 2.0
