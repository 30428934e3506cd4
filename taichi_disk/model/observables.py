"""What is measured at a sample, inside the kernel: the disk's motion and where the energy is."""

import taichi as ti

from taichi_disk.model.sums import ABSORBED, DISSIPATED, SLIDING, SPEED

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
        for w in ti.static(range(self.lanes)):
            zero = ti.cast(0.0, ti.f64)
            sx, sy, svx, svy, spin, v2 = zero, zero, zero, zero, zero, zero
            lowest, residual2 = ti.cast(self.place(0, 1, w, sums), ti.f64), zero
            force, energy = ti.cast(upward[w], ti.f64), ti.cast(potential[w], ti.f64)
            for i in range(self.n):
                x = ti.cast(self.place(i, 0, w, sums), ti.f64)
                y = ti.cast(self.place(i, 1, w, sums), ti.f64)
                fx, fy = self.f[0][w][i], self.f[1][w][i]
                vx = ti.cast(self.v[0][w][i] + p.closing * fx, ti.f64)
                vy = ti.cast(self.v[1][w][i] + p.closing * fy, ti.f64)
                if i < self.n_disk:
                    if ti.static(self.single):
                        vy += sums[SPEED, w]
                    sx += x
                    sy += y
                    svx += vx
                    svy += vy
                    spin += x * vy - y * vx
                    lowest = ti.min(lowest, y)
                    residual2 = ti.max(residual2, ti.cast(fx * fx + fy * fy, ti.f64))
                    if ti.static(self.physics.wall == "rigid"):
                        if y < p.reach:
                            e = p.V0 * ti.exp(-p.a * ti.cast(y, self.real))
                            energy += e
                            force += p.a * e
                v2 += vx * vx + vy * vy
            count = ti.cast(self.n_disk, ti.f64)
            rows[s, 0, w] = sx / count
            rows[s, 1, w] = sy / count
            rows[s, 2, w] = svx / count
            rows[s, 3, w] = svy / count
            rows[s, 4, w] = p.m * (spin - (sx * svy - sy * svx) / count)
            rows[s, 5, w] = lowest
            rows[s, 6, w] = force
            rows[s, 7, w] = 0.5 * p.m * v2
            rows[s, 8, w] = elastic[w]
            rows[s, 9, w] = energy
            rows[s, 10, w] = sums[DISSIPATED, w]
            rows[s, 11, w] = sums[ABSORBED, w]
            load = zero
            if ti.static(self.physics.load != 0.0):
                load = self.load[w][None] * sy / count
            if ti.static(self.physics.pulled):
                _i, _force, pull = self.pull_of_hand(w, sums)
                load += pull
            rows[s, 12, w] = load
            rows[s, 13, w] = sums[SLIDING, w]
            rows[s, 14, w] = ti.sqrt(residual2)
