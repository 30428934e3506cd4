"""Large lattices: a step by several cores, subdomain by subdomain (see `physics.ordering`), with the bits of one core.

A step is two loops: move all subdomains with the springs inside them, in parallel; then what concerns the whole
lattice, on one core: the springs across the seams, the sums (subdomain by subdomain, in their order), contact,
boundary, implicit dashpots.
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.integrators import Integrator
from taichi_disk.integrators.trapezoidal import DashpotSolver, Factor
from taichi_disk.lattice import Array
from taichi_disk.physics import Model
from taichi_disk.physics.ordering import Arrangement
from taichi_disk.physics.points import Integers1, Reals2
from taichi_disk.simulation.observables import SUMS
from taichi_disk.simulation.state import State
from taichi_disk.simulation.stepping import Stepping

Counts = NDArray[np.int32]

GRAIN = 512  # iterations that Taichi 1.7.4 gives to a core at once, whatever block_dim says: a subdomain each
STAGES = 2  # forces computed in one launch; more take long to compile


@ti.data_oriented
class SubdomainStepping(Stepping):
    """Moves the points of a large lattice on several cores."""

    def __init__(
        self, state: State, model: Model, integrator: Integrator, solver: DashpotSolver | None, builder: Any, count: int
    ) -> None:
        super().__init__(state, model, integrator, solver)
        self.count = count
        self.steps_per_launch = max(1, STAGES // integrator.forces)
        self.ends = ti.field(ti.i32)
        self.parts = [ti.field(ti.f64) for _ in range(3)]  # largest force, elastic energy, products
        self.latest = ti.field(ti.f64)  # elastic energy, contact force, contact potential
        builder.dense(ti.i, count).place(self.ends)
        builder.dense(ti.i, count).place(*self.parts)
        builder.dense(ti.i, 3).place(self.latest)

    def fill(self, arrangement: Arrangement, factor: Factor | None) -> None:
        super().fill(arrangement, factor)
        self.fill_ends(arrangement.subdomain_ends)

    @ti.kernel
    def fill_ends(self, ends: Integers1):
        for c in range(self.count):
            self.ends[c] = ends[c]

    def advance(self, first: int, steps: int, stride: int, rows: Array, bounds: Array, counts: Counts) -> None:
        """As that of one core, in many short launches."""
        needed, held, made, count = (int(number) for number in counts)
        if steps == 0:
            self.advance_few(first, 0)  # compiles the kernel
        while made < steps and held < needed:
            few = min(steps - made, stride - (first + made) % stride, self.steps_per_launch)
            self.advance_few(first + made, few)
            made += few
            due = (first + made) % stride == 0
            if due or made == steps:
                self.look(rows, count)
            if due:
                inside = bool(((rows[count] >= bounds[0]) & (rows[count] <= bounds[1])).all())
                held = (held + 1) * inside
                count += 1
        counts[1:] = held, made, count

    @ti.func
    def move_subdomain(self, stage: ti.template(), c):
        """Drift and inner springs of subdomain c."""
        begin = 0
        if c > 0:
            begin = self.ends[c - 1]
        first = c * self.state.subdomain_points[None]
        last = ti.min(first + self.state.subdomain_points[None], self.state.n[None])
        kick, move = ti.static(self.integrator.joined_kicks[stage], self.integrator.moves[stage])
        highest = self.drift(kick * self.state.g[None], move * self.state.h[None], first, last)
        elastic, products = self.springs.add(self.state, self.explicit, begin, self.ends[c])
        self.parts[0][c], self.parts[1][c], self.parts[2][c] = highest, elastic, products

    @ti.func
    def join(self, stage: ti.template(), number):
        """What concerns the whole lattice: seams, sums, contact; after the last stage the step's end."""
        sums = ti.Vector([self.state.sums[k] for k in range(SUMS)])
        seams = self.ends[self.count - 1]
        elastic, products = self.springs.add(self.state, self.explicit, seams, self.state.blocks[None])
        highest = 0.0
        for c in range(self.count):
            highest = ti.max(highest, self.parts[0][c])
            elastic += self.parts[1][c]
            products += self.parts[2][c]
        move = ti.static(self.integrator.moves[stage]) * self.state.h[None]
        sums, upward, potential = self.touch(move, sums, highest)
        if ti.static(stage == self.integrator.forces - 1):
            sums = self.account(number, sums, products)
        for k in ti.static(range(SUMS)):
            self.state.sums[k] = sums[k]
        self.latest[0], self.latest[1], self.latest[2] = elastic, upward, potential

    @ti.kernel
    def advance_few(self, number: ti.i32, steps: ti.i32):
        """Make `steps` steps after step `number`, at most `steps_per_launch`."""
        for k in ti.static(range(self.steps_per_launch)):
            for stage in ti.static(range(self.integrator.forces)):
                for q in range(GRAIN * self.count * ti.cast(k < steps, ti.i32)):
                    if q % GRAIN == 0:
                        self.move_subdomain(stage, q // GRAIN)
                ti.loop_config(serialize=True)
                for _ in range(ti.cast(k < steps, ti.i32)):
                    self.join(stage, number + k + 1)

    @ti.kernel
    def look(self, rows: Reals2, s: ti.i32):
        """Fill row `s` with the observables now."""
        ti.loop_config(serialize=True)
        for _ in range(1):
            sums = ti.Vector([self.state.sums[k] for k in range(SUMS)])
            self.observe(rows, s, sums, self.latest[0], self.latest[1], self.latest[2])
