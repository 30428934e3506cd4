"""The rigid wall: a potential V0 exp(-a y) for every point of the disk, paper eqs. (3) and (6)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.physics.law import Array, BodyForce


@ti.data_oriented
@dataclass(eq=False)
class ExponentialWall(BodyForce):
    """A flat wall at y = 0 that pushes with a V0 exp(-a y) upwards."""

    a: float  # hardness [1/R]
    V0: float  # potential at y = 0 [M c^2]; another V0 shifts the wall by ln(ratio)/a and changes no result

    column = "wall"
    scalars = ("a", "V0", "reach")

    @property
    def reach(self) -> float:
        """Height beyond which a V0 exp(-a y) < e^-45 [M c^2/R]: no exponential is computed there."""
        return max(0.0, (np.log(self.a * self.V0) + 45.0) / self.a)

    def added_stiffness(self, point_force: float) -> float:
        """What the wall adds to the stiffness of a point that it pushes with `point_force` [M c^2/R^2]: a F."""
        return self.a * point_force

    @ti.func
    def at(self, state: ti.template(), i):
        y = state.x[1][i]
        push = 0.0
        if y < self.now.reach[None]:
            a, V0 = self.now.a[None], self.now.V0[None]
            push = a * V0 * ti.exp(-a * y)
        return ti.Vector([0.0, push])

    @ti.func
    def potential_at(self, state: ti.template(), i):
        y = state.x[1][i]
        energy = 0.0
        if y < self.now.reach[None]:
            energy = self.now.V0[None] * ti.exp(-self.now.a[None] * y)
        return energy

    # ---- the NumPy twin

    def potential(self, y: Array) -> Array:
        """V0 exp(-a y) [M c^2]; infinite far inside the wall."""
        with np.errstate(over="ignore"):
            return np.asarray(self.V0 * np.exp(-self.a * y))

    def energy(self, lattice: Lattice, x: Array) -> float:
        return float(self.potential(x[: lattice.disk_points, 1]).sum())

    def forces(self, lattice: Lattice, x: Array) -> Array:
        force = np.zeros_like(x)
        force[: lattice.disk_points, 1] = self.a * self.potential(x[: lattice.disk_points, 1])
        return force

    def stiffness(self, lattice: Lattice, x: Array) -> Any:
        from scipy.sparse import diags

        return diags((np.array([0.0, self.a]) * self.forces(lattice, x)).ravel())

    def contact_forces(self, lattice: Lattice, x: Array) -> tuple[NDArray[np.intp], Array]:
        """(points (k,), forces (k, 2) [M c^2/R]) of the wall on the points in its reach."""
        points = np.flatnonzero(x[: lattice.disk_points, 1] < self.reach)
        return points, self.forces(lattice, x)[points]
