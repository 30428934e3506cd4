"""Springs and explicit dashpots: f_ij = -(k_a s + k_b s^3) e - eta (v_i - v_j), paper eqs. (1) and (3)."""

import taichi as ti

from taichi_disk.model.vectors import get, put


class Springs:
    """The spring forces of all lanes; part of `World`.

    Springs are taken a block at a time, every lane of every spring of the block in one vector.
    """

    @ti.func
    def add_spring_forces(self, p: ti.template(), dashpot: ti.template(), begin, end):
        """Add the forces of the springs in blocks begin..end (and of their dashpots, at the velocities `u`) to `f`.

        Returns, per lane, the elastic energy sum(k_a s^2/2 + k_b s^4/4) [M c^2] and sum((u_i - u_j).(w_i - w_j)) over
        these springs [c^2] with w = (u + 2 v)/3, from which `Stepping.account` has the power lost in the dashpots.
        """
        width = ti.static(self.block * self.lanes)
        energy = ti.Vector.zero(self.real, width)
        products = ti.Vector.zero(self.real, width)
        eta = ti.Vector.zero(self.real, width)
        if ti.static(dashpot):
            for k in ti.static(range(width)):
                eta[k] = self.eta[k % self.lanes][None]
        for block in range(begin, end):
            dx, dy = self.differences(self.x, block)
            rest = self.broadcast(self.rest, block)
            change = ti.Vector.zero(self.real, width)  # of the length's square
            if ti.static(self.single):
                span_x = self.broadcast([part[0] for part in self.span], block)
                span_y = self.broadcast([part[1] for part in self.span], block)
                moved_x, moved_y = dx, dy
                dx += span_x
                dy += span_y
                change = (dx + span_x) * moved_x + (dy + span_y) * moved_y
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
            fx, fy = pull * dx, pull * dy
            if ti.static(dashpot):
                ux, uy = self.differences(self.u, block)
                vx, vy = self.differences(self.v, block)
                products += ux * (ux + 2.0 * vx) + uy * (uy + 2.0 * vy)
                fx += eta * ux
                fy += eta * uy
            self.pull_together(block, fx, fy)
        elastic = ti.Vector.zero(self.real, self.lanes)
        rates = ti.Vector.zero(self.real, self.lanes)
        for w in ti.static(range(self.lanes)):
            for k in ti.static(range(self.block)):
                elastic[w] += energy[k * self.lanes + w]
                rates[w] += products[k * self.lanes + w] / 3.0
        return elastic, rates

    @ti.func
    def broadcast(self, parts: ti.template(), block):
        """One number of each spring of a block, the same in every lane."""
        return ti.Vector([parts[k][block] for k in range(self.block) for w in range(self.lanes)])

    @ti.func
    def differences(self, parts: ti.template(), block):
        """x and y of what the first end of each spring of a block has more than the second."""
        if ti.static(self.block == 1):
            i, j = self.bond_i[0][block], self.bond_j[0][block]
            return get(parts[0], i) - get(parts[0], j), get(parts[1], i) - get(parts[1], j)
        else:
            x, y = ti.static(parts[0][0], parts[1][0])
            i = [self.bond_i[k][block] for k in range(self.block)]
            j = [self.bond_j[k][block] for k in range(self.block)]
            # x and y of a point stand side by side: loaded and subtracted together.
            d = [ti.Vector([x[i[k]], y[i[k]]]) - ti.Vector([x[j[k]], y[j[k]]]) for k in range(self.block)]
            return ti.Vector([one[0] for one in d]), ti.Vector([one[1] for one in d])

    @ti.func
    def pull_together(self, block, fx, fy):
        """Subtract a force from the first end of each spring of a block and add it to the second."""
        for k in ti.static(range(self.block)):
            i, j = self.bond_i[k][block], self.bond_j[k][block]
            if ti.static(self.block == 1):
                put(self.f[0], i, get(self.f[0], i) - fx)
                put(self.f[1], i, get(self.f[1], i) - fy)
                put(self.f[0], j, get(self.f[0], j) + fx)
                put(self.f[1], j, get(self.f[1], j) + fy)
            else:
                force = ti.Matrix([[fx[k]], [fy[k]]])
                put(self.f, i, get(self.f, i) - force)
                put(self.f, j, get(self.f, j) + force)
