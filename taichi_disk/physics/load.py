"""The force that presses the disk on the wall: -P/N on every point of the disk, paper eq. (3)."""

from dataclasses import dataclass

import numpy as np
import taichi as ti

from taichi_disk.lattice import Lattice
from taichi_disk.physics.law import Array, BodyForce


@ti.data_oriented
@dataclass(eq=False)
class Load(BodyForce):
    """A downward force, spread evenly over the disk's points; its potential is P y_cm."""

    force: float  # P in all [M c^2/R]

    scalars = ("force",)

    @ti.func
    def at(self, state: ti.template(), i):
        push = 0.0
        if i < state.n_disk[None]:
            push = self.now.force[None] / state.n_disk[None]
        return ti.Vector([0.0, -push])

    @ti.func
    def potential_at(self, state: ti.template(), i):
        energy = 0.0
        if i < state.n_disk[None]:
            energy = self.now.force[None] * state.x[1][i] / state.n_disk[None]
        return energy

    # ---- the NumPy twin

    def energy(self, lattice: Lattice, x: Array) -> float:
        return self.force * float(x[: lattice.disk_points, 1].mean())

    def forces(self, lattice: Lattice, x: Array) -> Array:
        force = np.zeros_like(x)
        force[: lattice.disk_points, 1] = -self.force / lattice.disk_points
        return force
