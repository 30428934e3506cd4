"""The step: drift, forces, boundary, dashpots; and the kernel that makes many of them at once.

Between steps the state holds x_k, f_k and the velocity before the last kick, v_k - closing f_k (in leapfrog:
v_{k-1/2}). All steps between two looks run inside one kernel: launching one costs as much as a step.
"""

from typing import Any

import taichi as ti

from taichi_disk.integrators import Integrator
from taichi_disk.integrators.trapezoidal import DashpotSolver, Factor
from taichi_disk.physics import MatchedBoundary, Model, PinnedBoundary, ResetBoundary
from taichi_disk.physics.ordering import Arrangement
from taichi_disk.physics.points import Integers1, Reals2, get, put
from taichi_disk.simulation.observables import (
    ABSORBED,
    BOUNDARY_POWER,
    COLUMNS,
    DISSIPATED,
    INDEX,
    LEAVING,
    PEAK,
    POWER,
    SLIDING,
    SUMS,
)
from taichi_disk.simulation.state import State


@ti.data_oriented
class Stepping:
    """Moves the points of `state` by the laws of `model`, on one core.

    Laws that are absent are absent from the kernels: all conditions here are decided when they are compiled.
    """

    def __init__(self, state: State, model: Model, integrator: Integrator, solver: DashpotSolver | None) -> None:
        self.state, self.integrator, self.solver = state, integrator, solver
        self.springs, self.body_forces = model.springs, model.body_forces
        laws: Any = model  # where a law is absent, no kernel asks for it
        self.elastic_wall, self.mouse, self.boundary = laws.elastic, laws.mouse, laws.boundary
        self.contact = model.elastic is not None
        self.damped, self.implicit = model.springs.damped, solver is not None
        self.explicit = self.damped and not self.implicit
        self.pinned = isinstance(model.boundary, PinnedBoundary)
        self.matched = isinstance(model.boundary, MatchedBoundary)
        self.reset = isinstance(model.boundary, ResetBoundary)

    def fill(self, arrangement: Arrangement, factor: Factor | None) -> None:
        """Take what follows from another lattice or step."""
        if self.solver is not None and factor is not None:
            self.solver.fill(factor)

    # ---- forces

    @ti.func
    def drift(self, kick, move, first, last):
        """Kick and move points first..last; the forces on single points there. Returns the rigid wall's largest."""
        highest = 0.0
        half = 0.5 * self.state.g[None]
        for i in range(first, last):
            f = get(self.state.f, i)
            v = get(self.state.v, i) + kick * f
            put(self.state.v, i, v)
            put(self.state.x, i, get(self.state.x, i) + move * v)
            if ti.static(self.explicit):
                put(self.state.u, i, v + half * f)
            highest = ti.max(highest, self.body_force(i))
        return highest

    @ti.func
    def body_force(self, i):
        """Set `f` of point i to the forces on single points; returns the wall's upward share."""
        force = ti.Vector([0.0, 0.0])
        push = 0.0
        for law in ti.static(self.body_forces):
            one = law.at(self.state, i)
            force = force + one
            if ti.static(law.column == "wall"):
                push += one[1]
        put(self.state.f, i, force)
        return push

    @ti.func
    def stage(self, kick, move, sums):
        """Kick, move and compute the forces there. Returns as `touch`, with what `Springs.add` gives in between."""
        highest = self.drift(kick * self.state.g[None], move * self.state.h[None], 0, self.state.n[None])
        elastic, products = self.springs.add(self.state, self.explicit, 0, self.state.blocks[None])
        result, upward, potential = self.touch(move * self.state.h[None], sums, highest)
        return result, elastic, products, upward, potential

    @ti.func
    def touch(self, move, sums, top):
        """After the springs' forces those of the elastic wall, and what holds points.

        The points have just moved by `move` times the velocity; `top` is the rigid wall's largest force on one point.
        Returns `sums`, force and potential of the contact with the elastic wall.
        """
        result, highest = sums, top
        upward, potential = 0.0, 0.0
        if ti.static(self.contact):
            slid = 0.0
            upward, potential, highest, slid = self.elastic_wall.add(self.state, move)
            result[SLIDING] += slid
        if ti.static(self.pinned):
            self.boundary.hold(self.state)
        result[PEAK] = ti.max(result[PEAK], highest)
        return result, upward, potential

    # ---- a step

    @ti.func
    def step(self, number, before):
        """Make step `number`; returns `sums`, and elastic energy, contact force and contact potential after it."""
        sums = before
        elastic, products, upward, potential = 0.0, 0.0, 0.0, 0.0
        if ti.static(self.integrator.forces == 1):
            sums, elastic, products, upward, potential = self.stage(1.0, 1.0, sums)
        else:
            for k in range(self.integrator.forces):  # a loop: what is inlined four times takes long to compile
                kick, move = 0.0, 0.0
                for s in ti.static(range(self.integrator.forces)):
                    if k == s:
                        kick, move = self.integrator.joined_kicks[s], self.integrator.moves[s]
                sums, elastic, products, upward, potential = self.stage(kick, move, sums)
        return self.account(number, sums, products), elastic, upward, potential

    @ti.func
    def account(self, number, sums, products):
        """End step `number`: dashpots that act on points, the energy that all dashpots took, the boundary's reset.

        `products` is that of the springs. Returns `sums`.
        """
        h = self.state.h[None]
        power, cross, late, boundary_power = 0.0, 0.0, 0.0, 0.0
        if ti.static(self.explicit):
            power = self.springs.now.eta[None] * products
        if ti.static(self.implicit):
            power, cross, late = self.solver.solve_velocities(self.state)
            if ti.static(self.matched):
                boundary_power = self.boundary.solved_power(self.state)
        elif ti.static(self.matched):
            boundary_power = self.boundary.damp(self.state, 0.5 * self.state.g[None])
        result = sums
        p0, p1, b0, b1 = sums[POWER], power, sums[BOUNDARY_POWER], boundary_power
        # What leapfrog keeps, E + h^2 E_2 + O(h^4), loses in a dashpot g not g int(x1^2) but g int(x1^2 + c h^2 x2^2),
        # xn the n-th derivative: c = 2/3 where the velocity is predicted, 1/6 where it is centred, -1/6 where it is
        # solved for. These sums are that to O(h^4), though some velocities at hand are half a step late.
        loss = h * (p0 + 2.0 * p1) / 3.0
        boundary_loss = h * (b0 + 5.0 * b1) / 6.0
        if ti.static(self.implicit):
            boundary_loss = 0.5 * h * (b0 + b1)
            # Solved for, that holds while h times the fastest rate is small. This is exact for linear springs at any
            # rate, but drifts as h^2 where the wall pushes.
            loss = 0.25 * h * (sums[LEAVING] + p1 + late)
            if sums[PEAK] >= self.state.contact[None]:
                loss = h * (2.0 / 3.0 * (p0 + p1) - 1.0 / 3.0 * cross)
            loss -= boundary_loss
            result[LEAVING] = 3.0 * p1 - late
        result[DISSIPATED] += loss
        result[POWER] = p1
        result[ABSORBED] += boundary_loss
        result[BOUNDARY_POWER] = b1
        if ti.static(self.reset):
            result = self.reset_boundary(number, sums, result)
        elif ti.static(self.implicit):
            self.solver.take_damped_force(self.state)
        return result

    @ti.func
    def reset_boundary(self, number, before, sums):
        """Stop the boundary if it is time to; returns `sums` with what that absorbed.

        With dashpots, whose force jumps then, their loss over a step is summed as -h/2 (f_k + f_{k+1}) v_{k+1/2}, f the
        dashpots' force at either end as it acted.
        """
        result = sums
        if ti.static(self.damped):
            power = self.boundary.dashpot_work(self.state, self.springs, 0.0)
            result[DISSIPATED] = before[DISSIPATED] + 0.5 * self.state.h[None] * (before[POWER] + power)
        if number % self.state.reset_steps[None] == 0:
            result[ABSORBED] += self.boundary.stop(self.state, self.springs, self.solver, self.implicit)
        elif ti.static(self.implicit):
            self.solver.take_damped_force(self.state)
        if ti.static(self.damped):
            result[POWER] = self.boundary.dashpot_work(self.state, self.springs, self.state.g[None])
        return result

    # ---- kernels

    @ti.kernel
    def advance(self, first: ti.i32, steps: ti.i32, stride: ti.i32, rows: Reals2, bounds: Reals2, counts: Integers1):
        """Make `steps` steps after step `first`, fewer if the rows meet the bounds of a scene's end.

        `rows` is filled at every multiple of `stride`, and after the last step. `bounds` (2, columns): least and
        largest value of every column. `counts`: how many rows running have to be within them; how many are; then what
        was made: steps, rows at multiples of `stride`.
        """
        ti.loop_config(serialize=True)
        for _ in range(1):
            sums = ti.Vector([self.state.sums[k] for k in range(SUMS)])
            made, row, needed, held = 0, 0, counts[0], counts[1]
            while made < steps and held < needed:
                made += 1
                elastic, upward, potential = 0.0, 0.0, 0.0
                sums, elastic, upward, potential = self.step(first + made, sums)
                due = (first + made) % stride == 0
                if due or made == steps:
                    self.observe(rows, row, sums, elastic, upward, potential)
                if due:
                    inside = 1
                    for k in ti.static(range(len(COLUMNS))):
                        if rows[row, k] < bounds[0, k] or rows[row, k] > bounds[1, k]:
                            inside = 0
                    held = (held + 1) * inside
                    row += 1
            counts[1], counts[2], counts[3] = held, made, row
            for k in ti.static(range(SUMS)):
                self.state.sums[k] = sums[k]

    @ti.kernel
    def initialise(self, rows: Reals2):
        """From x_0 and v_0 (in `v`): the forces at t = 0, the velocities before the last kick, the first row."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            sums, highest = ti.Vector([0.0 for k in range(SUMS)]), 0.0
            for i in range(self.state.n[None]):
                highest = ti.max(highest, self.body_force(i))
                if ti.static(self.damped):
                    put(self.state.u, i, get(self.state.v, i))
            elastic, products = self.springs.add(self.state, self.explicit, 0, self.state.blocks[None])
            upward, potential, stored = 0.0, 0.0, 0.0
            sums, upward, potential = self.touch(0.0, sums, highest)
            if ti.static(self.implicit):
                power, late = 0.0, 0.0
                power, late, stored = self.solver.begin(self.state)
                sums[POWER], sums[LEAVING] = power, power + late
                if ti.static(self.matched):
                    sums[BOUNDARY_POWER] = self.boundary.solved_power(self.state)
            else:
                if ti.static(self.damped):
                    sums[POWER] = self.springs.now.eta[None] * products
                if ti.static(self.matched):
                    sums[BOUNDARY_POWER] = self.boundary.damp(self.state, 0.0)
            for i in range(self.state.n[None]):
                put(self.state.v, i, get(self.state.v, i) - self.state.closing[None] * get(self.state.f, i))
            self.observe(rows, 0, sums, elastic, upward, potential)
            sums[DISSIPATED] = stored
            for k in ti.static(range(SUMS)):
                self.state.sums[k] = sums[k]

    @ti.kernel
    def set_mouse_target(self, point: ti.i32, x: ti.f64, y: ti.f64) -> ti.f64:
        """The mouse pulls `point` (-1: none) towards (x, y) from now on; returns the energy given by that [M c^2]."""
        given = self.mouse.change(self.state, -1.0)
        self.mouse.point[0], self.mouse.target[0][0], self.mouse.target[1][0] = point, x, y
        given += self.mouse.change(self.state, 1.0)
        return given

    @ti.func
    def observe(self, rows: ti.template(), s, sums, elastic, upward, potential):
        """Fill row `s` with the observables of COLUMNS; contact force and potential are those of the elastic wall."""
        sx, sy, svx, svy, spin, v2, residual2 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        force, energy, load = upward, potential, 0.0
        lowest = self.state.x[1][0]
        for i in range(self.state.n[None]):
            x, y = self.state.x[0][i], self.state.x[1][i]
            f = get(self.state.f, i)
            v = get(self.state.v, i) + self.state.closing[None] * f
            vx, vy = v[0], v[1]
            if i < self.state.n_disk[None]:
                sx += x
                sy += y
                svx += vx
                svy += vy
                spin += x * vy - y * vx
                lowest = ti.min(lowest, y)
                residual2 = ti.max(residual2, f[0] * f[0] + f[1] * f[1])
                for law in ti.static(self.body_forces):
                    if ti.static(law.column == "wall"):
                        push = law.at(self.state, i)
                        if push[0] != 0.0 or push[1] != 0.0:  # out of reach there is no potential either
                            energy += law.potential_at(self.state, i)
                            force += push[1]
                    else:
                        load += law.potential_at(self.state, i)
            v2 += vx * vx + vy * vy
        count, m = ti.cast(self.state.n_disk[None], ti.f64), self.state.m[None]
        rows[s, INDEX["com_x"]] = sx / count
        rows[s, INDEX["com_y"]] = sy / count
        rows[s, INDEX["com_vx"]] = svx / count
        rows[s, INDEX["com_vy"]] = svy / count
        rows[s, INDEX["angular_momentum"]] = m * (spin - (sx * svy - sy * svx) / count)
        rows[s, INDEX["lowest_y"]] = lowest
        rows[s, INDEX["wall_force"]] = force
        rows[s, INDEX["kinetic"]] = 0.5 * m * v2
        rows[s, INDEX["elastic"]] = elastic
        rows[s, INDEX["wall"]] = energy
        rows[s, INDEX["dissipated"]] = sums[DISSIPATED]
        rows[s, INDEX["absorbed"]] = sums[ABSORBED]
        rows[s, INDEX["load"]] = load
        rows[s, INDEX["sliding"]] = sums[SLIDING]
        rows[s, INDEX["residual"]] = ti.sqrt(residual2)
