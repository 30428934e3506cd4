"""The pull of a hand at one point: against DOP853, at every strength of the dashpots, and in the energy ledger."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from reference import Model
from worlds import disk

from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Physics

pytestmark = pytest.mark.usefixtures("taichi")

K, STRONGEST = 0.2, 0.02
# Beyond STRONGEST/K = 0.1 R from its target the pull stays what it is: (target beside the point, steps).
LED = (((0.05, 0.02), 24), ((0.3, 0.1), 24))


@dataclass
class Pulled(Model):
    point: int = -1
    target: np.ndarray | None = None

    def force(self, x, v):
        f = super().force(x, v)
        if self.target is not None:
            d = self.target - x[self.point]
            f[self.point] += d * min(K, STRONGEST / np.hypot(*d))
        return f


def led(world, x, v, steps: int) -> tuple[float, np.ndarray, np.ndarray]:
    """The energy that the hand gives, and positions and observables at the end; LED in `steps` times as many steps."""
    point = 7
    given = 0.0
    for beside, count in LED:
        given += world.take_hold(point, tuple(x[point] + beside), K, STRONGEST)
        row = world.advance(1, count * steps)
    given += world.take_hold(-1, (0.0, 0.0), 0.0, 0.0)
    row = world.advance(1, 24 * steps)
    return given, world.positions()[0], row[0, :, 0]


@pytest.mark.parametrize(
    ("eta", "integrator"),
    [
        (0.0, "velocity_verlet"),
        # Overdamped: eta times the largest eigenvalue of the Laplacian over m is 14 times the inverse step.
        (1.0, "trapezoidal"),
        pytest.param(0.1, "velocity_verlet", marks=pytest.mark.validate),
        pytest.param(0.0, "vefrl", marks=pytest.mark.validate),
    ],
)
def test_a_pulled_point_moves_as_the_exact_solution_and_its_energy_is_accounted_for(eta, integrator):
    from taichi_disk.model.world import World

    lattice = disk(60, height=0.5)
    physics = Physics(eta=eta, integrator=integrator, pulled=True)
    x, v = lattice.positions, np.zeros_like(lattice.positions)
    dt = 0.02 if eta != 0.1 else 0.004
    model = Pulled(**{**vars(Model.of(lattice, physics)), "point": 7})
    y = x, v
    for beside, count in (*LED, (None, 24)):
        model.target = None if beside is None else x[7] + np.array(beside)
        y = model.solve(*y, count * dt)
    world, errors, open_energy = None, [], []
    for steps in (1, 2, 4):
        if world is None:
            world = World(lattice, physics, v[None], dt)
        else:
            assert world.restart(lattice, physics, v[None], dt / steps)
        given, places, row = led(world, x, v, steps)
        row = dict(zip(COLUMNS, row, strict=True))
        errors.append(np.abs(places - y[0]).max())
        energy = sum(row[name] for name in ("kinetic", "elastic", "load", "dissipated"))
        open_energy.append(abs(energy - given) / given)
    world.destroy()
    order = 4 if integrator == "vefrl" else 2
    assert errors[-1] < 2e-3 * np.abs(y[0] - x).max()
    assert errors[1] < errors[0] / 0.8 / 2**order and errors[2] < errors[1] / 0.8 / 2**order
    assert open_energy[-1] < 2e-3


def test_a_world_whose_hand_pulls_at_nothing_gives_the_same_bytes():
    from taichi_disk.model.world import World

    lattice = disk(60, height=0.05)
    v = np.tile([0.0, -0.05], (1, 60, 1))
    rows = []
    for pulled in (False, True):
        world = World(lattice, Physics(wall="rigid", pulled=pulled), v, 5e-3)
        assert world.uses("pull of a hand") == pulled
        rows.append(world.advance(20, 20))
        world.destroy()
    np.testing.assert_array_equal(*rows)
