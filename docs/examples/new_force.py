"""A force of your own: a trap that pulls every point of the disk back to x = 0.

python docs/examples/new_force.py
"""

from dataclasses import replace
from typing import Any

import numpy as np

from taichi_disk import load_scene
from taichi_disk.base import runtime
from taichi_disk.base.engine import ti
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.mechanics import Array, BodyForce, Lattice


@ti.data_oriented
class Trap(BodyForce):
    """A force -(k/n) x on each of n points [M c^2/R]; its potential is k x^2/(2 n)."""

    scalars = ("k",)
    k_now: Any  # the field that kernels read: another k needs no new compilation

    def __init__(self, k: float) -> None:
        self.k = k

    @ti.func
    def at(self, state: ti.template(), i):  # type: ignore
        return ti.Vector([-self.k_now[None] * state.x[0][i] / state.n[None], 0.0])

    @ti.func
    def potential_at(self, state: ti.template(), i):  # type: ignore
        return 0.5 * self.k_now[None] * state.x[0][i] ** 2 / state.n[None]

    # The same in NumPy, for tests, pictures and Newton's method.

    def energy(self, lattice: Lattice, x: Array) -> float:
        return 0.5 * self.k * float((x[:, 0] ** 2).mean())

    def forces(self, lattice: Lattice, x: Array) -> Array:
        return np.asarray(x * [-self.k / len(x), 0.0])


runtime.start()
scene = load_scene("exponential_wall").with_(points=200, eta_star=0)
scenario = scene.scenario()
scenario = replace(
    scenario,
    model=replace(scenario.model, others=(Trap(k=0.05),)),
    velocities=scenario.velocities + [0.01, 0.0],  # across the trap
)
outcome = compute(scenario)

t, x = outcome.series["t"], outcome.series["com_x"]
angle = np.sqrt(0.05) * t  # phase of an oscillator with k = 0.05 and the mass 1
oscillator = x[0] * np.cos(angle) + 0.01 / np.sqrt(0.05) * np.sin(angle)
print(
    f"the centre of mass is off an oscillator by {np.abs(x - oscillator).max():.1e} R"
)
print(f"e = {scenario.result(outcome.series)['restitution']:.5f}")
print(f"energy imbalance {outcome.summary['energy']['closing_imbalance']:.1e}")
