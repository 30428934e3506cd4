"""A spring from one point to the mouse, whose pull does not grow beyond a limit.

It derives from a potential, f r - f^2/(2 k) with the pull f = min(k r, F), so that the energy that a person gives the
disk is what the potential jumps by when the spring is tied, led elsewhere or untied.
"""

from dataclasses import dataclass
from typing import Any

import taichi as ti

from taichi_disk.lattice import Lattice
from taichi_disk.physics.law import BodyForce, Room
from taichi_disk.physics.points import get, pair_of, put


@ti.data_oriented
@dataclass(eq=False)
class MouseSpring(BodyForce):
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
    def at(self, state: ti.template(), i):
        force = ti.Vector([0.0, 0.0])
        if i == self.point[0]:
            k, most, d = self.now.k[None], self.now.strongest[None], get(self.target, 0) - get(state.x, i)
            force = (k * most / ti.max(most, k * d.norm())) * d
        return force

    @ti.func
    def potential_at(self, state: ti.template(), i):
        energy = 0.0
        if i == self.point[0]:
            k, r = self.now.k[None], (get(self.target, 0) - get(state.x, i)).norm()
            pull = ti.min(k * r, self.now.strongest[None])
            energy = pull * (r - 0.5 * pull / k)
        return energy

    @ti.func
    def change(self, state: ti.template(), factor):
        """Add `factor` times the pull to the forces at this step, and leave positions and velocities as they are.

        Half a step's kick lies before this moment and half behind it: only the second changes. Returns `factor` times
        the potential.
        """
        i = self.point[0]
        energy = 0.0
        if i >= 0:
            force = factor * self.at(state, i)
            energy = factor * self.potential_at(state, i)
            put(state.f, i, get(state.f, i) + force)
            put(state.v, i, get(state.v, i) - state.closing[None] * force)
        return energy
