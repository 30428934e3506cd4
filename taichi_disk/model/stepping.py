"""The step: drift, forces, boundary, dashpots; and the kernel that makes many of them at once.

What adds up over time travels through the step as a local matrix `sums` (row per quantity, column per lane)
and is stored once, at the kernel's end. Taichi 1.7.4 keeps 0-D fields in registers across loops and hands later
readers in the same kernel the value from before: an energy kept in such a field comes out one launch late.
"""

import taichi as ti

from taichi_disk.model.parameters import Parameters

SUMS = 5
DISSIPATED, POWER, ABSORBED, BOUNDARY_POWER, PEAK = range(SUMS)


class Stepping:
    """Moves the points; part of `World`."""

    @ti.func
    def outer_force(self, p: ti.template(), i, x):
        """The force on point i at x that does not come from springs: the rigid wall's and the load.

        Also returns the wall's share, per lane.
        """
        force = ti.Matrix.zero(ti.f64, 2, self.lanes)
        push = ti.Vector.zero(ti.f64, self.lanes)
        if ti.static(self.uses("rigid wall")):
            push = self.rigid_wall_force(p, ti.Vector([x[1, w] for w in range(self.lanes)]))
            for w in ti.static(range(self.lanes)):
                force[1, w] += push[w]
        if ti.static(self.uses("load")):
            if i < self.n_disk:
                for w in ti.static(range(self.lanes)):
                    force[1, w] -= self.load[None][w] / self.n_disk
        return force, push

    @ti.func
    def drift(self, p: ti.template(), peak):
        """Kick by a whole step (half a step before and half a step after t_k) and move to t_{k+1}.

        Returns `peak`, the wall's largest force on one point so far.
        """
        highest = peak
        for i in range(self.n):
            f = self.f[i]
            v = self.v[i] + p.g * f
            x = self.x[i] + p.h * v
            self.v[i] = v
            self.x[i] = x
            if ti.static(self.physics.explicit_dashpot):
                self.u[i] = v + 0.5 * p.g * f
            force, push = self.outer_force(p, i, x)
            self.f[i] = force
            if ti.static(self.physics.wall == "rigid"):
                highest = ti.max(highest, push)
        return highest

    @ti.func
    def hold_boundary(self):
        for k in range(self.n_boundary):
            self.f[self.boundary[k]] = ti.Matrix.zero(ti.f64, 2, self.lanes)

    @ti.func
    def damp_boundary(self, p: ti.template()):
        """Matched boundary: force -Z v, v centred at this step. Returns the power absorbed, per lane."""
        power = ti.Vector.zero(ti.f64, self.lanes)
        for k in range(self.n_boundary):
            i, Z = self.boundary[k], self.impedance[k]
            f = self.f[i]
            v = self.v[i] + 0.5 * p.g * f
            for w in ti.static(range(self.lanes)):
                for c in ti.static(range(2)):
                    vc = v[c, w] / (1.0 + 0.5 * p.g * Z[c])
                    f[c, w] -= Z[c] * vc
                    power[w] += Z[c] * vc * vc
            self.f[i] = f
        return power

    @ti.func
    def solve_velocities(self, p: ti.template()):
        """Solve for the velocities `u` at this step; returns per lane three powers.

        u.D u lost in all dashpots D, u.D u_before, and the part of the first that is lost at the boundary.
        """
        half = 0.5 * p.g
        for k in range(self.n_free):
            i = self.order[k]
            self.z[k] = self.v[i] + half * self.f[i]
        self.solve_dashpot()
        power = ti.Vector.zero(ti.f64, self.lanes)
        cross = ti.Vector.zero(ti.f64, self.lanes)
        for k in range(self.n_free):
            i, u = self.order[k], self.z[k]
            before = self.u[i]
            loss = (self.v[i] + half * self.f[i] - u) / half
            for w in ti.static(range(self.lanes)):
                power[w] += u[0, w] * loss[0, w] + u[1, w] * loss[1, w]
                cross[w] += before[0, w] * loss[0, w] + before[1, w] * loss[1, w]
            self.u[i] = u
        absorbed = ti.Vector.zero(ti.f64, self.lanes)
        if ti.static(self.physics.boundary == "dashpot"):
            for k in range(self.n_boundary):
                u, Z = self.u[self.boundary[k]], self.impedance[k]
                for w in ti.static(range(self.lanes)):
                    absorbed[w] += Z[0] * u[0, w] * u[0, w] + Z[1] * u[1, w] * u[1, w]
        return power, cross, absorbed

    @ti.func
    def take_damped_force(self, p: ti.template()):
        """The force that the solved velocities imply, so that v + g/2 f = u and v + g f = 2 u - v."""
        for k in range(self.n_free):
            i = self.order[k]
            self.f[i] = (self.u[i] - self.v[i]) / (0.5 * p.g)

    @ti.func
    def stop_boundary(self, p: ti.template()):
        """Set the boundary's velocities at this step to zero; returns per lane the kinetic energy they held,
        and the power of the springs' dashpots after it.

        Springs do not notice. Dashpots do: their force jumps with the velocity, and the coming half step has
        to start from the force after the jump, or the reset would cost an order.
        """
        half = 0.5 * p.g
        energy = ti.Vector.zero(ti.f64, self.lanes)
        if ti.static(self.physics.explicit_dashpot):
            for i in range(self.n):
                self.u[i] = ti.Matrix.zero(ti.f64, 2, self.lanes)
        for k in range(self.n_boundary):
            i = self.boundary[k]
            v = self.v[i] + half * self.f[i]
            if ti.static(self.physics.implicit_dashpot):
                v = self.u[i]
                self.u[i] = ti.Matrix.zero(ti.f64, 2, self.lanes)
            elif ti.static(self.physics.explicit_dashpot):
                self.u[i] = v
            else:
                self.v[i] = -half * self.f[i]
            for w in ti.static(range(self.lanes)):
                energy[w] += 0.5 * p.m * (v[0, w] * v[0, w] + v[1, w] * v[1, w])
        power = ti.Vector.zero(ti.f64, self.lanes)
        if ti.static(self.physics.explicit_dashpot):
            self.restart_explicit(half)
            power = self.dashpot_power()
        if ti.static(self.physics.implicit_dashpot):
            self.restart_implicit(half)
            power = self.dashpot_power()
        return energy, power

    @ti.func
    def dashpot_power(self):
        """sum(eta |u_i - u_j|^2) over the springs, per lane."""
        power = ti.Vector.zero(ti.f64, self.lanes)
        eta = self.eta[None]
        for b in range(self.n_bonds):
            u = self.u[self.bond_i[b]] - self.u[self.bond_j[b]]
            for w in ti.static(range(self.lanes)):
                power[w] += eta[w] * (u[0, w] * u[0, w] + u[1, w] * u[1, w])
        return power

    @ti.func
    def restart_explicit(self, half):
        """`u` holds what each velocity has lost; `f` holds the dashpots' force before the loss."""
        for i in range(self.n):
            self.v[i] += half * self.f[i] - self.u[i]
        eta = self.eta[None]
        for b in range(self.n_bonds):
            i, j = self.bond_i[b], self.bond_j[b]
            lost = self.u[i] - self.u[j]
            for w in ti.static(range(self.lanes)):
                lost[0, w] *= eta[w]
                lost[1, w] *= eta[w]
            self.f[i] += lost
            self.f[j] -= lost
        for i in range(self.n):
            self.u[i] = self.v[i]
            self.v[i] -= half * self.f[i]

    @ti.func
    def restart_implicit(self, half):
        """`u` holds the velocities after the loss, `f` the force without dashpots: solve for half a step on."""
        for k in range(self.n_free):
            i = self.order[k]
            self.z[k] = self.u[i] + half * self.f[i]
        self.solve_dashpot()
        for k in range(self.n_free):
            i = self.order[k]
            self.v[i] = 2.0 * self.u[i] - self.z[k]
            self.f[i] = (self.z[k] - self.u[i]) / half
            # What the dashpots lose in this half step goes by the velocities solved for: those before, with
            # the boundary stopped dead beside moving neighbours, would count a loss that never happens.
            self.u[i] = self.z[k]

    @ti.func
    def step(self, p: ti.template(), number, sums):
        """Make step `number`; returns `sums`, and elastic energy, contact force and contact potential after it."""
        peak = self.drift(p, row(sums, PEAK))
        elastic, squares = self.add_spring_forces(p, self.physics.explicit_dashpot)
        upward = ti.Vector.zero(ti.f64, self.lanes)
        potential = ti.Vector.zero(ti.f64, self.lanes)
        power = ti.Vector.zero(ti.f64, self.lanes)
        cross = ti.Vector.zero(ti.f64, self.lanes)
        boundary_power = ti.Vector.zero(ti.f64, self.lanes)
        if ti.static(self.uses("elastic wall")):
            upward, potential, peak = self.add_contact_forces(p, peak)
        if ti.static(self.uses("explicit dashpot")):
            power = self.eta[None] * squares
        if ti.static(self.uses("pinned boundary")):
            self.hold_boundary()
        if ti.static(self.uses("dashpot boundary") and not self.physics.implicit_dashpot):
            boundary_power = self.damp_boundary(p)
        if ti.static(self.uses("implicit dashpot")):
            power, cross, boundary_power = self.solve_velocities(p)
        result = sums
        for w in ti.static(range(self.lanes)):
            p0, p1, b0, b1 = sums[POWER, w], power[w], sums[BOUNDARY_POWER, w], boundary_power[w]
            loss = 0.5 * p.h * (p0 + p1)
            boundary_loss = 0.5 * p.h * (b0 + b1)
            if ti.static(self.physics.implicit_dashpot):
                # Trapezoidal leapfrog obeys x2 + h^2/12 x4 = -w^2 x - g (x1 + h^2/6 x3) to O(h^4), with xn the
                # n-th derivative, and loses g int(x1^2 - h^2/6 x2^2): this sum is that to O(h^4).
                loss = p.h * (2.0 / 3.0 * (p0 + p1) - 1.0 / 3.0 * cross[w]) - boundary_loss
            result[DISSIPATED, w] += loss
            result[POWER, w] = p1
            result[ABSORBED, w] += boundary_loss
            result[BOUNDARY_POWER, w] = b1
            result[PEAK, w] = peak[w]
        resetting = False
        if ti.static(self.uses("reset boundary")):
            resetting = number % self.reset_steps == 0
            if resetting:
                lost, after = self.stop_boundary(p)
                for w in ti.static(range(self.lanes)):
                    result[ABSORBED, w] += lost[w]
                    result[POWER, w] = after[w]
        if ti.static(self.physics.implicit_dashpot):
            if not resetting:
                self.take_damped_force(p)
        return result, elastic, upward, potential

    @ti.kernel
    def _advance(
        self,
        p: Parameters,
        number: ti.i32,
        samples: ti.i32,
        stride: ti.i32,
        rows: ti.types.ndarray(dtype=ti.f64, ndim=3),
    ):
        ti.loop_config(serialize=True)
        for _ in range(1):
            sums = self.sums[0]
            for s in range(samples):
                elastic = ti.Vector.zero(ti.f64, self.lanes)
                upward = ti.Vector.zero(ti.f64, self.lanes)
                potential = ti.Vector.zero(ti.f64, self.lanes)
                for k in range(stride):
                    sums, elastic, upward, potential = self.step(p, number + s * stride + k + 1, sums)
                self.observe(p, rows, s, sums, elastic, upward, potential)
            self.sums[0] = sums

    @ti.kernel
    def _initialise(self, p: Parameters, rows: ti.types.ndarray(dtype=ti.f64, ndim=3)):
        """From x_0 and v_0 (in `v`): the forces at t = 0 and the velocities half a step before."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            sums = ti.Matrix.zero(ti.f64, SUMS, self.lanes)
            for i in range(self.n):
                force, _push = self.outer_force(p, i, self.x[i])
                self.f[i] = force
                if ti.static(self.physics.dissipates):
                    self.u[i] = self.v[i]
            elastic, squares = self.add_spring_forces(p, self.physics.dissipates)
            upward = ti.Vector.zero(ti.f64, self.lanes)
            potential = ti.Vector.zero(ti.f64, self.lanes)
            peak = ti.Vector.zero(ti.f64, self.lanes)
            if ti.static(self.physics.wall == "elastic"):
                upward, potential, peak = self.add_contact_forces(p, peak)
            if ti.static(self.physics.boundary == "pinned"):
                self.hold_boundary()
            if ti.static(self.physics.dissipates):
                power = self.eta[None] * squares
                for w in ti.static(range(self.lanes)):
                    sums[POWER, w] = power[w]
            if ti.static(self.physics.boundary == "dashpot"):
                for k in range(self.n_boundary):
                    i, Z = self.boundary[k], self.impedance[k]
                    v, f = self.v[i], self.f[i]
                    for w in ti.static(range(self.lanes)):
                        for c in ti.static(range(2)):
                            f[c, w] -= Z[c] * v[c, w]
                            sums[BOUNDARY_POWER, w] += Z[c] * v[c, w] * v[c, w]
                    self.f[i] = f
            for i in range(self.n):
                self.v[i] -= 0.5 * p.g * self.f[i]
            self.sums[0] = sums
            self.observe(p, rows, 0, sums, elastic, upward, potential)


@ti.func
def row(matrix, k: ti.template()):
    return ti.Vector([matrix[k, w] for w in range(matrix.m)])
