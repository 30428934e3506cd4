"""Velocity Verlet with trapezoidal dashpots: order 2, stable up to the undamped limit
for any damping.

With F the force of springs and wall at this step, the velocity u at this step, centred
between v_ and v_+ = 2 u - v_, obeys

    (1 + h/2 (eta/m) L) u = v_ + h/2 F/m,      L = graph Laplacian of the springs.

If both sides are multiplied by the masses m_i, the matrix is constant, sparse,
symmetric and positive definite. It is the same for x and y, unless there are dashpots
of a matched boundary. One sparse Cholesky factor L D L^T, in an order that keeps it
sparse, serves all steps.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.network import laplacian, symmetric_factors
from taichi_disk.mechanics.lattice.triangles import Indices
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


@dataclass(frozen=True)
class Factor:
    """The factor L D L^T of the dashpots' matrix by columns; `order[k]` is the point
    eliminated k-th.

    `values` (entries, c) and `inverse_diagonal` (k, c): c = 2 if x and y have different
    matrices, else 1.
    """

    order: Indices
    column: Indices
    row: Indices
    values: Array
    inverse_diagonal: Array


def boundary_dashpots(lattice: Lattice, model: Model, half: float) -> Array:
    """Return the dashpots of a matched boundary (n, 2) times `half` a step [M]; zeros
    (n, 1) for other boundaries."""
    if model.impedance is None:
        return np.zeros((len(lattice.positions), 1))
    dashpots = np.zeros_like(lattice.positions)
    dashpots[lattice.wall_boundary] = half * model.impedance
    return dashpots


def factorise(lattice: Lattice, model: Model, dt: float) -> Factor:
    """Factorise m_i + h/2 (eta L + Z) over the moving points; Z are the dashpots of a
    matched boundary."""
    import scipy.sparse as sp

    free = np.arange(len(lattice.positions))
    half = 0.5 * dt
    if model.is_pinned:
        free = np.setdiff1d(free, lattice.wall_boundary)
    dampers = half * model.springs.eta * laplacian(lattice)
    matrix = (dampers + sp.diags(lattice.masses)).tocsc()[free][:, free]
    values = []
    inverse_diagonals = []
    for dashpots in boundary_dashpots(lattice, model, half)[free].T:
        factor = symmetric_factors(matrix + sp.diags(dashpots))
        lower = sp.tril(factor.L, -1, format="csc")
        lower.sort_indices()
        values.append(lower.data)
        inverse_diagonals.append(1.0 / factor.U.diagonal())
    # both components have the same order and the same entries
    return Factor(
        order=free[np.argsort(factor.perm_c)].astype(np.int32),
        column=lower.indptr.astype(np.int32),
        row=lower.indices.astype(np.int32),
        values=np.stack(values, axis=1),
        inverse_diagonal=np.stack(inverse_diagonals, axis=1),
    )


@ti.data_oriented
class DashpotSolver:
    """Solves for the velocities at a step. `components`: 2 if x and y have different
    matrices, else 1."""

    def __init__(self, builder: Any, capacity: Capacity, components: int) -> None:
        self.components = components
        self.z = pair_of(builder, capacity.points)
        self.order = array(builder, capacity.points)
        self.column = array(builder, capacity.points + 1)
        self.row = array(builder, capacity.entries)
        self.free = array(builder, 1)
        self.values = side_by_side(builder, capacity.entries, components)
        self.inverse_diagonal = side_by_side(builder, capacity.points, components)

    def contents(self, factor: Any) -> Contents:
        return [
            ((self.order,), factor.order),
            ((self.column,), factor.column),
            ((self.row,), factor.row),
            ((self.free,), [len(factor.order)]),
            (self.values, factor.values),
            (self.inverse_diagonal, factor.inverse_diagonal),
        ]

    @ti.func
    def solve(self, state: ti.template(), age):
        """Solve for v + h/2 f/m on the right-hand side; the result is in `z`, in the
        order of elimination.

        `age`: number of steps since velocities jumped. Iterative solvers begin with the
            velocities of those steps.
        """
        free = self.free[0]
        half = state.closing[None]
        for k in range(free):
            i = self.order[k]
            put(self.z, k, state.mass[i] * get(state.v, i) + half * get(state.f, i))
        for k in range(free):
            zk = get(self.z, k)
            for e in range(self.column[k], self.column[k + 1]):
                i = self.row[e]
                put(self.z, i, get(self.z, i) - self.scaled(self.values, e, zk))
        for back in range(free):
            k = free - 1 - back
            zk = self.scaled(self.inverse_diagonal, k, get(self.z, k))
            for e in range(self.column[k], self.column[k + 1]):
                zk = zk - self.scaled(self.values, e, get(self.z, self.row[e]))
            put(self.z, k, zk)

    @ti.func
    def scaled(self, matrix: ti.template(), i, vector):
        """Return `vector` times the i-th entry of a `matrix`, which x and y have in
        common or which has a column for each."""
        y = ti.static(self.components - 1)
        return ti.Vector([matrix[0][i] * vector[0], matrix[y][i] * vector[1]])

    @ti.func
    def solve_velocities(self, state: ti.template(), age):
        """Solve for the velocities u at this step. Returns u.D u, u.D u_before and u.D
        v with all dashpots D."""
        self.solve(state, age)
        half = state.closing[None]
        power = 0.0
        cross = 0.0
        late = 0.0
        for k in range(self.free[0]):
            i = self.order[k]
            u = get(self.z, k)
            before = get(state.u, i)
            v = get(state.v, i)
            loss = get(state.f, i) - state.mass[i] * (u - v) / half
            power += u.dot(loss)
            cross += before.dot(loss)
            late += v.dot(loss)
            put(state.u, i, u)
        return power, cross, late

    @ti.func
    def take_damped_force(self, state: ti.template()):
        """Set `f` to the force that the solved velocities imply: v + h/2 f/m = u, v + h
        f/m = 2 u - v."""
        # At t = 0, where v is v_0, this is an implicit half step, which is stable for
        # stiff dashpots. The energy balance then begins with the returned h^2/(8 m)
        # F.(F - D u), where F is the force without dashpots.
        half = state.closing[None]
        stored = 0.0
        for k in range(self.free[0]):
            i = self.order[k]
            damped = state.mass[i] * (get(state.u, i) - get(state.v, i)) / half
            product = get(state.f, i).dot(damped)
            stored += 0.5 * half * half * state.inverse_mass[i] * product
            put(state.f, i, damped)
        return stored

    @ti.func
    def restart(self, state: ti.template()):
        """Solve for the next half step from velocities `u` after a reset and forces `f`
        without dashpots."""
        for k in range(self.free[0]):
            put(state.v, self.order[k], get(state.u, self.order[k]))
        self.solve(state, 0)
        half = state.closing[None]
        for k in range(self.free[0]):
            i = self.order[k]
            z = get(self.z, k)
            u = get(state.u, i)
            put(state.v, i, 2.0 * u - z)
            put(state.f, i, state.mass[i] * (z - u) / half)
            put(state.u, i, z)  # the dashpots act at this velocity in that half step
