"""The state of the points in Taichi fields, and the step that changes it: drift,
forces, boundary, dashpots.

Between steps the state holds x_k, f_k and the velocity before the last kick, v_k -
closing f_k (v_{k-1/2} in leapfrog).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.integrators import Integrator
from taichi_disk.mechanics.integrators.trapezoidal import DashpotSolver
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import Model
from taichi_disk.mechanics.physics.law import (
    Capacity,
    Contents,
    Integers1,
    Reals1,
    Reals3,
    array,
    get,
    pair_of,
    put,
    scalar,
    side_by_side,
)
from taichi_disk.mechanics.physics.ordering import Arrangement

# Accumulators of a run, and sums of its last step. They are in a 1-D field: Taichi
# 1.7.4 keeps a 0-D field in a register across loops, so later loops would read the old
# value.
SUMS = 14
(
    DISSIPATED,
    POWER,
    ABSORBED,
    BOUNDARY_POWER,
    PEAK_POINT_FORCE,
    SLIDING,
    LEAVING,
    INITIAL_LOSS,
    FRICTION,
    FRICTION_POWER,
    # of the last step: elastic energy and products (see `Springs.add`), upward force
    # and potential of the contact with an elastic wall
    ELASTIC,
    PRODUCTS,
    UPWARD,
    POTENTIAL,
) = range(SUMS)


@dataclass(frozen=True)
class Snapshot:
    """All values from which a simulation continues bitwise after step `step`."""

    step: int
    # (3 to 8, n, 2): positions [R], velocities before the last kick [c], forces [M
    # c^2/R]; with dashpots the velocities at the step, and with conjugate gradients
    # those of earlier steps; with a correction the observed velocities before their
    # last kick and the positions X.
    vectors: Array
    sums: Array  # (SUMS,)

    def velocities(self, integrator: Integrator, dt: float, lattice: Lattice) -> Array:
        """Return the velocities (n, 2) at the step, after its last kick [c]."""
        _, v, f = self.vectors[:3]
        if integrator.correction:
            v = self.vectors[3]
        # dividing first gives the rounding of the kernels
        inverse_mass = 1.0 / lattice.masses[:, None]
        return v + integrator.observed_kick * dt * inverse_mass * f


# numbers, lengths and values of the fields
Written = tuple[Array, NDArray[np.int32], Array]


@ti.data_oriented
class PointFields:
    """Fields of the points, and 0-D fields of the numbers that every kernel needs.

    Attributes:
        x, v, f, u: vectors of the points, see `Snapshot`.
        mass, inverse_mass: of each point [M], [1/M]; the masses of the disk add up to 1
            M.
        h: time step [R/c].
        closing: time for which the last kick of a step acts [R/c], h/2 in leapfrog.
        observed: time of the last kick that gives the observed velocities [R/c]; it
            differs from `closing` with a correction.
        contact: force of the wall on one point at which contact begins [M c^2/R].
        n, n_disk: number of all points and of the disk's points.
        corners, triangles: corners of each triangle, and the number of triangles.
        reset_steps: steps between two resets of the boundary.
    """

    def __init__(
        self,
        builder: Any,
        capacity: Capacity,
        subdomains: int,
        model: Model,
        corrected: bool,
    ) -> None:
        self.fillers = 2 * subdomains  # extra points for the filler springs of blocks
        filled = capacity.points + self.fillers
        self.x = pair_of(builder, filled)
        self.v = pair_of(builder, filled)
        self.f = pair_of(builder, filled)
        self.vectors = [self.x, self.v, self.f]
        self.corrected = corrected
        if model.springs.damped or corrected:
            self.u = pair_of(builder, filled)
            self.vectors.append(self.u)
        if corrected:
            self.X = pair_of(builder, filled)
            self.vectors.append(self.X)
        self.mass = array(builder, capacity.points, ti.f64)
        self.inverse_mass = array(builder, capacity.points, ti.f64)
        self.h = scalar(builder)
        self.closing = scalar(builder)
        self.observed = scalar(builder)
        self.contact = scalar(builder)
        # a triangulation of n points has fewer than 2 n triangles
        self.corners = side_by_side(builder, 2 * capacity.points, 3, ti.i32)
        self.n = scalar(builder, ti.i32)
        self.n_disk = scalar(builder, ti.i32)
        self.triangles = scalar(builder, ti.i32)
        self.blocks = scalar(builder, ti.i32)
        self.subdomain_points = scalar(builder, ti.i32)
        self.reset_steps = scalar(builder, ti.i32)
        self.subdomain_ends = array(builder, subdomains)
        self.sums = array(builder, SUMS, ti.f64)

    # ---- write and read the fields

    def contents(
        self, lattice: Lattice, arrangement: Arrangement, start: Sequence[Array]
    ) -> Contents:
        masses = lattice.masses
        n = len(masses)
        vectors = np.zeros((n + self.fillers, len(self.vectors), 2))
        for k, values in enumerate(start):
            vectors[:n, k] = values
        # filler springs are at rest between (0, 0) and (1, 0)
        vectors[n + 1 :: 2, 0, 0] = 1.0
        return [
            ((self.mass, self.inverse_mass), np.stack([masses, 1.0 / masses], axis=1)),
            (tuple(chain.from_iterable(self.vectors)), vectors),
            ((self.sums,), np.zeros(SUMS)),
            ((self.subdomain_ends,), arrangement.subdomain_ends),
            (self.corners, lattice.triangles),
        ]

    def begin(
        self, numbers: Sequence[tuple[Any, float]], contents: Contents
    ) -> Written:
        """Write `numbers` into 0-D fields and `contents` into other fields, which must
        be the same in all calls. Return the arguments of `write`, which writes them
        again."""
        # One kernel writes all of them, because loading a compiled kernel takes 30 ms.
        self.scalars = [field for field, _ in numbers]
        self.fields = [fields for fields, _ in contents]
        scalars = np.array([number for _, number in numbers], float)
        arrays = [np.asarray(values, np.float64) for _, values in contents]
        for fields, values in zip(self.fields, arrays, strict=True):
            room = fields[0].shape[0]
            if len(values) > room:  # kernels would write beyond the ends of the fields
                raise ValueError(f"{len(values)} values do not fit into {room}")
        rows = np.array([len(values) for values in arrays], np.int32)
        values = np.concatenate([values.ravel() for values in arrays])
        self.write(scalars, rows, values)
        return scalars, rows, values

    @ti.kernel
    def write(self, numbers: Reals1, rows: Integers1, values: Reals1):
        for k in ti.static(range(len(self.scalars))):
            self.scalars[k][None] = ti.cast(numbers[k], self.scalars[k].dtype)
        ti.loop_config(serialize=True)
        for _ in range(1):
            at = 0
            i = 0
            for k in ti.static(range(len(self.fields))):
                i = 0
                # a `while`, because LLVM would vectorise a `for`, and vectorising takes
                # longer than this loop
                while i < rows[k]:
                    for c in ti.static(range(len(self.fields[k]))):
                        self.fields[k][c][i] = ti.cast(
                            values[at + c], self.fields[k][c].dtype
                        )
                    at += ti.static(len(self.fields[k]))
                    i += 1

    def export(self, n: int, step: int) -> Snapshot:
        vectors = np.zeros((len(self.vectors), n, 2))
        sums = np.zeros(SUMS)
        self._copy(vectors, sums, False)
        return Snapshot(step, vectors, sums)

    def restore(self, snapshot: Snapshot) -> None:
        self._copy(snapshot.vectors, snapshot.sums, True)

    @ti.kernel
    def _copy(self, vectors: Reals3, sums: Reals1, into: ti.template()):
        ti.loop_config(serialize=True)
        for _ in range(1):
            i = 0
            while i < vectors.shape[1]:  # see `write`
                for k in ti.static(range(len(self.vectors))):
                    for c in ti.static(range(2)):
                        if ti.static(into):
                            self.vectors[k][c][i] = vectors[k, i, c]
                        else:
                            vectors[k, i, c] = self.vectors[k][c][i]
                i += 1
            for k in ti.static(range(SUMS)):
                if ti.static(into):
                    self.sums[k] = sums[k]
                else:
                    sums[k] = self.sums[k]


@ti.data_oriented
class Stepping:
    """Moves the points of `state` by the laws of `model`, on one core."""

    # All conditions on laws are decided at compile time, so kernels contain no trace of
    # absent laws.

    def __init__(
        self,
        state: PointFields,
        model: Model,
        integrator: Integrator,
        solver: DashpotSolver | None,
    ) -> None:
        self.state = state
        self.integrator = integrator
        self.solver = solver
        laws: Any = model  # no kernel uses a law that is absent
        self.springs = laws.springs
        self.wall = laws.wall
        self.mouse = laws.mouse
        self.boundary = laws.boundary
        self.contact = model.elastic is not None
        self.has_friction = model.has_friction
        self.rigid = model.wall is not None and not self.contact
        self.loads = model.loads
        # the velocities that become observed ones by the last kick
        self.observed_velocities = state.v
        if state.corrected:
            self.observed_velocities = state.u
        self.damped = model.springs.damped
        self.implicit = solver is not None
        self.explicit = self.damped and not self.implicit
        self.pinned = model.is_pinned
        self.matched = model.impedance is not None
        self.reset = model.reset_interval > 0.0

    # ---- forces

    @ti.func
    def drift(self, kick, move, shift, first, last):
        """Kick points first..last for the time `kick`, move them for `move` [R/c] and
        set the forces on single points.

        With a correction, x is X plus `shift` [R^2/c^2] times the acceleration. Returns
        the rigid wall's largest force on a point.
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
                    # V = v - h^2/12 da/dt, where da/dt is the difference of the
                    # accelerations of two steps
                    rest = self.state.closing[None] - self.state.observed[None]
                    put(self.state.u, i, v + rest * acceleration)
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
        """Set `f` of point i to the forces on single points, and return the rigid
        wall's upward force on it."""
        force = ti.Vector([0.0, 0.0])
        point_force = 0.0
        if ti.static(self.rigid):
            force = self.wall.at(self.state, i)
            point_force = force[1]
        for law in ti.static(self.loads):
            force = force + law.at(self.state, i)
        put(self.state.f, i, force)
        return point_force

    @ti.func
    def stage(self, kick, move, shift):
        sums = ti.static(self.state.sums)
        peak_point_force = self.drift(kick, move, shift, 0, self.state.n[None])
        sums[ELASTIC], sums[PRODUCTS] = self.springs.add(
            self.state, self.explicit, 0, self.state.blocks[None]
        )
        self.add_contact(move, peak_point_force)

    @ti.func
    def add_contact(self, move, peak_point_force):
        """Add elastic-wall forces and apply the pinned boundary.

        The points have just moved by `move` times the velocity; `peak_point_force` is
        the rigid wall's largest force on one point.
        """
        sums = ti.static(self.state.sums)
        if ti.static(self.contact):
            sums[UPWARD], sums[POTENTIAL], peak_point_force, sliding = self.wall.add(
                self.state, move
            )
            sums[SLIDING] += sliding
        if ti.static(self.pinned):
            self.boundary.hold(self.state)
        sums[PEAK_POINT_FORCE] = ti.max(sums[PEAK_POINT_FORCE], peak_point_force)

    # ---- a step

    @ti.func
    def step(self, number):
        """Make step `number`.

        Step 0 moves nothing: it computes the forces at t = 0 from x_0 and v_0 (in `v`
        and `u`) and subtracts the last kick of a preceding step.
        """
        h = self.elapsed(number, self.state.h[None])
        last = ti.static(self.integrator.forces - 1)
        # This is a loop, because four inlined stages compile slowly.
        for k in range(ti.select(number > 0, 0, last), last + 1):
            kick = 0.0
            move = 0.0
            shift = 0.0
            for s in ti.static(range(self.integrator.forces)):
                if k == s:
                    kick, move, shift = self.integrator.stages[s]
            self.stage(kick * h, move * h, shift * h * h)
        self.account(number)

    @ti.func
    def elapsed(self, number, time):
        return time * ti.cast(number > 0, ti.f64)

    @ti.func
    def age(self, number):
        """Return the number of steps since velocities jumped, at t = 0 or by a reset of
        the boundary."""
        age = number
        if ti.static(self.reset):
            if number > 0:
                age = (number - 1) % self.state.reset_steps[None] + 1
        return age

    @ti.func
    def account(self, number):
        """End step `number`: apply point dashpots, the boundary's reset and friction,
        and sum up the lost energy."""
        sums = ti.static(self.state.sums)
        h = self.elapsed(number, self.state.h[None])
        closing = self.elapsed(number, self.state.closing[None])
        next_kick = closing + self.state.closing[None]
        power = 0.0
        cross = 0.0
        late = 0.0
        boundary_power = 0.0
        if ti.static(self.explicit):
            power = self.springs.eta_now[None] * sums[PRODUCTS]
        if ti.static(self.implicit):
            power, cross, late = self.solver.solve_velocities(
                self.state, self.age(number)
            )
            if ti.static(self.matched):
                boundary_power = self.boundary.solved_power(self.state)
        elif ti.static(self.matched):
            boundary_power = self.boundary.damp(self.state, 0.5 * h)
        p0 = sums[POWER]
        b0 = sums[BOUNDARY_POWER]
        # Leapfrog conserves E + h^2 E_2 + O(h^4), so a dashpot g takes the integral of
        # g (v^2 + c h^2 a^2), with c = 2/3 for predicted, 1/6 for centred and -1/6 for
        # solved velocities. These sums give it to O(h^4).
        loss = h * (p0 + 2.0 * power) / 3.0
        boundary_loss = h * (b0 + 5.0 * boundary_power) / 6.0
        if ti.static(self.implicit):
            boundary_loss = 0.5 * h * (b0 + boundary_power)
            # For solved velocities, c = -1/6 is right only if h times the fastest rate
            # is small. In flight the first sum is exact for linear springs at any rate.
            # In contact it would drift as h^2, so the second one is taken there.
            loss = 0.25 * h * (sums[LEAVING] + power + late)
            if sums[PEAK_POINT_FORCE] >= self.state.contact[None]:
                loss = h * (2.0 / 3.0 * (p0 + power) - 1.0 / 3.0 * cross)
            loss -= boundary_loss
            sums[LEAVING] = ti.select(number > 0, 3.0 * power - late, power + late)
        if ti.static(self.reset and self.damped):
            # The force of dashpots jumps at a reset. Their loss over a step is summed
            # as -h/2 (f_k + f_{k+1}) v_{k+1/2}, with the forces of the dashpots as they
            # acted at both ends of the step.
            work = self.boundary.dashpot_work(self.state, self.springs, 0.0)
            loss = 0.5 * h * (p0 + work)
        sums[DISSIPATED] += loss + sums[INITIAL_LOSS]
        sums[INITIAL_LOSS] = 0.0
        sums[POWER] = power
        sums[ABSORBED] += boundary_loss
        sums[BOUNDARY_POWER] = boundary_power
        if ti.static(self.reset):
            self.reset_boundary(number, next_kick)
        elif ti.static(self.implicit):
            self.take_damped_force(number)
        if ti.static(self.has_friction):
            friction_power = self.wall.add_friction(self.state, next_kick, closing)
            sums[FRICTION] += 0.5 * h * (sums[FRICTION_POWER] + friction_power)
            sums[FRICTION_POWER] = friction_power
        if number == 0:
            self.take_back_kick()

    @ti.func
    def take_back_kick(self):
        """Subtract the kick that would have ended at t = 0 from the velocities."""
        for i in range(self.state.n[None]):
            kick = self.state.closing[None] * self.state.inverse_mass[i]
            put(self.state.v, i, get(self.state.v, i) - kick * get(self.state.f, i))

    @ti.func
    def take_damped_force(self, number):
        sums = ti.static(self.state.sums)
        stored = self.solver.take_damped_force(self.state)
        # Only the sum for flight contains this loss.
        if number == 0 and sums[PEAK_POINT_FORCE] < self.state.contact[None]:
            sums[INITIAL_LOSS] = stored

    @ti.func
    def reset_boundary(self, number, next_kick):
        """Stop the boundary if a reset is due. Then store the power with which the sum
        over the next step begins."""
        sums = ti.static(self.state.sums)
        if number > 0 and number % self.state.reset_steps[None] == 0:
            sums[ABSORBED] += self.boundary.stop(
                self.state, self.springs, self.solver, self.implicit
            )
        elif ti.static(self.implicit):
            self.take_damped_force(number)
        if ti.static(self.damped):
            sums[POWER] = self.boundary.dashpot_work(
                self.state, self.springs, next_kick
            )
