"""Springs and dashpots: f_ij = -(k_a s + k_b s^3) e - eta (v_i - v_j), paper eqs. (1),
(3) and (6).

s = |r_i - r_j| - L_ij is the stretch of a spring beyond its rest length L_ij, the
distance in the unloaded lattice; e = (r_i - r_j)/|r_i - r_j|. The paper's dashpots
resist the whole relative velocity of their ends, including a rotation. Axial dashpots,
which are not in the paper, exert -eta ((v_i - v_j).e) e and conserve angular momentum.
(The plus sign before eta in eq. (1) is a misprint: (3) and (6) have a minus.)
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.network import assemble
from taichi_disk.mechanics.lattice.triangles import norms
from taichi_disk.mechanics.physics.law import (
    Capacity,
    Contents,
    Law,
    get,
    put,
    side_by_side,
)
from taichi_disk.mechanics.physics.ordering import BLOCK, Arrangement


@ti.data_oriented
@dataclass(eq=False)
class Springs(Law):
    """The springs of a lattice, each with a dashpot in parallel."""

    # Kernels compute blocks of BLOCK springs, so that square roots and divisions become
    # vector instructions.

    k_a: float = 1.0  # linear spring constant [M c^2/R^2]
    k_b: float = 0.0  # cubic spring constant [M c^2/R^4]; 0: no cubic term is computed
    # dashpot constant eta_dis = eta* m c/R of every spring [M c/R]; 0: no dashpots
    eta: float = 0.0
    # whether dashpots resist only the relative velocity along their spring
    axial: bool = False
    scalars = ("k_a", "k_b", "eta")
    switches = ("cubic", "damped", "axial")
    # whether the springs have a `Lattice.stiffness`; a simulation sets this on its copy
    non_uniform = False

    def __post_init__(self) -> None:
        self.cubic = self.k_b != 0.0
        self.damped = self.eta != 0.0
        self.velocity_dependent = self.damped

    @property
    def modulus(self) -> float:
        """Approximate Young's modulus of the lattice [M c^2/R^2]; measured values are
        1.04 to 1.11 times larger."""
        return self.k_a

    @property
    def time_unit(self) -> float:
        """Approximate time in which a wave crosses R [R/c]; its inverse is the speed of
        sound [c]."""
        return float(1.0 / np.sqrt(self.modulus))

    def prepare_for(self, lattice: Lattice) -> None:
        """Make the fields of stiffness factors only if `lattice` has some."""
        self.non_uniform = lattice.stiffness is not None

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        super().make_fields(builder, capacity)
        self.first, self.second, self.rest = (
            side_by_side(builder, capacity.blocks, BLOCK, kind)
            for kind in (ti.i32, ti.i32, ti.f64)
        )
        if self.non_uniform:
            self.factor = side_by_side(builder, capacity.blocks, BLOCK)

    def contents(self, lattice: Lattice, arrangement: Arrangement) -> Contents:
        source = arrangement.source
        ends = arrangement.ends
        numbers = [*ends.T, np.where(source < 0, 1.0, lattice.rest_lengths[source])]
        fields = (*self.first, *self.second, *self.rest)
        if lattice.stiffness is not None:
            numbers.append(np.where(source < 0, 1.0, lattice.stiffness[source]))
            fields += self.factor
        blocks = [column.reshape(-1, BLOCK) for column in numbers]
        return [(fields, np.concatenate(blocks, axis=1))]

    @ti.func
    def add(self, state: ti.template(), dashpots: ti.template(), begin, end):
        """Add the forces of the springs in blocks begin..end, and of their `dashpots`
        at the velocities u.

        Returns the elastic energy sum(k_a s^2/2 + k_b s^4/4) [M c^2] and, for the power
        lost in the dashpots, sum((u_i
        - u_j). (w_i - w_j)) [c^2] over these springs with w = (u + 2 v)/3. Axial
        dashpots count only the components along the spring. Stiffness factors weight
        the springs.
        """
        all_k_a = self.k_a_now[None]
        all_k_b = self.k_b_now[None]
        all_eta = self.eta_now[None]
        energy = ti.Vector.zero(ti.f64, BLOCK)
        products = ti.Vector.zero(ti.f64, BLOCK)
        for block in range(begin, end):
            k_a, k_b, eta = [
                self.stiffened(constant, block)
                for constant in [all_k_a, all_k_b, all_eta]
            ]
            dx, dy = self.differences(state.x, block)
            rest = ti.Vector([self.rest[k][block] for k in range(BLOCK)])
            r = ti.sqrt(dx * dx + dy * dy)
            s = r - rest
            part = s / r
            s2 = s * s
            pull = k_a * part
            energy += (0.5 * k_a) * s2
            if ti.static(self.cubic):
                pull += k_b * s2 * part
                energy += (0.25 * k_b) * s2 * s2
            fx = pull * dx
            fy = pull * dy
            if ti.static(dashpots):
                ux, uy = self.differences(state.u, block)
                vx, vy = self.differences(state.v, block)
                if ti.static(self.axial):
                    along = (ux * dx + uy * dy) / (r * r)
                    ux = along * dx
                    uy = along * dy
                product = ux * (ux + 2.0 * vx) + uy * (uy + 2.0 * vy)
                products += self.stiffened(product, block)
                fx += eta * ux
                fy += eta * uy
            for k in ti.static(range(BLOCK)):
                self.pull_together(state.f, k, block, ti.Vector([fx[k], fy[k]]))
        elastic = 0.0
        rate = 0.0
        for k in ti.static(range(BLOCK)):
            elastic += energy[k]
            rate += products[k] / 3.0
        return elastic, rate

    @ti.func
    def stiffened(self, value, block):
        if ti.static(self.non_uniform):
            return value * ti.Vector([self.factor[k][block] for k in range(BLOCK)])
        else:
            return value

    @ti.func
    def differences(self, pair: ti.template(), block):
        # x and y of a point are adjacent in memory, so one instruction loads or
        # subtracts both.
        d = [
            get(pair, self.first[k][block]) - get(pair, self.second[k][block])
            for k in range(BLOCK)
        ]
        dx = ti.Vector([vector[0] for vector in d])
        dy = ti.Vector([vector[1] for vector in d])
        return dx, dy

    @ti.func
    def damped_part(self, state: ti.template(), k: ti.template(), block, velocity):
        """Return the component of a relative `velocity` that the dashpot of spring k
        damps, times its stiffness."""
        part = velocity
        if ti.static(self.non_uniform):
            part = self.factor[k][block] * velocity
        if ti.static(self.axial):
            d = get(state.x, self.first[k][block]) - get(state.x, self.second[k][block])
            part = (part.dot(d) / d.dot(d)) * d
        return part

    @ti.func
    def pull_together(self, pair: ti.template(), k: ti.template(), block, force):
        """Subtract a force from the first end of spring k of a block and add it to the
        second."""
        i = self.first[k][block]
        j = self.second[k][block]
        put(pair, i, get(pair, i) - force)
        put(pair, j, get(pair, j) + force)

    # ---- in NumPy

    def stretch(self, lattice: Lattice, x: Array) -> Array:
        """Return the stretch (m,) of each spring beyond its rest length [R]."""
        return norms(lattice.spring_vectors(x)) - lattice.rest_lengths

    def strain(self, lattice: Lattice, x: Array) -> Array:
        """Return the stretch (m,) of each spring over its rest length."""
        return self.stretch(lattice, x) / lattice.rest_lengths

    def tension(self, lattice: Lattice, x: Array) -> Array:
        """Return the tension (m,) k_a s + k_b s^3 of each spring, positive if it is
        stretched [M c^2/R]."""
        return self.pull(lattice, self.stretch(lattice, x))

    def pull(self, lattice: Lattice, s: Array) -> Array:
        """Return the tensions k_a s + k_b s^3 at the stretches `s` (m,) [M c^2/R]."""
        return lattice.stiffened(s * (self.k_a + self.k_b * s * s))

    def energies(self, lattice: Lattice, x: Array) -> Array:
        """Return the energy (m,) k_a s^2/2 + k_b s^4/4 of each spring [M c^2]."""
        square = self.stretch(lattice, x) ** 2
        energies = (0.5 * self.k_a + 0.25 * self.k_b * square) * square
        return lattice.stiffened(energies)

    def energy(self, lattice: Lattice, x: Array) -> float:
        return float(self.energies(lattice, x).sum())

    def forces(self, lattice: Lattice, x: Array) -> Array:
        vectors = lattice.spring_vectors(x)
        length = norms(vectors)
        tension = self.pull(lattice, length - lattice.rest_lengths)
        return self._gathered(lattice, len(x), tension / length * vectors)

    def damping_forces(self, lattice: Lattice, x: Array, v: Array) -> Array:
        velocity = lattice.spring_vectors(v)
        if self.axial:
            d = lattice.spring_vectors(x)
            along = (velocity * d).sum(axis=0) / (d * d).sum(axis=0)
            velocity = along * d
        pulls = lattice.stiffened(self.eta * velocity)
        return self._gathered(lattice, len(v), pulls)

    @staticmethod
    def _gathered(lattice: Lattice, n: int, pulls: Array) -> Array:
        i, j = lattice.ends
        sums = [np.bincount(j, pull, n) - np.bincount(i, pull, n) for pull in pulls]
        return np.stack(sums, axis=1)

    def stiffness(self, lattice: Lattice, x: Array) -> Any:
        """Return the stiffness: T' e e^T + T/r (1 - e e^T) of a spring of length r and
        tension T."""
        s = self.stretch(lattice, x)
        length = s + lattice.rest_lengths
        ex, ey = lattice.spring_vectors(x) / length
        along = lattice.stiffened(self.k_a + 3.0 * self.k_b * s * s)
        across = self.pull(lattice, s) / length
        xx = along * ex * ex + across * ey * ey
        yy = along * ey * ey + across * ex * ex
        xy = (along - across) * ex * ey
        matrices = np.stack([xx, xy, xy, yy], axis=1).reshape(-1, 2, 2)
        return assemble(matrices, lattice.bonds, len(x))
