"""Forces on single points: by the rigid wall, by the load that presses the disk on it,
and by the user's mouse."""

from dataclasses import dataclass
from math import exp
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics.law import (
    BodyForce,
    Capacity,
    Contents,
    Wall,
    array,
    get,
    pair_of,
    put,
)
from taichi_disk.mechanics.physics.ordering import Arrangement
from taichi_disk.mechanics.potential import ExponentialPotential

# a smaller force of the rigid wall on a point is not computed [M c^2/R]
NEGLIGIBLE_FORCE = exp(-45.0)
# time in which friction in NumPy stops a point, if it is strong enough [R/c]
STOPPING_TIME = 1e-9


@ti.data_oriented
@dataclass(eq=False)
class ExponentialWall(ExponentialPotential, Wall, BodyForce):
    """A flat wall at y = 0 that pushes every point of the disk upwards with a V0 exp(-a
    y), paper eqs. (3) and (6)."""

    a: float  # hardness [1/R]
    # potential at y = 0 [M c^2]; another V0 shifts the wall by ln(ratio)/a but changes
    # no result
    V0: float
    friction: float = 0.0  # Coulomb friction coefficient mu; 0: none
    switches = ("has_friction",)

    def __post_init__(self) -> None:
        self.velocity_dependent = self.has_friction = self.friction != 0.0

    @property
    def reach(self) -> float:
        """Height beyond which the force is negligible, so that no exponential is
        computed [R]."""
        return max(0.0, self.height_of_force(NEGLIGIBLE_FORCE))

    @property
    def scalars(self) -> tuple[str, ...]:
        if self.has_friction:
            return "a", "V0", "reach", "friction"
        return "a", "V0", "reach"

    @ti.func
    def at(self, state: ti.template(), i):
        y = state.x[1][i]
        point_force = 0.0
        if y < self.reach_now[None]:
            a = self.a_now[None]
            V0 = self.V0_now[None]
            point_force = a * V0 * ti.exp(-a * y)
        return ti.Vector([0.0, point_force])

    @ti.func
    def potential_at(self, state: ti.template(), i):
        y = state.x[1][i]
        energy = 0.0
        if y < self.reach_now[None]:
            energy = self.V0_now[None] * ti.exp(-self.a_now[None] * y)
        return energy

    @ti.func
    def add_friction(self, state: ti.template(), kick, late):
        """Add Coulomb friction, limited to mu times the wall's force, and return the
        power lost [M c^3/R]."""
        # It is the force that would stop a point within the next kick: forces act for
        # the time `kick`, of which `late` lies before this moment [R/c]. So a sticking
        # point has exactly no velocity between two steps, and a sliding point is never
        # reversed. A law that is smooth in the velocity cannot do that at such steps.
        power = 0.0
        for i in range(state.n_disk[None]):
            point_force = self.at(state, i)[1]
            if point_force > 0.0:
                most = self.friction_now[None] * point_force
                v = state.v[0][i]
                f = state.f[0][i]
                stopping = -(v * state.mass[i] / kick + f)
                force = ti.max(-most, ti.min(most, stopping))
                state.f[0][i] = f + force
                power -= force * (v + late * state.inverse_mass[i] * (f + force))
        return power

    # ---- in NumPy

    def friction_on(self, lattice: Lattice, x: Array, v: Array, others: Array) -> Array:
        """Return the friction (n,) along the wall [M c^2/R] on points at `x` with
        velocities `v`, both (n, 2).

        `others` (n, 2) are the other forces on the points. Friction balances them if a
        point sticks.
        """
        most = self.friction * self.forces(lattice, x)[:, 1]
        stopping = -(v[:, 0] * lattice.masses / STOPPING_TIME + others[:, 0])
        return np.clip(stopping, -most, most)

    def energy(self, lattice: Lattice, x: Array) -> float:
        return float(self.potential(x[: lattice.disk_points, 1]).sum())

    def forces(self, lattice: Lattice, x: Array) -> Array:
        force = np.zeros_like(x)
        n = lattice.disk_points
        force[:n, 1] = self.force_at(x[:n, 1])
        return force

    def stiffness(self, lattice: Lattice, x: Array) -> Any:
        from scipy.sparse import diags

        # The force a V0 exp(-a y) falls at the rate of a times itself.
        rates = self.forces(lattice, x) * [0.0, self.a]
        return diags(rates.ravel())

    def contact_forces(
        self, lattice: Lattice, x: Array, *moving: Any
    ) -> tuple[NDArray[np.intp], Array]:
        points = np.flatnonzero(x[: lattice.disk_points, 1] < self.reach)
        force = np.zeros((len(points), 2))
        force[:, 1] = self.force_at(x[points, 1])
        if moving and self.has_friction:
            v, springs = moving
            others = springs.forces(lattice, x) + springs.damping_forces(lattice, x, v)
            force[:, 0] = self.friction_on(lattice, x, v, others)[points]
        return points, force


