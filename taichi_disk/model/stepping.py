"""The step: drift, forces, boundary, dashpots; and the kernel that makes many of them at once."""

import taichi as ti

from taichi_disk.model.boundary import Boundary
from taichi_disk.model.frame import Frame
from taichi_disk.model.hand import Hand
from taichi_disk.model.parameters import Parameters, rounded
from taichi_disk.model.sums import ABSORBED, BOUNDARY_POWER, DISSIPATED, PEAK, POWER, SLIDING
from taichi_disk.model.vectors import get, put


class Stepping(Boundary, Frame, Hand):
    """Moves the points; part of `World`."""

    @ti.func
    def outer_force(self, p: ti.template(), i, sums):
        """The force on point i that does not come from springs: the rigid wall's and the load.

        Also returns the wall's share, per lane.
        """
        force = ti.Matrix.zero(self.real, 2, self.lanes)
        push = ti.Vector.zero(self.real, self.lanes)
        if ti.static(self.uses("rigid wall")):
            push = self.rigid_wall_force(p, ti.Vector([self.place(p, i, 1, w, sums) for w in range(self.lanes)]))
            for w in ti.static(range(self.lanes)):
                force[1, w] += push[w]
        if ti.static(self.uses("load")):
            if i < p.n_disk:
                for w in ti.static(range(self.lanes)):
                    force[1, w] -= self.load[w][None] / p.n_disk
        return force, push

    @ti.func
    def drift(self, p: ti.template(), kick, move, sums, first, last):
        """Change velocities by `kick` times the force, then positions by `move` times the velocity: points first..last.

        `sums` is that of the frame already moved. Returns per lane the wall's force, and the largest on one point.
        """
        total = ti.Vector.zero(self.real, self.lanes)
        highest = ti.Vector.zero(self.real, self.lanes)
        for i in range(first, last):
            f = get(self.f, i)
            v = get(self.v, i) + kick * f
            if ti.static(self.single):
                gain = self.frame_kick(p, i, kick, sums)
                for w in ti.static(range(self.lanes)):
                    v[1, w] -= gain[w]
            put(self.v, i, v)
            put(self.x, i, get(self.x, i) + move * v)
            if ti.static(self.physics.explicit_dashpot):
                put(self.u, i, v + 0.5 * p.g * f)
            if ti.static(self.sweeps > 0):
                put(self.z, i, 2.0 * v - get(self.u, i))  # the same prediction, as a first guess
            force, push = self.outer_force(p, i, sums)
            put(self.f, i, force)
            if ti.static(self.physics.wall == "rigid"):
                highest = ti.max(highest, push)
                total += push
        return total, highest

    @ti.func
    def stage(self, p: ti.template(), kick, move, sums):
        """Kick, move and compute the forces there.

        Returns `sums`, elastic energy, what the dashpots' power is proportional to, contact force, contact potential.
        """
        result = sums
        if ti.static(self.single):
            result = self.move_frame(kick * p.g, move * p.h, sums)
        total, highest = self.drift(p, kick * p.g, move * p.h, result, 0, p.n)
        elastic, products = self.add_spring_forces(p, self.physics.explicit_dashpot, 0, p.blocks)
        result, upward, potential = self.touch(p, move * p.h, result, total, highest)
        return result, elastic, products, upward, potential

    @ti.func
    def touch(self, p: ti.template(), move, sums, push, top):
        """After the springs' forces: contact with the elastic wall, hand, pinned points; notes the wall's force.

        The points have just moved by `move` times the velocity; `push` and `top` are the rigid wall's force and the
        largest on one point. Returns `sums`, and force and potential of the contact with the elastic wall.
        """
        result, total, highest = sums, push, top
        upward = ti.Vector.zero(self.real, self.lanes)
        potential = ti.Vector.zero(self.real, self.lanes)
        if ti.static(self.uses("elastic wall")):
            slid = ti.Vector.zero(self.real, self.lanes)
            upward, potential, highest, slid = self.add_contact_forces(p, move, result)
            total = upward
            for w in ti.static(range(self.lanes)):
                result[SLIDING, w] += slid[w]
        if ti.static(self.uses("pull of a hand")):
            self.add_pull_of_hand(p, result)
        if ti.static(self.uses("pinned boundary")):
            self.hold_boundary(p)
        for w in ti.static(range(self.lanes)):
            result[PEAK, w] = ti.max(result[PEAK, w], highest[w])
        if ti.static(self.single):
            result = self.push_frame(p, total, result)
        return result, upward, potential

    @ti.func
    def step(self, p: ti.template(), number, before):
        """Make step `number`; returns `sums`, and elastic energy, contact force and contact potential after it."""
        sums = before
        elastic = ti.Vector.zero(self.real, self.lanes)
        products = ti.Vector.zero(self.real, self.lanes)
        upward = ti.Vector.zero(self.real, self.lanes)
        potential = ti.Vector.zero(self.real, self.lanes)
        if ti.static(self.splitting.forces == 1):
            sums, elastic, products, upward, potential = self.stage(p, 1.0, 1.0, sums)
        else:
            for k in range(self.splitting.forces):
                kick, move = 0.0, 0.0
                for s in ti.static(range(self.splitting.forces)):
                    if k == s:
                        kick, move = self.splitting.joined_kicks[s], self.splitting.moves[s]
                sums, elastic, products, upward, potential = self.stage(p, kick, move, sums)
        return self.account(p, number, sums, products), elastic, upward, potential

    @ti.func
    def account(self, p: ti.template(), number, sums, products):
        """End step `number`: dashpots that act on points, the energy that all dashpots took, the boundary's reset.

        `products` is that of the springs. Returns `sums`.
        """
        power = ti.Vector.zero(self.real, self.lanes)
        cross = ti.Vector.zero(self.real, self.lanes)
        boundary_power = ti.Vector.zero(self.real, self.lanes)
        if ti.static(self.uses("explicit dashpot")):
            power = ti.Vector([part[None] for part in self.eta]) * products
        if ti.static(self.uses("dashpot boundary") and not self.physics.implicit_dashpot):
            boundary_power = self.damp_boundary(p)
        if ti.static(self.uses("implicit dashpot")):
            power, cross, boundary_power = self.solve_velocities(p)
        result = sums
        for w in ti.static(range(self.lanes)):
            p0, p1, b0, b1 = sums[POWER, w], power[w], sums[BOUNDARY_POWER, w], boundary_power[w]
            # What leapfrog keeps, E + h^2 E_2 + O(h^4), loses not g int(x1^2) in a dashpot g but, with xn the n-th
            # derivative, g int(x1^2 + c h^2 x2^2): c = 2/3 where the velocity is predicted, u = x1 - h^2/2 x3, and 1/6
            # where it is centred. Of the sums at hand u.u gives c = 1 and u.v, v half a step ago, 1/2, a quarter of
            # a step late; v.v 1/4, half a step late. Two thirds of the latter, moved to the step, and a third of
            # the first are the loss to O(h^4).
            loss = p.h * (p0 + 2.0 * p1) / 3.0
            boundary_loss = p.h * (b0 + 5.0 * b1) / 6.0
            if ti.static(self.physics.implicit_dashpot):
                # Trapezoidal leapfrog obeys x2 + h^2/12 x4 = -w^2 x - g (x1 + h^2/6 x3) to O(h^4) and loses
                # g int(x1^2 - h^2/6 x2^2): this sum is that to O(h^4).
                boundary_loss = 0.5 * p.h * (b0 + b1)
                loss = p.h * (2.0 / 3.0 * (p0 + p1) - 1.0 / 3.0 * cross[w]) - boundary_loss
            result[DISSIPATED, w] += loss
            result[POWER, w] = p1
            result[ABSORBED, w] += boundary_loss
            result[BOUNDARY_POWER, w] = b1
        if ti.static(self.uses("reset boundary")):
            result = self.reset_boundary(p, number % p.reset_steps == 0, sums, result)
        elif ti.static(self.physics.implicit_dashpot and self.sweeps == 0):
            self.take_damped_force(p)
        return result

    @ti.kernel
    def _advance(
        self,
        numbers: Parameters,
        number: ti.i32,
        samples: ti.i32,
        stride: ti.i32,
        rows: ti.types.ndarray(dtype=ti.f64, ndim=3),
    ):
        ti.loop_config(serialize=True)
        for _ in range(1):
            p = rounded(numbers) if ti.static(self.single) else numbers
            sums = get(self.sums, 0)
            for s in range(samples):
                elastic = ti.Vector.zero(self.real, self.lanes)
                upward = ti.Vector.zero(self.real, self.lanes)
                potential = ti.Vector.zero(self.real, self.lanes)
                for k in range(stride):
                    sums, elastic, upward, potential = self.step(p, number + s * stride + k + 1, sums)
                self.observe(p, rows, s, sums, elastic, upward, potential)
            put(self.sums, 0, sums)

    @ti.kernel
    def _initialise(self, numbers: Parameters, rows: ti.types.ndarray(dtype=ti.f64, ndim=3)):
        """From x_0 and v_0 (in `v`): the forces at t = 0 and the velocities before the last kick."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            p = rounded(numbers) if ti.static(self.single) else numbers
            sums = get(self.sums, 0)
            total = ti.Vector.zero(self.real, self.lanes)
            for i in range(p.n):
                force, push = self.outer_force(p, i, sums)
                total += push
                put(self.f, i, force)
                if ti.static(self.physics.dissipates):
                    put(self.u, i, get(self.v, i))
            elastic, products = self.add_spring_forces(p, self.physics.dissipates, 0, p.blocks)
            upward = ti.Vector.zero(self.real, self.lanes)
            potential = ti.Vector.zero(self.real, self.lanes)
            if ti.static(self.physics.wall == "elastic"):
                upward, potential, _highest, _slid = self.add_contact_forces(p, 0.0, sums)
                total = upward
            if ti.static(self.physics.boundary == "pinned"):
                self.hold_boundary(p)
            if ti.static(self.physics.dissipates):
                power = ti.Vector([part[None] for part in self.eta]) * products
                for w in ti.static(range(self.lanes)):
                    sums[POWER, w] = power[w]
            if ti.static(self.physics.boundary == "dashpot"):
                for k in range(p.n_boundary):
                    i, Z = self.boundary[k], get(self.impedance, k)
                    v, f = get(self.v, i), get(self.f, i)
                    for w in ti.static(range(self.lanes)):
                        for c in ti.static(range(2)):
                            f[c, w] -= Z[c] * v[c, w]
                            sums[BOUNDARY_POWER, w] += Z[c] * v[c, w] * v[c, w]
                    put(self.f, i, f)
                if ti.static(self.physics.implicit_dashpot):
                    for w in ti.static(range(self.lanes)):  # whose power is that of all dashpots together
                        sums[POWER, w] += sums[BOUNDARY_POWER, w]
            if ti.static(self.single):
                sums = self.push_frame(p, total, sums)
                sums = self.move_frame(-p.closing, 0.0, sums)
            for i in range(p.n):
                v = get(self.v, i) - p.closing * get(self.f, i)
                if ti.static(self.single):
                    gain = self.frame_kick(p, i, p.closing, sums)
                    for w in ti.static(range(self.lanes)):
                        v[1, w] += gain[w]
                put(self.v, i, v)
            put(self.sums, 0, sums)
            self.observe(p, rows, 0, sums, elastic, upward, potential)
