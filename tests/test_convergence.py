"""The order in the time step, in every scene and with every integrator, against DOP853 on the same lattice.

The largest error of any position after a fixed time, at steps h and h/2: log2 of their ratio is the order. The
whole state is compared, not only e, so that no error can hide in an average.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from reference import Model
from worlds import again, disk, disk_and_wall, matched, moving_down

from taichi_disk.model.physics import Physics

pytestmark = pytest.mark.usefixtures("taichi")

N = 60
END = 1.92  # [R/c] amid the contact
ETA = 100.0 / N  # eta* = 100
VV, TRAPEZOIDAL, VEFRL = "velocity_verlet", "trapezoidal", "vefrl"
WAYS = [(0.0, VV), (ETA, VV), (ETA, TRAPEZOIDAL), (0.0, VEFRL)]
RESET = 0.12  # [R/c]

_solved: dict[tuple[str, float], np.ndarray] = {}


def build(scene, eta):
    """Lattice, velocities, physics and the interval of resets of one scene, just above the wall."""
    if scene == "compression":
        return disk(N, height=0.045), None, Physics(k_b=1.0, eta=eta, wall="rigid", load=0.05)
    if scene == "exponential wall":
        return disk(N, height=0.05), 0.05, Physics(k_b=1.0, eta=eta, wall="rigid")
    lattice = disk_and_wall(N, 80, height=0.05)
    physics = Physics(k_b=1.0, eta=eta, wall="elastic")
    if scene == "matched":
        return lattice, 0.05, matched(lattice, physics)
    if scene == "pinned":
        return lattice, 0.05, replace(physics, boundary="pinned")
    return lattice, 0.05, replace(physics, boundary="reset", reset_interval=RESET)


def reference(scene, eta, lattice, velocities, physics):
    if (scene, eta) not in _solved:
        model = Model.of(lattice, physics)
        interval = physics.reset_interval or None
        _solved[scene, eta] = model.solve(lattice.positions, velocities[0], END, rtol=1e-10, reset_interval=interval)
    return _solved[scene, eta]


def errors(scene, eta, integrator, steps):
    """Largest error of a position [R] and of a velocity [c] at END, for each number of steps."""
    from taichi_disk.model.world import World

    lattice, speed, physics = build(scene, eta)
    velocities = moving_down(lattice, speed or 0.0)
    if physics.wall == "rigid":
        # A shear, so that no symmetry helps. Over an elastic wall it would make contacts pass from spring to spring,
        # where the force jumps a little and no integrator has an order.
        velocities[0, :, 0] += 0.02 * lattice.positions[:, 1]
    x, v = reference(scene, eta, lattice, velocities, physics)
    world, found = None, []
    for count in steps:
        if world is None or physics.reset_interval:
            world = World(lattice, replace(physics, integrator=integrator), velocities, END / count)
        else:
            again(world, lattice.positions[None], velocities, END / count)
        world.advance(1, count)
        found.append([np.abs(world.positions()[0] - x).max(), np.abs(world.velocities()[0] - v).max()])
    world.destroy()
    return np.array(found)


def steps_for(scene, eta, integrator):
    # Explicit dashpots at eta* = 100 need h < 1.7e-3 R/c. Where a reset is hidden in a step is part of the
    # problem: its interval is a whole number of steps in each case.
    coarse = 192 if integrator == VEFRL else 2400 if (eta and integrator == VV) else 960
    return [coarse, 2 * coarse]


FAST = {
    ("exponential wall", 0.0, VV),
    ("exponential wall", 0.0, VEFRL),
    ("exponential wall", ETA, TRAPEZOIDAL),
    ("compression", ETA, VV),
    ("reset", 0.0, VV),
    ("reset", 0.0, VEFRL),
    ("matched", ETA, TRAPEZOIDAL),
}
SCENES = ["compression", "exponential wall", "reset", "pinned", "matched"]
CASES = [(scene, *way) for scene in SCENES for way in WAYS if (scene, way[1]) != ("matched", VEFRL)]


@pytest.mark.parametrize(
    ("scene", "eta", "integrator"),
    [pytest.param(*case, marks=() if case in FAST else pytest.mark.validate) for case in CASES],
)
def test_errors_fall_with_the_order_of_the_integrator(scene, eta, integrator):
    found = errors(scene, eta, integrator, steps_for(scene, eta, integrator))
    order = 4.0 if integrator == VEFRL else 2.0
    np.testing.assert_allclose(np.log2(found[0] / found[1]), order, atol=0.05)
    # At h ~ 1e-3 R/c, 2 per cent of the stability limit, h^2 omega^2/24 ~ 1e-4 of the amplitudes. At h = 5e-3 order 4
    # leaves h^4 omega^4 times its own constant, 9e-4 (phase error of an oscillator), a hundred times less.
    assert found[1, 0] < (2e-8 if integrator == VEFRL else 2e-6)
    assert found[1, 1] < (1e-6 if integrator == VEFRL else 1e-4)