@ti.data_oriented
@dataclass(eq=False)
class Load(BodyForce):
    """The force -P m_i/M on every point of the disk, the -P/N of paper eq. (3). Its
    potential is P y_cm."""

    force: float  # total force P [M c^2/R]
    scalars = ("force",)

    @ti.func
    def at(self, state: ti.template(), i):
        load = 0.0
        if i < state.n_disk[None]:
            load = self.force_now[None] * state.mass[i]
        return ti.Vector([0.0, -load])

    @ti.func
    def potential_at(self, state: ti.template(), i):
        return -self.at(state, i)[1] * state.x[1][i]

    # ---- in NumPy

    def energy(self, lattice: Lattice, x: Array) -> float:
        return self.force * float(lattice.mean(x[:, 1]))

    def forces(self, lattice: Lattice, x: Array) -> Array:
        force = np.zeros_like(x)
        n = lattice.disk_points
        force[:n, 1] = -self.force * lattice.masses[:n]
        return force


@ti.data_oriented
@dataclass(eq=False)
class MouseSpring(BodyForce):
    """A spring from at most one point to the mouse, whose pull is limited; see
    `Simulation.set_mouse_target`."""

    # With the pull f = min(k r, F) it has the potential f r - f^2/(2 k). So the energy
    # that the user gives to the disk is the jump of the potential when the spring is
    # tied, moved or untied. Only kernels compute this law.

    k: float  # spring constant [M c^2/R^2]
    strongest: float  # largest pull F [M c^2/R]
    scalars = ("k", "strongest")

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        super().make_fields(builder, capacity)
        # One kernel writes and reads these fields. From a 0-D field Taichi 1.7.4 would
        # then read the old value.
        self.target = pair_of(builder, 1)
        self.point = array(builder, 1)  # -1: none

    def contents(self, lattice: Lattice, arrangement: Arrangement) -> Contents:
        return [((self.point,), [-1])]

    @ti.func
    def at(self, state: ti.template(), i):
        force = ti.Vector([0.0, 0.0])
        if i == self.point[0]:
            k = self.k_now[None]
            most = self.strongest_now[None]
            d = get(self.target, 0) - get(state.x, i)
            force = (k * most / ti.max(most, k * d.norm())) * d
        return force

    @ti.func
    def potential_at(self, state: ti.template(), i):
        # a linear spring up to the largest pull, and a constant force beyond
        energy = 0.0
        if i == self.point[0]:
            k = self.k_now[None]
            r = (get(self.target, 0) - get(state.x, i)).norm()
            pull = ti.min(k * r, self.strongest_now[None])
            energy = pull * (r - 0.5 * pull / k)
        return energy

    @ti.func
    def tie(self, state: ti.template()):
        """Add the pull to the forces at this step, and return the potential that comes
        with it [M c^2]."""
        return self.add_from_now_on(state, 1.0)

    @ti.func
    def untie(self, state: ti.template()):
        """Subtract the pull from the forces at this step, and return the change of the
        potential [M c^2]."""
        return self.add_from_now_on(state, -1.0)

    @ti.func
    def add_from_now_on(self, state: ti.template(), factor):
        """Add `factor` times the pull to the forces, from this step on, and return
        `factor` times its potential energy [M c^2]."""
        i = self.point[0]
        energy = 0.0
        if i >= 0:
            force = factor * self.at(state, i)
            energy = factor * self.potential_at(state, i)
            put(state.f, i, get(state.f, i) + force)
            # The whole kick of this step will apply the new force, but its first half
            # lies before this moment. Subtract that half from the velocity in advance.
            kick = state.closing[None] * state.inverse_mass[i] * force
            put(state.v, i, get(state.v, i) - kick)
            if ti.static(state.corrected):
                correction = state.observed[None] * state.inverse_mass[i] * force
                put(state.u, i, get(state.u, i) - correction)
        return energy
