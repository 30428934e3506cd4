"""A spring from one point to the mouse, whose pull does not grow beyond a limit.

It derives from a potential, U = k r^2/2, and F r - F^2/(2 k) beyond r = F/k, so that the energy that a person gives
the disk is what U jumps by when the spring is tied, led elsewhere or untied.
"""

from dataclasses import dataclass
from typing import Any

import taichi as ti

from taichi_disk.lattice import Lattice
from taichi_disk.physics.law import Law, Room
from taichi_disk.physics.points import get, pair_of, put


@ti.data_oriented
@dataclass(eq=False)
class MouseSpring(Law):
    """Pulls at most one point; see `Simulation.set_mouse_target`."""

    k: float  # spring constant [M c^2/R^2]
    strongest: float  # its largest pull F [M c^2/R]

    scalars = ("k", "strongest")

    def place(self, builder: Any, room: Room) -> None:
        super().place(builder, room)
        # Written and read in one kernel: Taichi 1.7.4 would hand a later reader of a 0-D field the value from before.
        self.target = pair_of(builder, 1)
        self.point = ti.field(ti.i32)  # -1: none
        builder.dense(ti.i, 1).place(self.point)

    def fill(self, lattice: Lattice) -> None:
        self.point[0] = -1

    @ti.func
    def pull(self, state: ti.template()):
        """The point pulled (-1: none), the force on it [M c^2/R] and the potential [M c^2]."""
        i = self.point[0]
        force = ti.Vector([0.0, 0.0])
        energy = 0.0
        if i >= 0:
            d = get(self.target, 0) - get(state.x, i)
            r, k, most = d.norm(), self.now.k[None], self.now.strongest[None]
            force = k * d
            energy = 0.5 * k * r * r
            if k * r > most:
                force = (most / r) * d
                energy = most * (r - 0.5 * most / k)
        return i, force, energy

    @ti.func
    def add(self, state: ti.template()):
        """Add the pull to the forces."""
        i, force, _energy = self.pull(state)
        if i >= 0:
            put(state.f, i, get(state.f, i) + force)

    @ti.func
    def change(self, state: ti.template(), factor):
        """Add `factor` times the pull to the forces at this step, and leave positions and velocities as they are.

        Half a step's kick lies before this moment and half behind it: only the second changes. Returns `factor` times
        the potential.
        """
        i, force, energy = self.pull(state)
        if i >= 0:
            put(state.f, i, get(state.f, i) + factor * force)
            put(state.v, i, get(state.v, i) - factor * state.closing[None] * force)
        return factor * energy
