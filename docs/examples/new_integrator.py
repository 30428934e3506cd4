"""An integrator of your own: Forest and Ruth's composition of three leapfrog steps,
order 4 (Physica D 43, 105, 1990).

In the project: an entry of INTEGRATORS in taichi_disk/mechanics/integrators; scenes may
    then name it.

python docs/examples/new_integrator.py
"""

from typing import Any

import numpy as np

from taichi_disk import load_scene
from taichi_disk.base import runtime
from taichi_disk.mechanics import Integrator, Simulation

THETA = 1.0 / (2.0 - 2.0 ** (1.0 / 3.0))
FOREST_RUTH = Integrator(
    name="forest_ruth",
    order=4,
    kicks=(THETA / 2, (1 - THETA) / 2, (1 - THETA) / 2, THETA / 2),
    moves=(THETA, 1 - 2 * THETA, THETA),
    stable=1.573,
    dashpots="none",
)

runtime.start()
scenario: Any = load_scene("exponential_wall").with_(points=200, eta_star=0).scenario()


def velocity_at(time: float, steps: int) -> float:
    """Return the velocity of the centre of mass after `time` [R/c], computed in `steps`
    steps."""
    simulation = Simulation(
        scenario.lattice, scenario.model, FOREST_RUTH, scenario.velocities, time / steps
    )
    simulation.advance(steps, steps)
    return float(simulation.velocities()[:, 1].mean())


found = [velocity_at(7.0, steps) for steps in (400, 800, 1600)]
order = np.log2(abs(found[0] - found[1]) / abs(found[1] - found[2]))
print(
    f"v_cm = {found[-1]:.9f} c after 7 R/c; halving the step twice shows order"
    f" {order:.2f}"
)
