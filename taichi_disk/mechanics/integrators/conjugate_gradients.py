"""Solve for the trapezoidal dashpots of a large lattice by conjugate gradients instead
of a factor.

In a larger lattice, a Cholesky factor has more entries per point. The matrix (see
`trapezoidal`) has a small condition
number: 3 at 5,000 points of the same body, 10 at 100,000. With the diagonal as
preconditioner and the velocity extrapolated from the last five steps as first guess,
three or four iterations suffice.
"""

from dataclasses import dataclass
from math import comb
from typing import Any

import numpy as np

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.integrators.trapezoidal import (
    DashpotSolver,
    boundary_dashpots,
)
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import Model
from taichi_disk.mechanics.physics.law import (
    Capacity,
    Contents,
    array,
    get,
    pair_of,
    put,
    side_by_side,
)
from taichi_disk.mechanics.physics.ordering import BLOCK
from taichi_disk.mechanics.physics.springs import Springs

# residual over right-hand side, both preconditioned; keeps the error of e below 1e-8
TOLERANCE = 3e-11
# Steps of an extrapolation: 3.9 products with the matrix per step at 20,000 points (5.0
# from four steps, 4.3 from six).
STEPS = 5
MAX_ITERATIONS = 200  # far more than any step needs


@dataclass(frozen=True)
class Diagonal:
    """The diagonal of the matrix of implicit dashpots. Both arrays (n, c) are 0 for
    pinned points; c = 2 if x and y have different matrices, else 1."""

    inertia: Array  # part without the springs [M]
    inverse: Array  # inverse of the full diagonal [1/M]


def diagonal(lattice: Lattice, model: Model, dt: float) -> Diagonal:
    half = 0.5 * dt
    inertia = lattice.masses[:, None] + boundary_dashpots(lattice, model, half)
    springs = lattice.stiffened(half * model.springs.eta * np.ones(len(lattice.bonds)))
    degree = sum(np.bincount(ends, springs, len(inertia)) for ends in lattice.bonds.T)
    inverse = 1.0 / (inertia + np.asarray(degree)[:, None])
    if model.is_pinned:
        inverse[lattice.wall_boundary] = 0.0
    return Diagonal(inertia, inverse)


def weight(known: int, k: int) -> float:
    """Return the weight of the k-th last of `known` equidistant values when the next
    one is extrapolated from them."""
    return -((-1.0) ** k) * comb(known, k)


@ti.data_oriented
class IterativeSolver(DashpotSolver):
    """Solves for the velocities at a step without a factor. `previous`: earlier
    velocities, newest first."""

    def __init__(
        self,
        builder: Any,
        capacity: Capacity,
        components: int,
        fillers: int,
        springs: Springs,
    ) -> None:
        self.components = components
        self.springs = springs
        self.fillers = fillers
        self.z, self.residual, self.direction, self.product = (
            pair_of(builder, capacity.points + fillers) for _ in range(4)
        )
        self.order = array(builder, capacity.points)
        self.free = array(builder, 1)
        self.inertia, self.inverse = (
            side_by_side(builder, capacity.points, components) for _ in range(2)
        )
        self.previous = [
            pair_of(builder, capacity.points + fillers) for _ in range(STEPS - 1)
        ]

    def contents(self, factor: Any) -> Contents:
        n = len(factor.inertia)
        return [
            ((self.order,), np.arange(n)),
            ((self.free,), [n]),
            (self.inertia, factor.inertia),
            (self.inverse, factor.inverse),
            (self.direction, np.zeros((n + self.fillers, 2))),
        ]

    @ti.func
    def solve(self, state: ti.template(), age):
        n = self.free[0]
        half = state.closing[None]
        goal = 0.0
        for i in range(n):
            right = state.mass[i] * get(state.v, i) + half * get(state.f, i)
            guess = self.scaled(self.inverse, i, right)
            goal += TOLERANCE * TOLERANCE * right.dot(guess)
            if age > 0:
                guess = self.extrapolated(state, i, age)
            for k in ti.static(range(STEPS - 2, 0, -1)):
                put(self.previous[k], i, get(self.previous[k - 1], i))
            put(self.previous[0], i, get(state.u, i))
            put(self.z, i, ti.Vector([0.0, 0.0]))
            put(self.residual, i, right)
            self.search(i, guess)
        left = 2.0 * goal + 1.0
        count = 0
        while left > goal and count < MAX_ITERATIONS:
            resisted = self.multiply(state, half, n)
            part = left / resisted
            if count == 0:  # u still contains the whole step to the first guess
                part = 1.0
            before = left
            left = 0.0
            for i in range(n):
                put(self.z, i, get(self.z, i) + part * get(self.direction, i))
                r = get(self.residual, i) - part * get(self.product, i)
                put(self.residual, i, r)
                left += r.dot(self.scaled(self.inverse, i, r))
            beta = left / before
            if count == 0:
                beta = 0.0
            if left > goal:
                for i in range(n):
                    next_part = self.scaled(self.inverse, i, get(self.residual, i))
                    self.search(i, next_part + beta * get(self.direction, i))
            count += 1

    @ti.func
    def extrapolated(self, state: ti.template(), i, age):
        """Extrapolate the velocity of point i from the last STEPS steps, or from all if
        there are fewer."""
        guess = get(state.u, i)
        for known in ti.static(range(2, STEPS + 1)):
            if ti.min(age, STEPS) == known:
                guess *= ti.static(weight(known, 1))
                for k in ti.static(range(1, known)):
                    before = get(self.previous[k - 1], i)
                    guess += ti.static(weight(known, k + 1)) * before
        return guess

    @ti.func
    def search(self, i, direction):
        put(self.direction, i, direction)
        put(self.product, i, self.scaled(self.inertia, i, direction))

    @ti.func
    def multiply(self, state: ti.template(), half, n):
        """Add the springs to the product of matrix and direction, and return direction
        times product."""
        eta = half * self.springs.eta_now[None]
        for block in range(state.blocks[None]):
            dx, dy = self.springs.differences(self.direction, block)
            fx = self.springs.stiffened(eta * dx, block)
            fy = self.springs.stiffened(eta * dy, block)
            for k in ti.static(range(BLOCK)):
                self.springs.pull_together(
                    self.product, k, block, ti.Vector([-fx[k], -fy[k]])
                )
        total = 0.0
        for i in range(n):
            total += get(self.direction, i).dot(get(self.product, i))
        return total
