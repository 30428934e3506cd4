"""What is measured at a sample, inside the kernel: the disk's motion and where the energy is."""

import taichi as ti

from taichi_disk.model.sums import ABSORBED, DISSIPATED, SLIDING, SPEED
from taichi_disk.model.vectors import get

COLUMNS = (
    "com_x",  # the disk's centre of mass [R]
    "com_y",
    "com_vx",  # [c]
    "com_vy",
    "angular_momentum",  # of the disk about its centre of mass [M R c]
    "lowest_y",  # of the disk [R]
    "wall_force",  # upward force of the wall on the disk [M c^2/R]
    "kinetic",  # of disk and elastic wall [M c^2]
    "elastic",
    "wall",  # potential of the contact
    "dissipated",  # by dashpots since t = 0
    "absorbed",  # by the elastic wall's boundary since t = 0
    "load",  # potential P y_cm of the pressing force, and that of a pulling hand
    "sliding",  # what points lost by passing from one spring of the elastic wall to the next, since t = 0
    "residual",  # largest |force| on a point [M c^2/R]
)


class Observables:
    """Fills one row of observables; part of `World`."""

    @ti.func
    def observe(self, p: ti.template(), rows: ti.template(), s, sums, elastic, upward, potential):
        zero = ti.Vector.zero(ti.f64, self.lanes)
        sx, sy, svx, svy, spin, v2, residual2 = zero, zero, zero, zero, zero, zero, zero
        force, energy = self.in_double(upward), self.in_double(potential)
        lowest = self.coordinates(p, 0, 1, sums)
        for i in range(p.n):
            x, y = self.coordinates(p, i, 0, sums), self.coordinates(p, i, 1, sums)
            fx, fy = get(self.f[0], i), get(self.f[1], i)
            vx = self.in_double(get(self.v[0], i) + p.closing * fx)
            vy = self.in_double(get(self.v[1], i) + p.closing * fy)
            if i < p.n_disk:
                if ti.static(self.single):
                    vy += ti.Vector([sums[SPEED, w] for w in range(self.lanes)])
                sx += x
                sy += y
                svx += vx
                svy += vy
                spin += x * vy - y * vx
                lowest = ti.min(lowest, y)
                residual2 = ti.max(residual2, self.in_double(fx * fx + fy * fy))
                if ti.static(self.physics.wall == "rigid"):
                    if y.min() < p.reach:
                        for w in ti.static(range(self.lanes)):
                            if y[w] < p.reach:
                                e = p.V0 * ti.exp(-p.a * ti.cast(y[w], self.real))
                                energy[w] += e
                                force[w] += p.a * e
            v2 += vx * vx + vy * vy
        count = ti.cast(p.n_disk, ti.f64)
        for w in ti.static(range(self.lanes)):
            rows[s, 0, w] = sx[w] / count
            rows[s, 1, w] = sy[w] / count
            rows[s, 2, w] = svx[w] / count
            rows[s, 3, w] = svy[w] / count
            rows[s, 4, w] = p.m * (spin[w] - (sx[w] * svy[w] - sy[w] * svx[w]) / count)
            rows[s, 5, w] = lowest[w]
            rows[s, 6, w] = force[w]
            rows[s, 7, w] = 0.5 * p.m * v2[w]
            rows[s, 8, w] = elastic[w]
            rows[s, 9, w] = energy[w]
            rows[s, 10, w] = sums[DISSIPATED, w]
            rows[s, 11, w] = sums[ABSORBED, w]
            load = ti.cast(0.0, ti.f64)
            if ti.static(self.physics.load != 0.0):
                load = self.load[w][None] * sy[w] / count
            if ti.static(self.physics.pulled):
                _i, _force, pull = self.pull_of_hand(p, w, sums)
                load += pull
            rows[s, 12, w] = load
            rows[s, 13, w] = sums[SLIDING, w]
            rows[s, 14, w] = ti.sqrt(residual2[w])

    @ti.func
    def coordinates(self, p: ti.template(), i, c: ti.template(), sums):
        """Coordinate c of point i in every lane, in double precision [R]."""
        return self.in_double(ti.Vector([self.place(p, i, c, w, sums) for w in range(self.lanes)]))

    @ti.func
    def in_double(self, vector):
        return ti.Vector([ti.cast(vector[w], ti.f64) for w in range(self.lanes)])
