"""The flight towards the wall, while the body answers linearly to the wall's force: known without a step.

That force grows as exp(r t) with r = a v, so the displacement u does: (K + r^2 m + r D) u = f, K the springs, D the
dashpots, f the force on the body where it would be. One sparse solve holds the slowing down and the deformation.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_disk.lattice import Array, Lattice
from taichi_disk.lattice.triangles import Indices
from taichi_disk.physics import Model
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.observables import INDEX

RESIDUAL = 3e-2  # of the force, to which u is solved for
LINEAR = 1e-3  # of the wall's decay length: by no more does a point yield at the end


class Approach:
    """The straight flight of the disk of `lattice` from its place at t = 0.

    Attributes:
        end: until when the answer is linear [R/c].
    """

    def __init__(self, lattice: Lattice, model: Model, velocities: Array, end: float) -> None:
        """`velocities`: (n, 2), those of the disk all the same, those of the wall 0 [c]."""
        assert model.wall is not None
        self.lattice, self.velocities, disk = lattice, velocities, lattice.disk_points
        rate = self.rate = -float(velocities[0, 1]) / model.wall.decay_length
        force = model.wall.forces(lattice, lattice.positions + end * velocities)
        force[lattice.wall_boundary] = 0.0
        stiffness, inertia = model.springs.stiffness(lattice, lattice.positions, rate), rate**2 * lattice.masses
        u = np.zeros_like(force)
        u[:disk] = force[:disk].sum(axis=0) / (rate**2 * lattice.masses[:disk].sum())  # a rigid body's
        u = _solved(stiffness, inertia, force, u, lattice.wall_boundary)
        yields = max(float(np.abs(u).max()) / (LINEAR * model.wall.decay_length), 1.0)
        self.end, self.u = end - np.log(yields) / rate, u / yields

    def at(self, t: float) -> tuple[Array, Array]:
        """Positions [R] and velocities [c], (n, 2), at a time up to `end`."""
        u = (np.exp(self.rate * (t - self.end)) - np.exp(-self.rate * self.end)) * self.u  # none at t = 0
        return self.lattice.positions + t * self.velocities + u, self.velocities + self.rate * u

    def rows(self, times: Array, after: float, row: Array) -> Array:
        """The observables (times, columns) before the time `after`, at which they are `row` (columns,)."""
        growth, at_start = np.exp(self.rate * (times - after))[:, None], np.exp(-self.rate * after)
        of_wall, squared = np.isin(list(INDEX), ("wall", "wall_force", "residual")), np.array(list(INDEX)) == "elastic"
        growth = np.where(of_wall, growth, (growth - at_start) ** np.where(squared, 2, 1))
        return self._free(times) + growth * (row - self._free(np.array([after])))

    def _free(self, times: Array) -> Array:
        """The observables of the disk without a wall."""
        x, v = self.lattice.positions, self.velocities[0]
        centre, lowest = self.lattice.mean(x), x[: self.lattice.disk_points, 1].min()
        rows = np.zeros((len(times), len(INDEX)))
        for name, at_start, rate in (
            *(("com_x", centre[0], v[0]), ("com_y", centre[1], v[1]), ("lowest_y", lowest, v[1])),
            *(("com_vx", v[0], 0.0), ("com_vy", v[1], 0.0), ("kinetic", 0.5 * float(v @ v), 0.0)),
        ):
            rows[:, INDEX[name]] = at_start + rate * times
        return rows


def _solved(stiffness: Any, inertia: Array, force: Array, start: Array, held: Indices) -> Array:
    """(stiffness + inertia) u = force by conjugate gradients from `start` (n, 2), where the points `held` stay at 0.

    `inertia`: (n,) of each point. Sums are NumPy's, which do not depend on how many threads a BLAS has.
    """

    def resistance(u: Array) -> Array:
        against = (stiffness @ u.ravel()).reshape(-1, 2) + inertia[:, None] * u
        against[held] = 0.0
        return np.asarray(against)

    u, residual = start, force - resistance(start)
    move, left = residual, float((residual**2).sum())
    goal = RESIDUAL**2 * float((force**2).sum())
    while left > goal:
        raise_if_interrupted()
        against = resistance(move)
        part = left / float((move * against).sum())
        u, residual = u + part * move, residual - part * against
        left, before = float((residual**2).sum()), left
        move = residual + left / before * move
    return u
