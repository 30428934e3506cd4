"""Kernels that make many steps, on one core or several, and measure the observables.

All steps between two rows run inside one kernel, because launching a kernel costs as
much as a step. For a large lattice a step consists of two loops. The first moves all
subdomains (see `physics.ordering`) with the springs inside them, in parallel. The
second does the rest on one core: springs across the seams, sums over the subdomains in
order, contact, boundary, implicit dashpots. So the results are bitwise the same as on
one core.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.physics.law import Integers1, Reals2, get, side_by_side
from taichi_disk.mechanics.simulation.observables import INDEX, within
from taichi_disk.mechanics.simulation.stepping import (
    ABSORBED,
    DISSIPATED,
    ELASTIC,
    FRICTION,
    POTENTIAL,
    PRODUCTS,
    SLIDING,
    UPWARD,
    Stepping,
)

Counts = NDArray[np.int32]

# iterations that Taichi 1.7.4 gives to a core at once (it ignores block_dim): one
# subdomain
GRAIN = 512
# force evaluations per launch for a large lattice; more take long to compile
FORCES_PER_LAUNCH = 2


@ti.data_oriented
class Kernels(Stepping):
    """Moves the points on one core."""

    @ti.kernel
    def advance(
        self,
        first: ti.i32,
        steps: ti.i32,
        stride: ti.i32,
        rows: Reals2,
        bounds: Reals2,
        counts: Integers1,
    ):
        """Make `steps` steps after step `first` (-1 for the start), or fewer if the
        scene's end is reached.

        `rows` is filled at every multiple of `stride` and after the last step. `bounds`
        (2, columns): smallest and largest value of every column at the end. `counts`:
        number of successive rows that must be within the bounds, number of such rows so
        far, number of steps made, number of rows at multiples of `stride`.
        """
        ti.loop_config(serialize=True)
        for _ in range(1):
            made = 0
            row = 0
            needed = counts[0]
            settled = counts[1]
            while made < steps and settled < needed:
                made += 1
                self.step(first + made)
                due = (first + made) % stride == 0
                if due or made == steps:
                    self.observe(rows, row)
                if due:
                    inside = 1
                    for k in ti.static(range(len(INDEX))):
                        if rows[row, k] < bounds[0, k] or rows[row, k] > bounds[1, k]:
                            inside = 0
                    settled = (settled + 1) * inside
                    row += 1
            counts[1] = settled
            counts[2] = made
            counts[3] = row

    @ti.kernel
    def set_mouse_target(self, point: ti.i32, x: ti.f64, y: ti.f64) -> ti.f64:
        """Let the mouse pull `point` (-1: none) towards (x, y), and return the added
        energy [M c^2]."""
        energy = self.mouse.untie(self.state)
        self.mouse.point[0] = point
        self.mouse.target[0][0] = x
        self.mouse.target[1][0] = y
        energy += self.mouse.tie(self.state)
        return energy

    @ti.func
    def observe(self, rows: ti.template(), s):
        sums = ti.static(self.state.sums)
        mass = 0.0
        moment = ti.Vector([0.0, 0.0])
        momentum = ti.Vector([0.0, 0.0])
        spin = 0.0
        kinetic2 = 0.0
        residual2 = 0.0
        force = sums[UPWARD]
        energy = sums[POTENTIAL]
        load = 0.0
        lowest = self.state.x[1][0]
        for i in range(self.state.n[None]):
            x = get(self.state.x, i)
            m = self.state.mass[i]
            f = get(self.state.f, i)
            v = (
                get(self.observed_velocities, i)
                + self.state.observed[None] * self.state.inverse_mass[i] * f
            )
            if i < self.state.n_disk[None]:
                mass += m
                moment += m * x
                momentum += m * v
                spin += m * x.cross(v)
                lowest = ti.min(lowest, x[1])
                residual2 = ti.max(residual2, f.dot(f))
                if ti.static(self.rigid):
                    point_force = self.wall.at(self.state, i)
                    # without a force there is no potential
                    if point_force[0] != 0.0 or point_force[1] != 0.0:
                        energy += self.wall.potential_at(self.state, i)
                        force += point_force[1]
                for law in ti.static(self.loads):
                    load += law.potential_at(self.state, i)
            kinetic2 += m * v.dot(v)
        orbital = moment.cross(momentum) / mass
        rows[s, INDEX["com_x"]] = moment[0] / mass
        rows[s, INDEX["com_y"]] = moment[1] / mass
        rows[s, INDEX["com_vx"]] = momentum[0] / mass
        rows[s, INDEX["com_vy"]] = momentum[1] / mass
        rows[s, INDEX["angular_momentum"]] = spin - orbital
        rows[s, INDEX["lowest_y"]] = lowest
        rows[s, INDEX["wall_force"]] = force
        rows[s, INDEX["kinetic"]] = 0.5 * kinetic2
        rows[s, INDEX["elastic"]] = sums[ELASTIC]
        rows[s, INDEX["wall"]] = energy
        rows[s, INDEX["dissipated"]] = sums[DISSIPATED]
        rows[s, INDEX["absorbed"]] = sums[ABSORBED]
        rows[s, INDEX["load"]] = load
        rows[s, INDEX["sliding"]] = sums[SLIDING]
        rows[s, INDEX["residual"]] = ti.sqrt(residual2)
        if ti.static(self.contact):
            rows[s, INDEX["depth"]] = self.wall.depth(self.state)
        rows[s, INDEX["inverted"]] = self.inverted()
        rows[s, INDEX["friction"]] = sums[FRICTION]

    @ti.func
    def inverted(self):
        """Return the number of triangles that are turned inside out."""
        x = ti.static(self.state.x)
        i, j, k = ti.static(self.state.corners)
        count = 0
        for t in range(self.state.triangles[None]):
            corner = get(x, i[t])
            count += (get(x, j[t]) - corner).cross(get(x, k[t]) - corner) < 0.0
        return count


@ti.data_oriented
class SubdomainKernels(Kernels):
    """Moves the points of a large lattice on several cores."""

    def __init__(self, builder: Any, count: int, *parts: Any) -> None:
        """`count`: number of subdomains; `parts`: the arguments of `Kernels`."""
        super().__init__(*parts)
        self.count = count
        self.steps_per_launch = max(1, FORCES_PER_LAUNCH // self.integrator.forces)
        # of each subdomain
        self.peak, self.elastic, self.products = side_by_side(builder, count, 3)

    def advance(
        self,
        first: int,
        steps: int,
        stride: int,
        rows: Array,
        bounds: Array,
        counts: Counts,
    ) -> None:
        needed, settled, made, count = counts.tolist()
        while made < steps and settled < needed:
            few = min(
                steps - made, stride - (first + made) % stride, self.steps_per_launch
            )
            self.advance_few(first + made, few)
            made += few
            due = (first + made) % stride == 0
            if due or made == steps:
                self.fill_row(rows, count)
            if due:
                settled = (settled + 1) * bool(within(rows[[count]], bounds))
                count += 1
        counts[1:] = settled, made, count

    @ti.func
    def move_subdomain(self, stage: ti.template(), number, c):
        begin = 0
        if c > 0:
            begin = self.state.subdomain_ends[c - 1]
        first = c * self.state.subdomain_points[None]
        last = ti.min(first + self.state.subdomain_points[None], self.state.n[None])
        kick, move, shift = ti.static(*self.integrator.stages[stage])
        h = self.elapsed(number, self.state.h[None])
        self.peak[c] = self.drift(kick * h, move * h, shift * h * h, first, last)
        self.elastic[c], self.products[c] = self.springs.add(
            self.state, self.explicit, begin, self.state.subdomain_ends[c]
        )

    @ti.func
    def join(self, stage: ti.template(), number):
        """Add the springs across the seams, the sums and the contact; after the last
        stage, end the step."""
        sums = ti.static(self.state.sums)
        seams = self.state.subdomain_ends[self.count - 1]
        sums[ELASTIC], sums[PRODUCTS] = self.springs.add(
            self.state, self.explicit, seams, self.state.blocks[None]
        )
        peak_point_force = 0.0
        for c in range(self.count):
            peak_point_force = ti.max(peak_point_force, self.peak[c])
            sums[ELASTIC] += self.elastic[c]
            sums[PRODUCTS] += self.products[c]
        move = ti.static(self.integrator.stages[stage][1]) * self.elapsed(
            number, self.state.h[None]
        )
        self.add_contact(move, peak_point_force)
        if ti.static(stage == self.integrator.forces - 1):
            self.account(number)

    @ti.kernel
    def advance_few(self, number: ti.i32, steps: ti.i32):
        for k in ti.static(range(self.steps_per_launch)):
            for stage in ti.static(range(self.integrator.forces)):
                for q in range(
                    GRAIN * self.count * self.is_due(stage, number + k + 1, k < steps)
                ):
                    if q % GRAIN == 0:
                        self.move_subdomain(stage, number + k + 1, q // GRAIN)
                ti.loop_config(serialize=True)
                for _ in range(self.is_due(stage, number + k + 1, k < steps)):
                    self.join(stage, number + k + 1)

    @ti.func
    def is_due(self, stage: ti.template(), number, requested):
        return ti.cast(
            requested and (number > 0 or stage == self.integrator.forces - 1), ti.i32
        )

    @ti.kernel
    def fill_row(self, rows: Reals2, s: ti.i32):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.observe(rows, s)
