"""The state of the points in Taichi fields, and the step that changes it: drift, forces, boundary, dashpots.

Between steps the state holds x_k, f_k and the velocity before the last kick, v_k - closing f_k (in leapfrog:
v_{k-1/2}).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.engine import ti
from taichi_disk.integrators import Integrator
from taichi_disk.integrators.trapezoidal import DashpotSolver
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model
from taichi_disk.physics.law import BodyForce, Capacity, Reals1, Reals3, array, get, pair_of, put, scalar
from taichi_disk.simulation.observables import (
    ABSORBED,
    BOUNDARY_POWER,
    DISSIPATED,
    FRICTION,
    FRICTION_POWER,
    INITIAL_LOSS,
    LEAVING,
    PEAK_POINT_FORCE,
    POWER,
    SLIDING,
    SUMS,
)


@dataclass(frozen=True)
class Snapshot:
    """All that a simulation needs to go on from step `step`, bitwise as it would have.

    Attributes:
        vectors: (3 to 7, n, 2) positions [R], velocities before the last kick [c], forces [M c^2/R]; with dashpots
            also the velocities at the step, predicted or solved for; where they are iterated, those of three steps
            before. With a correction: the velocities that are observed, before their last kick; the positions X.
        sums: (SUMS,) dissipated, its power, absorbed, its power, largest force of the wall on a point, sliding, what
            the next step is to lose at its start, and in all (see `account`); (SUMS + 2,) also what friction took, its
            power.
    """

    step: int
    vectors: Array
    sums: Array

    def velocities(self, integrator: Integrator, dt: float, lattice: Lattice) -> Array:
        """(n, 2) at the step, after its last kick [c]."""
        v, f = self.vectors[3 if integrator.correction else 1], self.vectors[2]
        return np.asarray(
            v + integrator.observed_kick * dt * (1.0 / lattice.masses[:, None]) * f
        )  # as kernels round it


@ti.data_oriented
class State:
    """Fields of the points (`x`, `v`, `f`, `u`: see `Snapshot`), and 0-D fields of the numbers that every kernel needs.

    `mass`, `inverse_mass`: of each point [M], [1/M]; the disk's add up to 1 M. `h`: time step; `closing`: for how long
    its last kick acts, h/2 in leapfrog, and `observed`, on the velocities that are observed [R/c]; `contact`: the
    wall's force on a point from which the disk is in contact [M c^2/R]; `n`, `n_disk`: points, those of the disk;
    `reset_steps`: steps between two resets of the boundary.
    """

    def __init__(self, builder: Any, capacity: Capacity, subdomains: int, model: Model, corrected: bool) -> None:
        self.fillers = 2 * subdomains  # points that carry the springs that fill up blocks
        filled = capacity.points + self.fillers
        self.x, self.v, self.f = (pair_of(builder, filled) for _ in range(3))
        self.vectors = [self.x, self.v, self.f]
        self.corrected = corrected
        if model.springs.damped or corrected:
            self.u = pair_of(builder, filled)
            self.vectors.append(self.u)
        if corrected:
            self.X = pair_of(builder, filled)
            self.vectors.append(self.X)
        self.mass, self.inverse_mass = (array(builder, capacity.points, ti.f64) for _ in range(2))
        self.h, self.closing, self.observed, self.contact = (scalar(builder) for _ in range(4))
        self.n, self.n_disk, self.blocks, self.subdomain_points, self.reset_steps = (
            scalar(builder, ti.i32) for _ in range(5)
        )
        self.summed = SUMS + 2 * model.has_friction
        self.sums = array(builder, self.summed, ti.f64)

    # ---- in and out

    def begin(self, numbers: Sequence[tuple[Any, float]], lattice: Lattice, start: Array) -> None:
        """Write each number into its 0-D field, the same fields in every call, and `start` (3 to 5, n, 2), vectors."""
        self.scalars = [field for field, _ in numbers]
        n = start.shape[1]
        vectors = np.zeros((len(self.vectors), n + self.fillers, 2))
        vectors[: len(start), :n] = start
        vectors[0, n + 1 :: 2, 0] = 1.0  # springs that fill up blocks lie at rest between (0, 0) and (1, 0)
        values = np.array([value for _, value in numbers], np.float64)
        self._begin(values, lattice.masses, vectors, np.zeros(self.summed))

    @ti.kernel
    def _begin(self, numbers: Reals1, masses: Reals1, vectors: Reals3, sums: Reals1):
        for k in ti.static(range(len(self.scalars))):
            self.scalars[k][None] = ti.cast(numbers[k], self.scalars[k].dtype)
        ti.loop_config(serialize=True)
        for _ in range(1):
            i = 0
            while i < masses.shape[0]:
                self.mass[i] = masses[i]
                self.inverse_mass[i] = 1.0 / masses[i]
                i += 1
            self.copy(vectors, sums, True)

    def export(self, n: int, step: int) -> Snapshot:
        vectors, sums = np.zeros((len(self.vectors), n, 2)), np.zeros(self.summed)
        self._copy(vectors, sums, False)
        return Snapshot(step, vectors, sums)

    def restore(self, snapshot: Snapshot) -> None:
        self._copy(snapshot.vectors, snapshot.sums, True)

    @ti.kernel
    def _copy(self, vectors: Reals3, sums: Reals1, into: ti.template()):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.copy(vectors, sums, into)

    @ti.func
    def copy(self, vectors: ti.template(), sums: ti.template(), into: ti.template()):
        i = 0
        while i < vectors.shape[1]:  # of a `for`, LLVM makes vectors, for longer than a run copies
            for k in ti.static(range(len(self.vectors))):
                for c in ti.static(range(2)):
                    if ti.static(into):
                        self.vectors[k][c][i] = vectors[k, i, c]
                    else:
                        vectors[k, i, c] = self.vectors[k][c][i]
            i += 1
        for k in ti.static(range(self.summed)):
            if ti.static(into):
                self.sums[k] = sums[k]
            else:
                sums[k] = self.sums[k]


@ti.data_oriented
class Stepping:
    """Moves the points of `state` by the laws of `model`, on one core.

    Laws that are absent are absent from the kernels: all conditions here are decided when they are compiled.
    """

    def __init__(self, state: State, model: Model, integrator: Integrator, solver: DashpotSolver | None) -> None:
        self.state, self.integrator, self.solver = state, integrator, solver
        laws: Any = model  # where a law is absent, no kernel asks for it
        self.springs, self.wall, self.mouse, self.boundary = laws.springs, laws.wall, laws.mouse, laws.boundary
        self.rigid = isinstance(model.wall, BodyForce)
        self.contact, self.has_friction = model.wall is not None and not self.rigid, model.has_friction
        self.loads = tuple(law for law in model.body_forces if law is not model.wall)
        self.velocities = state.u if state.corrected else state.v  # that are observed, before a last kick
        self.damped, self.implicit = model.springs.damped, solver is not None
        self.explicit = self.damped and not self.implicit
        self.pinned, self.matched, self.reset = model.is_pinned, model.impedance is not None, model.reset_interval > 0.0

    # ---- forces

    @ti.func
    def drift(self, kick, move, shift, first, last):
        """Kick points first..last for the time `kick`, move them for `move` [R/c]; the forces on single points there.

        With a correction, `shift` [R^2/c^2] times the acceleration is the way from X to x.

        Returns the rigid wall's largest force on a point.
        """
        peak_point_force = 0.0
        half = 0.5 * self.state.h[None]
        for i in range(first, last):
            acceleration = self.state.inverse_mass[i] * get(self.state.f, i)
            v = get(self.state.v, i) + kick * acceleration
            put(self.state.v, i, v)
            if ti.static(self.state.corrected):
                if move != 0.0:
                    put(self.state.X, i, get(self.state.X, i) + move * v)
                    put(self.state.x, i, get(self.state.X, i))
                    # v - h^2/12 da/dt, with the difference of two steps' accelerations
                    put(self.state.u, i, v + (self.state.closing[None] - self.state.observed[None]) * acceleration)
                elif shift != 0.0:
                    put(self.state.x, i, get(self.state.X, i) + shift * acceleration)
            else:
                put(self.state.x, i, get(self.state.x, i) + move * v)
            if ti.static(self.explicit):
                put(self.state.u, i, v + half * acceleration)
            peak_point_force = ti.max(peak_point_force, self.body_force(i))
        return peak_point_force

    @ti.func
    def body_force(self, i):
        """Set `f` of point i to the forces on single points; returns the rigid wall's upward force on it."""
        force, point_force = ti.Vector([0.0, 0.0]), 0.0
        if ti.static(self.rigid):
            force = self.wall.at(self.state, i)
            point_force = force[1]
        for law in ti.static(self.loads):
            force = force + law.at(self.state, i)
        put(self.state.f, i, force)
        return point_force

    @ti.func
    def stage(self, kick, move, shift, sums):
        """Kick, move and compute the forces there. Returns as `touch`, with what `Springs.add` gives in between."""
        peak_point_force = self.drift(kick, move, shift, 0, self.state.n[None])
        elastic, products = self.springs.add(self.state, self.explicit, 0, self.state.blocks[None])
        result, upward, potential = self.touch(move, sums, peak_point_force)
        return result, elastic, products, upward, potential

    @ti.func
    def touch(self, move, sums, rigid_peak):
        """After the springs' forces those of the elastic wall, and what holds points.

        The points have just moved by `move` times the velocity; `rigid_peak` is the rigid wall's largest force on one
        point. Returns `sums`, force and potential of the contact with the elastic wall.
        """
        result, peak_point_force = sums, rigid_peak
        upward, potential = 0.0, 0.0
        if ti.static(self.contact):
            slid = 0.0
            upward, potential, peak_point_force, slid = self.wall.add(self.state, move)
            result[SLIDING] += slid
        if ti.static(self.pinned):
            self.boundary.hold(self.state)
        result[PEAK_POINT_FORCE] = ti.max(result[PEAK_POINT_FORCE], peak_point_force)
        return result, upward, potential

    # ---- a step

    @ti.func
    def step(self, number, before):
        """Make step `number`; returns `sums`, and elastic energy, contact force and contact potential after it.

        Step 0 moves nothing: from x_0 and v_0 (in `v` and `u`) it computes the forces at t = 0, and takes back the
        last kick of a step before.
        """
        sums, h = before, self.passed(number, self.state.h[None])
        elastic, products, upward, potential = 0.0, 0.0, 0.0, 0.0
        if ti.static(self.integrator.forces == 1):
            sums, elastic, products, upward, potential = self.stage(h, h, 0.0, sums)
        else:
            last = ti.static(self.integrator.forces - 1)
            for k in range(ti.select(number > 0, 0, last), last + 1):  # a loop: four inlined stages compile slowly
                kick, move, shift = 0.0, 0.0, 0.0
                for s in ti.static(range(self.integrator.forces)):
                    if k == s:
                        kick, move, shift = self.integrator.stages[s]
                sums, elastic, products, upward, potential = self.stage(kick * h, move * h, shift * h * h, sums)
        return self.account(number, sums, products), elastic, upward, potential

    @ti.func
    def passed(self, number, time):
        """Return `time` [R/c] of step `number`, but 0 of step 0, in which no time passes."""
        return time * ti.cast(number > 0, ti.f64)

    @ti.func
    def age(self, number):
        """How many steps ago velocities jumped last: at t = 0, or when the boundary was reset."""
        age = number
        if ti.static(self.reset):
            if number > 0:
                age = (number - 1) % self.state.reset_steps[None] + 1
        return age

    @ti.func
    def account(self, number, sums, products):
        """End step `number`: dashpots that act on points, the energy that all dashpots took, the boundary's reset.

        `products` is that of the springs. Returns `sums`.
        """
        h, closing = self.passed(number, self.state.h[None]), self.passed(number, self.state.closing[None])
        power, cross, late, boundary_power = 0.0, 0.0, 0.0, 0.0
        if ti.static(self.explicit):
            power = self.springs.eta_now[None] * products
        if ti.static(self.implicit):
            power, cross, late = self.solver.solve_velocities(self.state, self.age(number))
            if ti.static(self.matched):
                boundary_power = self.boundary.solved_power(self.state)
        elif ti.static(self.matched):
            boundary_power = self.boundary.damp(self.state, 0.5 * h)
        result = sums
        p0, p1, b0, b1 = sums[POWER], power, sums[BOUNDARY_POWER], boundary_power
        # What leapfrog keeps, E + h^2 E_2 + O(h^4), loses in a dashpot g not g int(x1^2) but g int(x1^2 + c h^2 x2^2),
        # xn the n-th derivative: c = 2/3 where the velocity is predicted, 1/6 where it is centred, -1/6 where it is
        # solved for. These sums are that to O(h^4), though some velocities at hand are half a step late.
        loss = h * (p0 + 2.0 * p1) / 3.0
        boundary_loss = h * (b0 + 5.0 * b1) / 6.0
        if ti.static(self.implicit):
            boundary_loss = 0.5 * h * (b0 + b1)
            # Where velocities are solved for, the sum for c = -1/6 holds only while h times the fastest rate is small.
            # In flight another sum is exact for linear springs at any rate. In contact that one would drift as h^2.
            loss = 0.25 * h * (sums[LEAVING] + p1 + late)
            if sums[PEAK_POINT_FORCE] >= self.state.contact[None]:
                loss = h * (2.0 / 3.0 * (p0 + p1) - 1.0 / 3.0 * cross)
            loss -= boundary_loss
            result[LEAVING] = ti.select(number > 0, 3.0 * p1 - late, p1 + late)
        result[DISSIPATED] += loss + sums[INITIAL_LOSS]
        result[INITIAL_LOSS] = 0.0
        result[POWER] = p1
        result[ABSORBED] += boundary_loss
        result[BOUNDARY_POWER] = b1
        if ti.static(self.reset):
            result = self.reset_boundary(number, sums, result)
        elif ti.static(self.implicit):
            result[INITIAL_LOSS] = self.take_damped_force(number, sums)
        if ti.static(self.has_friction):
            friction_power = self.wall.rub(self.state, closing + self.state.closing[None], closing)
            result[FRICTION] += 0.5 * h * (sums[FRICTION_POWER] + friction_power)
            result[FRICTION_POWER] = friction_power
        if number == 0:
            for i in range(self.state.n[None]):
                kick = self.state.closing[None] * self.state.inverse_mass[i]
                put(self.state.v, i, get(self.state.v, i) - kick * get(self.state.f, i))
        return result

    @ti.func
    def take_damped_force(self, number, sums):
        """Put the force that the solved velocities imply into `f`; returns the loss that step 0 leaves to the next."""
        stored = self.solver.take_damped_force(self.state)
        # Only the sum of the flight begins with it.
        return ti.select(number == 0 and sums[PEAK_POINT_FORCE] < self.state.contact[None], stored, 0.0)

    @ti.func
    def reset_boundary(self, number, before, sums):
        """Stop the boundary if it is time to; returns `sums` with what that absorbed.

        With dashpots, whose force jumps then, their loss over a step is summed as -h/2 (f_k + f_{k+1}) v_{k+1/2}, f the
        dashpots' force at either end as it acted.
        """
        result = sums
        h = self.passed(number, self.state.h[None])
        if ti.static(self.damped):
            power = self.boundary.dashpot_work(self.state, self.springs, 0.0)
            loss = 0.5 * h * (before[POWER] + power) + before[INITIAL_LOSS]
            result[DISSIPATED] = before[DISSIPATED] + loss
        if number > 0 and number % self.state.reset_steps[None] == 0:
            result[ABSORBED] += self.boundary.stop(self.state, self.springs, self.solver, self.implicit)
        elif ti.static(self.implicit):
            result[INITIAL_LOSS] = self.take_damped_force(number, before)
        if ti.static(self.damped):
            next_kick = self.passed(number, self.state.closing[None]) + self.state.closing[None]
            result[POWER] = self.boundary.dashpot_work(self.state, self.springs, next_kick)
        return result
