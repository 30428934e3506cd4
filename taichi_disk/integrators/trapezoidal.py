"""Velocity Verlet with the dashpots trapezoidal: order 2, stable up to the undamped limit however strong they are.

With F the force of springs and wall at this step, the velocity u at this step, centred between v_ and v_+ = 2 u - v_,
obeys

    (1 + h/2 (eta/m) L) u = v_ + h/2 F/m,      L = graph Laplacian of the springs.

The matrix is constant, sparse, symmetric and positive definite, and the same for x and y (but for the dashpots of a
matched boundary), if both sides are multiplied by the masses m_i: one sparse Cholesky factor L D L^T in an order that
keeps it sparse serves all steps.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.engine import ti
from taichi_disk.lattice import Array, Lattice
from taichi_disk.lattice.network import laplacian, symmetric_factors
from taichi_disk.physics import Model
from taichi_disk.physics.law import (
    Capacity,
    Integers1,
    Reals2,
    array,
    get,
    pair_of,
    put,
    side_by_side,
)


@dataclass(frozen=True)
class Factor:
    """L D L^T of the dashpots' matrix by columns; `order[k]` is the point eliminated k-th.

    `values` (entries, c) and `inverse_diagonal` (k, c): c = 2 where x and y have matrices of their own.
    """

    order: NDArray[np.int32]
    column: NDArray[np.int32]
    row: NDArray[np.int32]
    values: Array
    inverse_diagonal: Array


def factorise(lattice: Lattice, model: Model, dt: float) -> Factor:
    """Factorise m_i + h/2 (eta L + Z) over the points that move, Z the dashpots of a matched boundary."""
    import scipy.sparse as sp

    n = len(lattice.positions)
    free: NDArray[np.intp] = np.arange(n)
    extra: Array = np.zeros((n, 1))
    half = 0.5 * dt
    if model.is_pinned:
        free = np.setdiff1d(free, lattice.wall_boundary)
    if model.impedance is not None:
        extra = np.zeros((n, 2))
        extra[lattice.wall_boundary] = half * model.impedance
    matrix = (half * model.springs.eta * laplacian(lattice) + sp.diags(lattice.masses)).tocsc()[free][:, free]
    factors = [symmetric_factors(matrix + sp.diags(one[free])) for one in extra.T]
    lowers = [sp.tril(one.L, -1, format="csc") for one in factors]
    for lower in lowers:
        lower.sort_indices()
    return Factor(
        order=free[np.argsort(factors[0].perm_c)].astype(np.int32),
        column=lowers[0].indptr.astype(np.int32),
        row=lowers[0].indices.astype(np.int32),
        values=np.stack([lower.data for lower in lowers], axis=1),
        inverse_diagonal=np.stack([1.0 / one.U.diagonal() for one in factors], axis=1),
    )


@ti.data_oriented
class DashpotSolver:
    """Solves for the velocities at a step; `components`: 2 where x and y have factors of their own, else 1."""

    def __init__(self, builder: Any, capacity: Capacity, components: int) -> None:
        self.components = components
        self.z = pair_of(builder, capacity.points)
        self.order, self.column = array(builder, capacity.points), array(builder, capacity.points + 1)
        self.row, self.free = array(builder, capacity.entries), array(builder, 1)
        self.values = side_by_side(builder, capacity.entries, components)
        self.inverse_diagonal = side_by_side(builder, capacity.points, components)

    def fill(self, factor: Any) -> None:
        self._fill(factor.order, factor.column, factor.row, factor.values, factor.inverse_diagonal)

    @ti.kernel
    def _fill(self, order: Integers1, column: Integers1, row: Integers1, values: Reals2, inverse_diagonal: Reals2):
        ti.loop_config(serialize=True)
        for k in range(order.shape[0]):
            self.order[k] = order[k]
            self.column[k] = column[k]
            for c in ti.static(range(self.components)):
                self.inverse_diagonal[c][k] = inverse_diagonal[k, c]
        self.free[0] = order.shape[0]
        self.column[order.shape[0]] = column[order.shape[0]]
        for e in range(row.shape[0]):
            self.row[e] = row[e]
            for c in ti.static(range(self.components)):
                self.values[c][e] = values[e, c]

    @ti.func
    def solve(self, state: ti.template(), age):
        """Solve for v + h/2 f/m on the right-hand side; the result is left in `z`, in the order of elimination.

        `age`: how many steps ago the velocities jumped last, for solvers that begin with those before.
        """
        y = ti.static(self.components - 1)
        free, half = self.free[0], state.closing[None]
        for k in range(free):
            i = self.order[k]
            put(self.z, k, state.mass[i] * get(state.v, i) + half * get(state.f, i))
        for k in range(free):
            zk = get(self.z, k)
            for e in range(self.column[k], self.column[k + 1]):
                i = self.row[e]
                self.z[0][i] -= self.values[0][e] * zk[0]
                self.z[1][i] -= self.values[y][e] * zk[1]
        for back in range(free):
            k = free - 1 - back
            zk = get(self.z, k)
            zk[0] *= self.inverse_diagonal[0][k]
            zk[1] *= self.inverse_diagonal[y][k]
            for e in range(self.column[k], self.column[k + 1]):
                other = get(self.z, self.row[e])
                zk[0] -= self.values[0][e] * other[0]
                zk[1] -= self.values[y][e] * other[1]
            put(self.z, k, zk)

    @ti.func
    def solve_velocities(self, state: ti.template(), age):
        """The velocities u at this step into `state.u`; returns u.D u, u.D u_before, u.D v; D is all dashpots."""
        self.solve(state, age)
        half = state.closing[None]
        power, cross, late = 0.0, 0.0, 0.0
        for k in range(self.free[0]):
            i, u = self.order[k], get(self.z, k)
            before = get(state.u, i)
            v = get(state.v, i)
            loss = get(state.f, i) - state.mass[i] * (u - v) / half
            power += u[0] * loss[0] + u[1] * loss[1]
            cross += before[0] * loss[0] + before[1] * loss[1]
            late += v[0] * loss[0] + v[1] * loss[1]
            put(state.u, i, u)
        return power, cross, late

    @ti.func
    def take_damped_force(self, state: ti.template()):
        """Put the force that the solved velocities imply into `f`: v + h/2 f/m = u, v + h f/m = 2 u - v.

        At t = 0, where v is v_0, that is the implicit half step of which stiff dashpots overshoot nothing. The energy
        balance then begins with what is returned: h^2/(8 m) F.(F - D u), F the force without dashpots.
        """
        half, stored = state.closing[None], 0.0
        for k in range(self.free[0]):
            i = self.order[k]
            force, damped = get(state.f, i), state.mass[i] * (get(state.u, i) - get(state.v, i)) / half
            stored += 0.5 * half * half * state.inverse_mass[i] * (force[0] * damped[0] + force[1] * damped[1])
            put(state.f, i, damped)
        return stored

    @ti.func
    def restart(self, state: ti.template()):
        """From `u`, the velocities after a loss, and `f` without dashpots: solve for the half step to come."""
        for k in range(self.free[0]):
            put(state.v, self.order[k], get(state.u, self.order[k]))
        self.solve(state, 0)
        half = state.closing[None]
        for k in range(self.free[0]):
            i, z = self.order[k], get(self.z, k)
            u = get(state.u, i)
            put(state.v, i, 2.0 * u - z)
            put(state.f, i, state.mass[i] * (z - u) / half)
            put(state.u, i, z)  # the velocity at which the dashpots act in that half step
