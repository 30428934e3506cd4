"""Sides and bottom of the elastic wall (paper section 5): pinned, reset or matched.

The paper says that "the energy of the particles at both sides and the bottom is reset
to 0 at every time step". This
can be read in three ways: `ResetBoundary` zeroes velocities at a fixed interval that
does not depend on the time step; `PinnedBoundary` is its limit for an interval of 0, a
perfect reflector; `MatchedBoundary` absorbs waves (Lysmer & Kuhlemeyer 1969), which is
the purpose of the reset.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics.law import (
    Capacity,
    Contents,
    Law,
    array,
    get,
    pair_of,
    put,
)
from taichi_disk.mechanics.physics.ordering import Arrangement


@ti.data_oriented
class Boundary(Law):
    """What happens to the points of `Lattice.wall_boundary`."""

    interval = 0.0  # time between two resets of the velocities [R/c]; 0: no resets
    impedance: Array | None = None  # dashpot constants of a `MatchedBoundary`
    is_pinned = False

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        self.point = array(builder, capacity.points)
        self.count = array(builder, 1)

    def contents(self, lattice: Lattice, arrangement: Arrangement) -> Contents:
        return [
            ((self.point,), lattice.wall_boundary),
            ((self.count,), [len(lattice.wall_boundary)]),
        ]


@ti.data_oriented
class PinnedBoundary(Boundary):
    """A boundary whose points cannot move."""

    is_pinned = True

    @ti.func
    def hold(self, state: ti.template()):
        """Set the force on the points to zero, so that they stay at rest."""
        for k in range(self.count[0]):
            put(state.f, self.point[k], ti.Vector([0.0, 0.0]))


@ti.data_oriented
@dataclass(eq=False)
class MatchedBoundary(Boundary):
    """Dashpots with the force -Z v on each point, Z from `matched_impedance`: waves
    leave without reflection."""

    velocity_dependent = True
    # (k, 2) Z for x and y: rho c times the length of boundary that a point represents
    # [M c/R]
    impedance: Array

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        super().make_fields(builder, capacity)
        self.Z = pair_of(builder, capacity.points)

    def contents(self, lattice: Lattice, arrangement: Arrangement) -> Contents:
        return [*super().contents(lattice, arrangement), (self.Z, self.impedance)]

    def damping_forces(self, lattice: Lattice, x: Array, v: Array) -> Array:
        force = np.zeros_like(v)
        force[lattice.wall_boundary] = -self.impedance * v[lattice.wall_boundary]
        return force

    @ti.func
    def damp(self, state: ti.template(), half):
        """Add the forces -Z v of the dashpots. All forces, including these, change the
        velocity v_ in `state.v` to v in the time `half`.

        Returns (v.Zv + 2 v_.Zv_)/3, for the energy balance.
        """
        power = 0.0
        for k in range(self.count[0]):
            i = self.point[k]
            own = half * state.inverse_mass[i]
            for c in ti.static(range(2)):
                Z = self.Z[c][k]
                before = state.v[c][i]
                v = (before + own * state.f[c][i]) / (1.0 + own * Z)
                state.f[c][i] -= Z * v
                power += Z * (v * v + 2.0 * before * before) / 3.0
        return power

    @ti.func
    def solved_power(self, state: ti.template()):
        """Return the power u.Zu with the velocities u at this step, which a solver has
        found."""
        power = 0.0
        for k in range(self.count[0]):
            u = get(state.u, self.point[k])
            power += (get(self.Z, k) * u).dot(u)
        return power


@ti.data_oriented
@dataclass(eq=False)
class ResetBoundary(Boundary):
    """A boundary whose velocities are set to zero once every `interval`: a drag of 2
    m/interval on each point."""

    # Springs do not depend on velocity, but the force of dashpots jumps at a reset. The
    # next half step has to start from the force after the jump, or the reset would cost
    # an order of accuracy.

    interval: float  # time between two resets, a whole number of time steps [R/c]

    @ti.func
    def stop(
        self,
        state: ti.template(),
        springs: ti.template(),
        solver: ti.template(),
        implicit: ti.template(),
    ):
        """Set the velocities at this step to zero, and return the kinetic energy that
        is lost [M c^2].

        Leapfrog conserves m/2 v_{k-1/2} v_{k+1/2} = m/2 v_k^2 - m/2 (h/2 f_k/m)^2. With
        dashpots f_k jumps, too, so the last term changes as well.
        `implicit`: whether `solver` (see `trapezoidal`) has solved for the velocities
            in `state.u`.
        """
        energy = 0.0
        if ti.static(springs.damped):
            energy = -self.half_kick_energy(state, implicit)
        if ti.static(springs.damped and not implicit):
            for i in range(state.n[None]):
                put(state.u, i, ti.Vector([0.0, 0.0]))
        for k in range(self.count[0]):
            i = self.point[k]
            kick = self.closing_kick(state, i)
            v = get(state.v, i) + kick
            if ti.static(implicit):
                v = get(state.u, i)
                put(state.u, i, ti.Vector([0.0, 0.0]))
            elif ti.static(springs.damped):
                put(state.u, i, v)
            else:
                put(state.v, i, -1.0 * kick)
            energy += 0.5 * state.mass[i] * v.dot(v)
        if ti.static(implicit):
            solver.restart(state)
        elif ti.static(springs.damped):
            self.restart_explicit(state, springs)
        if ti.static(springs.damped):
            energy += self.half_kick_energy(state, False)
        return energy

    @ti.func
    def restart_explicit(self, state: ti.template(), springs: ti.template()):
        """Update `f` and `u` after a reset. Before, `u` holds the velocity that each
        point has lost."""
        eta = springs.eta_now[None]
        for i in range(state.n[None]):
            change = self.closing_kick(state, i) - get(state.u, i)
            put(state.v, i, get(state.v, i) + change)
        for b in range(state.blocks[None]):
            for k in ti.static(range(len(springs.first))):
                i = springs.first[k][b]
                j = springs.second[k][b]
                lost = get(state.u, j) - get(state.u, i)
                damped = springs.damped_part(state, k, b, lost)
                springs.pull_together(state.f, k, b, eta * damped)
        for i in range(state.n[None]):
            v = get(state.v, i)
            put(state.u, i, v)
            put(state.v, i, v - self.closing_kick(state, i))

    @ti.func
    def closing_kick(self, state: ti.template(), i):
        """Return the change of a point's velocity by the half kick that ends a step."""
        return state.closing[None] * state.inverse_mass[i] * get(state.f, i)

    @ti.func
    def half_kick_energy(self, state: ti.template(), solved: ti.template()):
        """Return the kinetic energy of a half step's change of velocity: h/2 f/m, or u
        - v if u is `solved` for."""
        energy = 0.0
        for i in range(state.n[None]):
            kick = 0.5 * state.h[None] * state.inverse_mass[i] * get(state.f, i)
            if ti.static(solved):
                kick = get(state.u, i) - get(state.v, i)
            energy += 0.5 * state.mass[i] * kick.dot(kick)
        return energy

    @ti.func
    def dashpot_work(self, state: ti.template(), springs: ti.template(), h):
        """Return sum(eta (u_i - u_j).(w_i - w_j)) over the springs with w = v + h f/m;
        h = 0 for the last half step."""
        power = 0.0
        for b in range(state.blocks[None]):
            for k in ti.static(range(len(springs.first))):
                i = springs.first[k][b]
                j = springs.second[k][b]
                between = get(state.u, i) - get(state.u, j)
                u = springs.damped_part(state, k, b, between)
                a_i = state.inverse_mass[i] * get(state.f, i)
                a_j = state.inverse_mass[j] * get(state.f, j)
                w = get(state.v, i) - get(state.v, j) + h * (a_i - a_j)
                power += springs.eta_now[None] * u.dot(w)
        return power


def matched_impedance(lattice: Lattice, normal: float, tangential: float) -> Array:
    """Return the dashpot constants (k, 2) [M c/R] of `wall_boundary`.

    Half of each segment of the boundary belongs to each of its ends. Dashpots resist
    with rho c_p (`normal`) across the segment, and with rho c_s (`tangential`) along it
    [M c/R^2].
    """
    chain = lattice.positions[lattice.wall_boundary]
    segment = np.diff(chain, axis=0)
    length = np.hypot(segment[:, 0], segment[:, 1])[:, None]
    along = (segment / length) ** 2  # squared direction cosines of the segments
    across = along[:, ::-1]  # and of their normals
    of_half = 0.5 * length * (normal * across + tangential * along)
    impedance = np.zeros_like(chain)
    impedance[:-1] += of_half
    impedance[1:] += of_half
    return impedance
