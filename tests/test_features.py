"""Model only what a scene needs: which fields exist, which branches are compiled, which numbers are looked at."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from worlds import again

from taichi_disk import load_scene
from taichi_disk.model.parameters import parameters

pytestmark = pytest.mark.usefixtures("taichi")

ALWAYS = {"x", "v", "f", "bond_i", "bond_j", "rest", "sums"}
DASHPOTS = {"u", "eta"}
FACTOR = {"z", "order", "column", "row", "factor", "inverse_diagonal"}
CONTACT = {"disk_surface", "wall_surface"}

SMALL = ("lattice.points=60",)
WALL = (*SMALL, "wall.points=80", "wall.width=3.0")
VV, TRAPEZOIDAL = "velocity_verlet", "trapezoidal"

# scene and settings, integrator, fields beside ALWAYS, compiled features, parameters that are not looked at
CASES = {
    "impact": (
        ("exponential_wall", *SMALL, "material.eta_star=0"),
        VV,
        set(),
        {"cubic", "rigid wall"},
        {"threshold", "V0_at_threshold"},
    ),
    "impact of linear springs": (
        ("exponential_wall", *SMALL, "material.eta_star=0", "material.k_b=0"),
        VV,
        set(),
        {"rigid wall"},
        {"threshold", "V0_at_threshold", "k_b"},
    ),
    "impact with dashpots": (
        ("exponential_wall", *SMALL),
        VV,
        DASHPOTS,
        {"cubic", "rigid wall", "explicit dashpot"},
        {"threshold", "V0_at_threshold"},
    ),
    "impact with implicit dashpots": (
        ("exponential_wall", *SMALL),
        TRAPEZOIDAL,
        DASHPOTS | FACTOR,
        {"cubic", "rigid wall", "implicit dashpot"},
        {"threshold", "V0_at_threshold"},
    ),
    "compression": (
        ("compression", *SMALL),
        VV,
        DASHPOTS | {"load"},
        {"cubic", "rigid wall", "explicit dashpot", "load"},
        {"threshold", "V0_at_threshold"},
    ),
    "absorbing wall, reset": (
        ("absorbing_wall", *WALL),
        VV,
        CONTACT | {"boundary"},
        {"cubic", "elastic wall", "reset boundary"},
        {"reach"},
    ),
    "absorbing wall, pinned": (
        ("absorbing_wall", *WALL, "wall.boundary=pinned", "material.k_b=0"),
        VV,
        CONTACT | {"boundary"},
        {"elastic wall", "pinned boundary"},
        {"reach", "k_b"},
    ),
    "absorbing wall, dashpot": (
        ("absorbing_wall", *WALL, "wall.boundary=dashpot"),
        VV,
        CONTACT | {"boundary", "impedance"},
        {"cubic", "elastic wall", "dashpot boundary"},
        {"reach"},
    ),
    "absorbing wall, dashpot, implicit dashpots": (
        ("absorbing_wall", *WALL, "wall.boundary=dashpot", "material.eta_star=10"),
        TRAPEZOIDAL,
        CONTACT | DASHPOTS | FACTOR | {"boundary", "impedance"},
        {"cubic", "elastic wall", "dashpot boundary", "implicit dashpot"},
        {"reach"},
    ),
}


SLOW = {"impact", "absorbing wall, dashpot", "absorbing wall, pinned"}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.validate if name in SLOW else ()) for name in CASES]
)
def test_a_scene_gets_what_it_needs_and_nothing_else(name, monkeypatch):
    from taichi_disk.model.world import World
    from taichi_disk.scenes import build

    settings, integrator, fields, features, unused = CASES[name]
    setup = build(load_scene(settings[0], settings[1:]))
    world = World(setup.lattice, replace(setup.physics, integrator=integrator), setup.velocities[None], 1e-3)
    world.advance(0)
    assert set(world.fields) == ALWAYS | fields
    assert world.compiled == features

    # What is not needed is not computed: a NaN in its parameters reaches no result.
    def rows():
        again(world, setup.lattice.positions[None] - [0.0, 0.02], setup.velocities[None])
        return np.concatenate([world.first_row[None], world.advance(3, 10)])

    def poisoned(*arguments):
        numbers = parameters(*arguments)
        for one in unused:
            setattr(numbers, one, math.nan)
        return numbers

    expected = rows()
    assert np.isfinite(expected).all()
    monkeypatch.setattr("taichi_disk.model.world.parameters", poisoned)
    np.testing.assert_array_equal(rows(), expected)
    world.destroy()
