"""A hand that pulls one point towards a place: a spring whose force does not grow beyond a limit.

It derives from a potential, U = k r^2/2, and F r - F^2/(2 k) beyond r = F/k, so that what a hand gives the disk is
what U jumps by when the hand takes hold, moves or lets go.
"""

import taichi as ti

from taichi_disk.model.parameters import Parameters, rounded
from taichi_disk.model.vectors import get, put


class Hand:
    """The pull of `Physics.pulled`; part of `World`. `hand` holds the point (-1: none), its target, k and F."""

    @ti.func
    def pull_of_hand(self, p: ti.template(), w: ti.template(), sums):
        """The point pulled, the force on it [M c^2/R] and the potential [M c^2] in lane w."""
        hand = get(self.hand, 0)
        i = ti.cast(hand[0], ti.i32)
        force = ti.Vector.zero(self.real, 2)
        energy = ti.cast(0.0, self.real)
        if i >= 0:
            d = ti.Vector([hand[1] - self.place(p, i, 0, w, sums), hand[2] - self.place(p, i, 1, w, sums)])
            r, k, most = d.norm(), hand[3], hand[4]
            force = k * d
            energy = 0.5 * k * r * r
            if k * r > most:
                force = (most / r) * d
                energy = most * (r - 0.5 * most / k)
        return i, force, energy

    @ti.func
    def add_pull_of_hand(self, p: ti.template(), sums):
        """Add the force to `f`; returns the potential per lane."""
        potential = ti.Vector.zero(self.real, self.lanes)
        for w in ti.static(range(self.lanes)):
            i, force, energy = self.pull_of_hand(p, w, sums)
            if i >= 0:
                self.f[0][w][i] += force[0]
                self.f[1][w][i] += force[1]
            potential[w] = energy
        return potential

    @ti.func
    def change_hand(self, p: ti.template(), factor, sums):
        """Add `factor` times the pull to the forces at this step, and leave positions and velocities as they are.

        Half a step's kick lies before this moment and half behind it: only the second changes.
        """
        total = ti.cast(0.0, self.real)
        for w in ti.static(range(self.lanes)):
            i, force, energy = self.pull_of_hand(p, w, sums)
            if i >= 0:
                for c in ti.static(range(2)):
                    self.f[c][w][i] += factor * force[c]
                    self.v[c][w][i] -= factor * p.closing * force[c]
            total += factor * energy
        return total

    @ti.kernel
    def _take_hold(
        self, numbers: Parameters, point: ti.i32, x: ti.f64, y: ti.f64, stiffness: ti.f64, strongest: ti.f64
    ) -> ti.f64:
        """The hand pulls `point` (-1: none) towards (x, y) from now on; returns the energy given by that [M c^2]."""
        p = rounded(numbers) if ti.static(self.single) else numbers
        sums = get(self.sums, 0)
        given = self.change_hand(p, -1.0, sums)
        put(self.hand, 0, ti.Vector([point, x, y, stiffness, strongest], dt=self.real))
        given += self.change_hand(p, 1.0, sums)
        return given
