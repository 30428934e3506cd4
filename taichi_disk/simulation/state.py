"""The points of one simulation in Taichi fields, and copies of them in NumPy."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti

from taichi_disk.integrators import Integrator
from taichi_disk.lattice import Array
from taichi_disk.physics.law import Law, Room
from taichi_disk.physics.points import Integers1, Reals1, Reals3, pair_of
from taichi_disk.simulation.observables import SUMS


@dataclass(frozen=True)
class Snapshot:
    """All that a simulation needs to go on from step `step`, bitwise as it would have.

    Attributes:
        vectors: (3 or 4, n, 2) positions [R], velocities before the last kick [c], forces [M c^2/R]; with dashpots
            also the velocities at the step, predicted or solved for.
        sums: (SUMS,) dissipated, its power, absorbed, its power, largest force of the wall on a point, sliding.
    """

    step: int
    vectors: Array
    sums: Array

    def velocities(self, integrator: Integrator, dt: float, mass: float) -> Array:
        """(n, 2) at the step, after its last kick [c]."""
        _, v, f = self.vectors[:3]
        return np.asarray(v + integrator.kicks[-1] * dt / mass * f)


@ti.data_oriented
class State:
    """Fields of the points (`x`, `v`, `f`, `u`: see `Snapshot`), and 0-D fields of the numbers that every kernel needs.

    `h`: time step; `m`: mass of a point; `g`: h/m; `closing`: what a step's last kick takes the force by, h/(2 m) in
    leapfrog; `n`, `n_disk`: points, those of the disk; `reset_steps`: steps between two resets of the boundary.
    """

    def __init__(self, builder: Any, room: Room, subdomains: int, damped: bool) -> None:
        self.fillers = 2 * subdomains  # points that carry the springs that fill up blocks
        filled = room.points + self.fillers
        self.x, self.v, self.f = (pair_of(builder, filled) for _ in range(3))
        self.vectors = [self.x, self.v, self.f]
        if damped:
            self.u = pair_of(builder, filled)
            self.vectors.append(self.u)
        self.reals = self.h, self.m, self.g, self.closing, self.contact = [ti.field(ti.f64) for _ in range(5)]
        self.counts = [ti.field(ti.i32) for _ in range(5)]
        self.n, self.n_disk, self.blocks, self.subdomain_points, self.reset_steps = self.counts
        builder.place(*self.reals)
        builder.place(*self.counts)
        self.sums = ti.field(ti.f64)
        builder.dense(ti.i, SUMS).place(self.sums)

    def set_numbers(self, reals: Sequence[float], counts: Sequence[int], laws: Sequence[Law]) -> None:
        """Write `reals` and `counts` in the order above, and the scalars of the `laws` (the same in every call)."""
        scalars = [(law, name) for law in laws for name in law.scalars]
        self.numbers = [*self.reals, *(getattr(law.now, name) for law, name in scalars)]
        self._set(np.array([*reals, *(getattr(law, name) for law, name in scalars)]), np.array(counts, np.int32))

    @ti.kernel
    def _set(self, numbers: Reals1, counts: Integers1):
        for k in ti.static(range(len(self.numbers))):
            self.numbers[k][None] = numbers[k]
        for k in ti.static(range(len(self.counts))):
            self.counts[k][None] = counts[k]
        # Springs that fill up blocks lie at rest between (0, 0) and (1, 0), past the last point.
        ti.loop_config(serialize=True)
        for k in range(self.fillers):
            i = counts[0] + k  # n; a field written in this kernel may be read as before
            for pair in ti.static(self.vectors):
                for c in ti.static(range(2)):
                    pair[c][i] = 0.0
            self.x[0][i] = k % 2

    def export(self, n: int, step: int) -> Snapshot:
        vectors, sums = np.zeros((len(self.vectors), n, 2)), np.zeros(SUMS)
        self._copy(vectors, sums, False)
        return Snapshot(step, vectors, sums)

    def restore(self, snapshot: Snapshot) -> None:
        self._copy(snapshot.vectors, snapshot.sums, True)

    @ti.kernel
    def _copy(self, vectors: Reals3, sums: Reals1, into: ti.template()):
        ti.loop_config(serialize=True)
        for i in range(vectors.shape[1]):
            for k in ti.static(range(len(self.vectors))):
                for c in ti.static(range(2)):
                    if ti.static(into):
                        self.vectors[k][c][i] = vectors[k, i, c]
                    else:
                        vectors[k, i, c] = self.vectors[k][c][i]
        for k in range(SUMS):
            if ti.static(into):
                self.sums[k] = sums[k]
            else:
                sums[k] = self.sums[k]
