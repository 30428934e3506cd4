"""Springs and explicit dashpots: f_ij = -(k_a s + k_b s^3) e - eta (v_i - v_j), paper eqs. (1) and (3)."""

import taichi as ti


class Springs:
    """The spring forces of all lanes; part of `World`."""

    @ti.func
    def add_spring_forces(self, p: ti.template(), dashpot: ti.template(), begin, end):
        """Add the forces of the springs in blocks begin..end (and of their dashpots, at the velocities `u`) to `f`.

        Returns, per lane, the elastic energy sum(k_a s^2/2 + k_b s^4/4) [M c^2] and sum(|v_i - v_j|^2) over
        these springs [c^2], to which the power lost in the dashpots is proportional.
        """
        width = ti.static(self.block * self.lanes)
        energy = ti.Vector.zero(self.real, width)
        relative = ti.Vector.zero(self.real, self.lanes)
        eta = ti.Matrix.zero(self.real, 2, self.lanes)
        if ti.static(dashpot):
            for w in ti.static(range(self.lanes)):
                eta[0, w] = self.eta[None][w]
                eta[1, w] = self.eta[None][w]
        for block in range(begin, end):
            i, j, unloaded = self.bond_i[block], self.bond_j[block], self.rest[block]
            dx = ti.Vector.zero(self.real, width)
            dy = ti.Vector.zero(self.real, width)
            rest = ti.Vector.zero(self.real, width)
            change = ti.Vector.zero(self.real, width)  # of the length's square
            for k in ti.static(range(self.block)):
                d = self.x[i[k]] - self.x[j[k]]
                for w in ti.static(range(self.lanes)):
                    dx[k * self.lanes + w] = d[0, w]
                    dy[k * self.lanes + w] = d[1, w]
                    rest[k * self.lanes + w] = unloaded[k]
                if ti.static(self.single):
                    span = ti.Vector([self.span[block][k, 0], self.span[block][k, 1]])
                    for w in ti.static(range(self.lanes)):
                        dx[k * self.lanes + w] += span[0]
                        dy[k * self.lanes + w] += span[1]
                        x = dx[k * self.lanes + w] + span[0]
                        y = dy[k * self.lanes + w] + span[1]
                        change[k * self.lanes + w] = x * d[0, w] + y * d[1, w]
            r = ti.sqrt(dx * dx + dy * dy)
            s = r - rest
            part = s / r
            if ti.static(self.single):
                part = change / ((r + rest) * r)
                s = part * r
            s2 = s * s
            pull = p.k_a * part
            energy += (0.5 * p.k_a) * s2
            if ti.static(self.uses("cubic")):
                pull += p.k_b * s2 * part
                energy += (0.25 * p.k_b) * s2 * s2
            if ti.static(self.block > 1):
                # This store makes the compiler take the block's square roots and divisions as one vector.
                self.pull[block] = pull
            squares = ti.Vector.zero(self.real, self.lanes)
            for k in ti.static(range(self.block)):
                force = ti.Matrix.zero(self.real, 2, self.lanes)
                for w in ti.static(range(self.lanes)):
                    force[0, w] = pull[k * self.lanes + w] * dx[k * self.lanes + w]
                    force[1, w] = pull[k * self.lanes + w] * dy[k * self.lanes + w]
                if ti.static(dashpot):
                    u = self.u[i[k]] - self.u[j[k]]
                    for w in ti.static(range(self.lanes)):
                        squares[w] += u[0, w] * u[0, w] + u[1, w] * u[1, w]
                    force += eta * u
                self.f[i[k]] = self.f[i[k]] - force  # `-=` would be atomic where chunks are taken in parallel
                self.f[j[k]] = self.f[j[k]] + force
            if ti.static(dashpot):
                relative += squares
        elastic = ti.Vector.zero(self.real, self.lanes)
        for w in ti.static(range(self.lanes)):
            for k in ti.static(range(self.block)):
                elastic[w] += energy[k * self.lanes + w]
        return elastic, relative
