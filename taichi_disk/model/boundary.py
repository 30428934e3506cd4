"""What happens at the sides and bottom of the elastic wall (paper section 5): pinned, matched or reset."""

import taichi as ti

from taichi_disk.model.sums import ABSORBED, DISSIPATED, POWER
from taichi_disk.model.vectors import get, put


class Boundary:
    """The wall's boundary; part of `World`."""

    @ti.func
    def hold_boundary(self, p: ti.template()):
        for k in range(p.n_boundary):
            put(self.f, self.boundary[k], ti.Matrix.zero(self.real, 2, self.lanes))

    @ti.func
    def damp_boundary(self, p: ti.template()):
        """Matched boundary: force -Z v, v centred at this step.

        Returns, per lane, (v.Zv + 2 v_.Zv_)/3 with v_ half a step ago, for `Stepping.account`.
        """
        power = ti.Vector.zero(self.real, self.lanes)
        for k in range(p.n_boundary):
            i, Z = self.boundary[k], get(self.impedance, k)
            f = get(self.f, i)
            before = get(self.v, i)
            v = before + 0.5 * p.g * f
            for w in ti.static(range(self.lanes)):
                for c in ti.static(range(2)):
                    vc = v[c, w] / (1.0 + 0.5 * p.g * Z[c])
                    f[c, w] -= Z[c] * vc
                    power[w] += Z[c] * (vc * vc + 2.0 * before[c, w] * before[c, w]) / 3.0
            put(self.f, i, f)
        return power

    @ti.func
    def reset_boundary(self, p: ti.template(), now, before, sums):
        """Stop the boundary if it is time to; returns `sums` with what that absorbed.

        Springs do not notice a stop. Dashpots do: their force jumps with the velocity, and the coming half step
        has to start from the force after the jump, or the reset would cost an order. Their loss over a step
        is then summed as -h/2 (f_k + f_{k+1}) v_{k+1/2}, f the dashpots' force at either end as it acted.
        """
        result = sums
        if ti.static(self.physics.dissipates):
            power = self.dashpot_work(p, 0.0)
            for w in ti.static(range(self.lanes)):
                result[DISSIPATED, w] = before[DISSIPATED, w] + 0.5 * p.h * (before[POWER, w] + power[w])
        if now:
            energy = self.stop_boundary(p)
            for w in ti.static(range(self.lanes)):
                result[ABSORBED, w] += energy[w]
        elif ti.static(self.physics.implicit_dashpot):
            self.take_damped_force(p)
        if ti.static(self.physics.dissipates):
            power = self.dashpot_work(p, p.g)
            for w in ti.static(range(self.lanes)):
                result[POWER, w] = power[w]
        return result

    @ti.func
    def stop_boundary(self, p: ti.template()):
        """Set the boundary's velocities at this step to zero; returns per lane the kinetic energy they held.

        What leapfrog keeps is m/2 v_{k-1/2} v_{k+1/2} = m/2 v_k^2 - m/2 (h/2 f_k/m)^2, and where there are
        dashpots f_k jumps too.
        """
        half = p.closing
        energy = ti.Vector.zero(self.real, self.lanes)
        if ti.static(self.physics.dissipates):
            energy = -1.0 * self.half_kick_energy(p, self.physics.implicit_dashpot)
        if ti.static(self.physics.explicit_dashpot):
            for i in range(p.n):
                put(self.u, i, ti.Matrix.zero(self.real, 2, self.lanes))
        for k in range(p.n_boundary):
            i = self.boundary[k]
            v = get(self.v, i) + half * get(self.f, i)
            if ti.static(self.physics.implicit_dashpot):
                v = get(self.u, i)
                put(self.u, i, ti.Matrix.zero(self.real, 2, self.lanes))
            elif ti.static(self.physics.explicit_dashpot):
                put(self.u, i, v)
            else:
                put(self.v, i, -half * get(self.f, i))
            for w in ti.static(range(self.lanes)):
                energy[w] += 0.5 * p.m * (v[0, w] * v[0, w] + v[1, w] * v[1, w])
        if ti.static(self.physics.explicit_dashpot):
            self.restart_explicit(p)
        if ti.static(self.physics.implicit_dashpot):
            self.restart_implicit(p)
        if ti.static(self.physics.dissipates):
            energy += self.half_kick_energy(p, False)
        return energy

    @ti.func
    def restart_explicit(self, p: ti.template()):
        """From `u`, what each velocity has lost, and `f` before that: `f` after it, and `u` that goes with it."""
        half = p.closing
        for i in range(p.n):
            put(self.v, i, get(self.v, i) + (half * get(self.f, i) - get(self.u, i)))
        eta = ti.Vector([part[None] for part in self.eta])
        for b in range(p.blocks):
            for k in ti.static(range(self.block)):
                i, j = self.bond_i[k][b], self.bond_j[k][b]
                lost = get(self.u, i) - get(self.u, j)
                for w in ti.static(range(self.lanes)):
                    lost[0, w] *= eta[w]
                    lost[1, w] *= eta[w]
                put(self.f, i, get(self.f, i) + lost)
                put(self.f, j, get(self.f, j) - lost)
        for i in range(p.n):
            put(self.u, i, get(self.v, i))
            put(self.v, i, get(self.v, i) - half * get(self.f, i))

    @ti.func
    def restart_implicit(self, p: ti.template()):
        """From `u`, the velocities after the loss, and `f` without dashpots: solve for the half step to come."""
        half = p.closing
        if ti.static(self.sweeps > 0):
            self.sweep_after_stop(p)
        else:
            for k in range(p.n_free):
                i = self.order[k]
                put(self.z, k, get(self.u, i) + half * get(self.f, i))
            self.solve_dashpot(p)
        for k in range(p.n_free):
            i = k
            if ti.static(self.sweeps == 0):
                i = self.order[k]
            put(self.v, i, 2.0 * get(self.u, i) - get(self.z, k))
            put(self.f, i, (get(self.z, k) - get(self.u, i)) / half)
            put(self.u, i, get(self.z, k))  # the velocity at which the dashpots act in that half step

    @ti.func
    def half_kick_energy(self, p: ti.template(), solved: ti.template()):
        """sum(m/2 (h/2 f/m)^2) per lane; where the velocities are only `solved` for, h/2 f/m = u - v."""
        energy = ti.Vector.zero(self.real, self.lanes)
        for i in range(p.n):
            kick = 0.5 * p.g * get(self.f, i)
            if ti.static(solved):
                kick = get(self.u, i) - get(self.v, i)
            for w in ti.static(range(self.lanes)):
                energy[w] += 0.5 * p.m * (kick[0, w] * kick[0, w] + kick[1, w] * kick[1, w])
        return energy

    @ti.func
    def dashpot_work(self, p: ti.template(), g):
        """sum(eta (u_i - u_j).(w_i - w_j)) over the springs, w = v + g f: g = 0 the last half step, h/m the next."""
        power = ti.Vector.zero(self.real, self.lanes)
        eta = ti.Vector([part[None] for part in self.eta])
        for b in range(p.blocks):
            for k in ti.static(range(self.block)):
                i, j = self.bond_i[k][b], self.bond_j[k][b]
                u = get(self.u, i) - get(self.u, j)
                v = get(self.v, i) - get(self.v, j) + g * (get(self.f, i) - get(self.f, j))
                for w in ti.static(range(self.lanes)):
                    power[w] += eta[w] * (u[0, w] * v[0, w] + u[1, w] * v[1, w])
        return power
