"""Between NumPy and the fields: constants in once, states out and in again.

One kernel per direction with NumPy arguments; `to_numpy` of each field would compile a kernel for each.
"""

from dataclasses import dataclass

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.model.sums import SUMS
from taichi_disk.model.vectors import put

Reals1 = ti.types.ndarray(dtype=ti.f64, ndim=1)
Reals2 = ti.types.ndarray(dtype=ti.f64, ndim=2)
Reals3 = ti.types.ndarray(dtype=ti.f64, ndim=3)
Reals4 = ti.types.ndarray(dtype=ti.f64, ndim=4)
Integers1 = ti.types.ndarray(dtype=ti.i32, ndim=1)
Integers2 = ti.types.ndarray(dtype=ti.i32, ndim=2)


@dataclass(frozen=True)
class State:
    """All that a world needs to go on from step `step` with the same bytes.

    vectors: (3, n, 2, lanes) positions [R], velocities before the last kick [c], forces [M c^2/R]; with implicit
        dashpots (4, n, 2, lanes), the last the velocities that were solved for, which the energy ledger needs. In
        single precision positions and velocities are relative to base and frame (see `frame`).
    sums: (8, lanes) dissipated, its power, absorbed, its power, largest force of the wall on a point so far, frame.
    """

    step: int
    vectors: NDArray[np.float64]
    sums: NDArray[np.float64]


class Storage:
    """Copies; part of `World`."""

    @ti.kernel
    def _fill_springs(self, points: ti.i32, ends: Integers2, rest: Reals1):
        """Springs; those that fill up blocks lie at rest between (0, 0) and (1, 0), past the last of `points`."""
        ti.loop_config(serialize=True)
        for b in range(rest.shape[0] // self.block):
            for k in ti.static(range(self.block)):
                self.bond_i[k][b] = ends[b * self.block + k, 0]
                self.bond_j[k][b] = ends[b * self.block + k, 1]
                self.rest[k][b] = rest[b * self.block + k]
        for k in range(2 * self.chunks):
            place = ti.Matrix.zero(self.real, 2, self.lanes)
            put(self.v, points + k, place)
            put(self.f, points + k, place)
            if ti.static(self.physics.dissipates):
                put(self.u, points + k, place)
            if ti.static(not self.single):
                for w in ti.static(range(self.lanes)):
                    place[0, w] = k % 2
            put(self.x, points + k, place)

    @ti.kernel
    def _fill_chunks(self, ends: Integers1):
        for c in range(self.chunks):
            self.chunk_ends[c] = ends[c]

    @ti.kernel
    def _fill_base(self, base: Reals2, span: Reals2):
        ti.loop_config(serialize=True)
        for i in range(base.shape[0]):
            for c in ti.static(range(2)):
                self.base[c][i] = base[i, c]
        for b in range(span.shape[0] // self.block):
            for k in ti.static(range(self.block)):
                for c in ti.static(range(2)):
                    self.span[k][c][b] = span[b * self.block + k, c]

    @ti.kernel
    def _fill_lanes(self, eta: Reals1, load: Reals1):
        for w in ti.static(range(self.lanes)):
            if ti.static(self.physics.dissipates):
                self.eta[w][None] = eta[w]
            if ti.static(self.physics.load != 0.0):
                self.load[w][None] = load[w]

    @ti.kernel
    def _fill_surfaces(self, disk: Integers1, wall: Integers1):
        for k in range(disk.shape[0]):
            self.disk_surface[k] = disk[k]
        for k in range(wall.shape[0]):
            self.wall_surface[k] = wall[k]

    @ti.kernel
    def _fill_boundary(self, points: Integers1, impedance: Reals2):
        for k in range(points.shape[0]):
            self.boundary[k] = points[k]
            if ti.static(self.physics.boundary == "dashpot"):
                for c in ti.static(range(2)):
                    self.impedance[c][k] = impedance[k, c]

    @ti.kernel
    def _fill_factor(
        self,
        order: Integers1,
        column: Integers1,
        row: Integers1,
        values: Reals2,
        inverse_diagonal: Reals2,
    ):
        free = order.shape[0]
        ti.loop_config(serialize=True)
        for k in range(free):
            self.order[k] = order[k]
            self.column[k] = column[k]
            for c in ti.static(range(self.components)):
                self.inverse_diagonal[c][k] = inverse_diagonal[k, c]
        self.column[free] = column[free]
        for e in range(row.shape[0]):
            self.row[e] = row[e]
            for c in ti.static(range(self.components)):
                self.factor[c][e] = values[e, c]

    @ti.kernel
    def _fill_sweeps(self, neighbours: Integers2, iteration: Reals1, outer: Reals2):
        ti.loop_config(serialize=True)
        for i in range(neighbours.shape[0]):
            for k in ti.static(range(self.most_neighbours)):
                self.neighbours[k][i] = neighbours[i, k]
            if ti.static(self.physics.boundary == "dashpot"):
                for c in ti.static(range(2)):
                    self.outer[c][i] = outer[i, c]
        for k in range(self.sweeps + 2):
            self.iteration[k] = iteration[k]

    @ti.kernel
    def _copy_state(self, vectors: Reals4, sums: Reals2, into: ti.template()):
        ti.loop_config(serialize=True)
        for i in range(vectors.shape[1]):
            for w in ti.static(range(self.lanes)):
                for c in ti.static(range(2)):
                    if ti.static(into):
                        self.x[c][w][i] = vectors[0, i, c, w]
                        self.v[c][w][i] = vectors[1, i, c, w]
                        self.f[c][w][i] = vectors[2, i, c, w]
                        if ti.static(self.physics.implicit_dashpot):
                            self.u[c][w][i] = vectors[3, i, c, w]
                    else:
                        vectors[0, i, c, w] = self.x[c][w][i]
                        vectors[1, i, c, w] = self.v[c][w][i]
                        vectors[2, i, c, w] = self.f[c][w][i]
                        if ti.static(self.physics.implicit_dashpot):
                            vectors[3, i, c, w] = self.u[c][w][i]
        for k in ti.static(range(SUMS)):
            for w in ti.static(range(self.lanes)):
                if ti.static(into):
                    self.sums[k][w][0] = sums[k, w]
                else:
                    sums[k, w] = self.sums[k][w][0]
