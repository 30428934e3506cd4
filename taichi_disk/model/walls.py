"""The two walls: a rigid exponential one (paper eqs. 3 and 6) and an elastic lattice (paper section 5)."""

import taichi as ti


class Walls:
    """What the disk touches; part of `World`."""

    @ti.func
    def rigid_wall_force(self, p: ti.template(), y):
        """a V0 exp(-a y) of one point in every lane; zero, without an exponential, where all are out of reach."""
        force = ti.Vector.zero(self.real, self.lanes)
        if y.min() < p.reach:
            for w in ti.static(range(self.lanes)):
                if y[w] < p.reach:
                    force[w] = p.a * p.V0 * ti.exp(-p.a * y[w])
        return force

    @ti.func
    def add_contact_forces(self, p: ti.template(), move, sums):
        """Push every surface point of the disk off the wall spring below it: a V0 exp(-a l) n.

        l is the distance along the spring's normal n. The spring's two ends take the reaction by the lever
        rule, which balances force and torque and makes the force the gradient of V0 exp(-a l) while the point
        stays over one spring. The potential is shifted to be zero at the threshold, so that coming into reach
        adds no energy. Returns per lane the upward force on the disk [M c^2/R], the potential [M c^2], the largest
        force on one point, and what points lost by sliding in the last move, `move` times the velocity (`slid`).
        """
        upward = ti.Vector.zero(self.real, self.lanes)
        potential = ti.Vector.zero(self.real, self.lanes)
        highest = ti.Vector.zero(self.real, self.lanes)
        slid = ti.Vector.zero(self.real, self.lanes)
        for w in ti.static(range(self.lanes)):
            top = self.place(p, self.wall_surface[0], 1, w, sums)
            for k in range(1, p.n_wall_surface):
                top = ti.max(top, self.place(p, self.wall_surface[k], 1, w, sums))
            last = p.n_wall_surface - 2
            left = self.place(p, self.wall_surface[0], 0, w, sums)
            pitch = (self.place(p, self.wall_surface[last + 1], 0, w, sums) - left) / (last + 1)
            for n in range(p.n_disk_surface):
                i = self.disk_surface[n]
                x, y = self.place(p, i, 0, w, sums), self.place(p, i, 1, w, sums)
                # The vertical distance is at most twice l unless the surface is steeper than 60 degrees.
                if y - top < 2.0 * p.threshold:
                    k = ti.max(0, ti.min(last, ti.cast((x - left) / pitch, ti.i32)))
                    while k > 0 and x < self.place(p, self.wall_surface[k], 0, w, sums):
                        k -= 1
                    while k < last and x >= self.place(p, self.wall_surface[k + 1], 0, w, sums):
                        k += 1
                    a, b = self.wall_surface[k], self.wall_surface[k + 1]
                    ax, ay = self.place(p, a, 0, w, sums), self.place(p, a, 1, w, sums)
                    tx, ty = self.place(p, b, 0, w, sums) - ax, self.place(p, b, 1, w, sums) - ay
                    if x >= ax and x < ax + tx:
                        length2 = tx * tx + ty * ty
                        length = ti.sqrt(length2)
                        nx, ny = -ty / length, tx / length
                        gap = (x - ax) * nx + (y - ay) * ny
                        if gap < p.threshold:
                            lever = ((x - ax) * tx + (y - ay) * ty) / length2
                            energy = p.V0 * ti.exp(-p.a * gap)
                            force = p.a * energy
                            self.f[0][w][i] += force * nx
                            self.f[1][w][i] += force * ny
                            self.f[0][w][a] -= (1.0 - lever) * force * nx
                            self.f[1][w][a] -= (1.0 - lever) * force * ny
                            self.f[0][w][b] -= lever * force * nx
                            self.f[1][w][b] -= lever * force * ny
                            upward[w] += force * ny
                            potential[w] += energy - p.V0_at_threshold
                            highest[w] = ti.max(highest[w], force)
                            slid[w] += self.slid(p, i, k, w, move, sums)
        return upward, potential, highest, slid

    @ti.func
    def slid(self, p: ti.template(), i, k, w: ti.template(), move, sums):
        """Energy that point i, now over wall spring k, lost if it was over another one before the last move.

        Where the surface is bent, the distance l jumps as a point passes from one spring to the next, and with it the
        potential: half of the jumps at either end of the move, as the trapezoidal rule has it.
        """
        before = k
        x = self.last_place(p, i, 0, w, move, sums)
        last = p.n_wall_surface - 2
        while before > 0 and x < self.last_place(p, self.wall_surface[before], 0, w, move, sums):
            before -= 1
        while before < last and x >= self.last_place(p, self.wall_surface[before + 1], 0, w, move, sums):
            before += 1
        lost = ti.cast(0.0, self.real)
        if before != k:
            for case in range(4):  # a loop: what is inlined four times takes long to compile
                spring, half = k, ti.cast(-0.5, self.real)
                if case < 2:
                    spring, half = before, ti.cast(0.5, self.real)
                lost += half * self.contact(p, i, spring, w, (case % 2) * move, sums)
        return lost

    @ti.func
    def contact(self, p: ti.template(), i, k, w: ti.template(), move, sums):
        """Potential of point i's contact with wall spring k, by `move` times the velocity ago."""
        a, b = self.wall_surface[k], self.wall_surface[k + 1]
        ax, ay = self.last_place(p, a, 0, w, move, sums), self.last_place(p, a, 1, w, move, sums)
        tx = self.last_place(p, b, 0, w, move, sums) - ax
        ty = self.last_place(p, b, 1, w, move, sums) - ay
        x, y = self.last_place(p, i, 0, w, move, sums) - ax, self.last_place(p, i, 1, w, move, sums) - ay
        gap = (y * tx - x * ty) / ti.sqrt(tx * tx + ty * ty)
        energy = ti.cast(0.0, self.real)
        if gap < p.threshold:
            energy = p.V0 * ti.exp(-p.a * gap) - p.V0_at_threshold
        return energy
