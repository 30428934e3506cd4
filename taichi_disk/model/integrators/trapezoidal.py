"""Velocity Verlet with the dashpots trapezoidal: order 2, one force evaluation and one sparse solve a step.

For strong dashpots: the step is set by the springs, not by eta. The symmetric positive definite matrix is constant, so
its Cholesky factor is computed once and held in Taichi fields; a step then costs 2.8 of those with weak dashpots. In
large lattices a factor costs more, 4.0 steps at N = 10,000 and 6.3 at 40,000, and is one core's work: there sweeps
solve (see `sweeps`), 0.4 steps each, 7 and 5 of them at eta* = 100. At N = 1099, where a sweep costs a quarter of the
solve by the factor, it would take 4 at eta* = 10 and 12 at eta* = 100.

With v_ the velocities half a step ago and F the springs' and walls' forces at this step, the velocity u at
this step, centred between v_ and v_+ = 2 u - v_, obeys

    (1 + h/2 (eta/m) L) u = v_ + h/2 F/m,      L = graph Laplacian of the springs,

which is leapfrog with the dashpot trapezoidal: order 2, and stable up to the undamped limit whatever eta is.
"""

import taichi as ti

from taichi_disk.model.vectors import get, put


class ImplicitDashpot:
    """Solves for the velocities at a step; part of `World`."""

    @ti.func
    def solve_dashpot(self, p: ti.template()):
        """Solve the matrix with the right-hand side in `z` (elimination order); the result is left in `z`."""
        y = ti.static(self.components - 1)
        for k in range(p.n_free):
            zk = get(self.z, k)
            for e in range(self.column[k], self.column[k + 1]):
                c = get(self.factor, e)
                for w in ti.static(range(self.lanes)):
                    self.z[0][w][self.row[e]] -= c[0] * zk[0, w]
                    self.z[1][w][self.row[e]] -= c[y] * zk[1, w]
        for back in range(p.n_free):
            k = p.n_free - 1 - back
            d = get(self.inverse_diagonal, k)
            zk = get(self.z, k)
            for w in ti.static(range(self.lanes)):
                zk[0, w] *= d[0]
                zk[1, w] *= d[y]
            for e in range(self.column[k], self.column[k + 1]):
                c = get(self.factor, e)
                other = get(self.z, self.row[e])
                for w in ti.static(range(self.lanes)):
                    zk[0, w] -= c[0] * other[0, w]
                    zk[1, w] -= c[y] * other[1, w]
            put(self.z, k, zk)

    @ti.func
    def solve_velocities(self, p: ti.template()):
        """Solve for the velocities `u` at this step; returns per lane three powers.

        u.D u lost in all dashpots D, u.D u_before, and the part of the first that is lost at the boundary.
        """
        power = ti.Vector.zero(self.real, self.lanes)
        cross = ti.Vector.zero(self.real, self.lanes)
        if ti.static(self.chunks > 1):
            for c in range(self.chunks):
                part = get(self.chunk_sums, c)
                for w in ti.static(range(self.lanes)):
                    power[w] += part[0, w]
                    cross[w] += part[1, w]
        elif ti.static(self.sweeps > 0):
            for k in range(self.sweeps - 1):
                self.sweep(p, k, 0, p.n)
            power, cross = self.sweep_to_end(p, 0, p.n)
        else:
            power, cross = self.solve_by_factor(p)
        absorbed = ti.Vector.zero(self.real, self.lanes)
        if ti.static(self.physics.boundary == "dashpot"):
            for k in range(p.n_boundary):
                u, Z = get(self.u, self.boundary[k]), get(self.impedance, k)
                for w in ti.static(range(self.lanes)):
                    absorbed[w] += Z[0] * u[0, w] * u[0, w] + Z[1] * u[1, w] * u[1, w]
        return power, cross, absorbed

    @ti.func
    def solve_by_factor(self, p: ti.template()):
        """The two powers of `solve_velocities`, and the velocities in `u`."""
        half = 0.5 * p.g
        for k in range(p.n_free):
            i = self.order[k]
            put(self.z, k, get(self.v, i) + half * get(self.f, i))
        self.solve_dashpot(p)
        power = ti.Vector.zero(self.real, self.lanes)
        cross = ti.Vector.zero(self.real, self.lanes)
        for k in range(p.n_free):
            i, u = self.order[k], get(self.z, k)
            before = get(self.u, i)
            loss = (get(self.v, i) + half * get(self.f, i) - u) / half
            for w in ti.static(range(self.lanes)):
                power[w] += u[0, w] * loss[0, w] + u[1, w] * loss[1, w]
                cross[w] += before[0, w] * loss[0, w] + before[1, w] * loss[1, w]
            put(self.u, i, u)
        return power, cross

    @ti.func
    def take_damped_force(self, p: ti.template()):
        """The force that the solved velocities imply, so that v + g/2 f = u and v + g f = 2 u - v."""
        for k in range(p.n_free):
            i = k
            if ti.static(self.sweeps == 0):
                i = self.order[k]
            put(self.f, i, (get(self.u, i) - get(self.v, i)) / (0.5 * p.g))
