"""A wall's potential V0 exp(-a y), and what follows from its two numbers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from taichi_disk.lattice import Array


class ExponentialPotential:
    """What a wall's law and a wall's section of a scene file both are. `y`: distance from the wall [R]."""

    a: float  # hardness [1/R]
    V0: float  # potential at distance 0 [M c^2]
    friction = 0.0  # coefficient mu of Coulomb's friction; 0: none

    @property
    def has_friction(self) -> bool:
        return self.friction != 0.0

    @property
    def decay_length(self) -> float:
        """Over which potential and force fall to 1/e [R]."""
        return 1.0 / self.a

    def potential(self, y: Array | float) -> Array:
        """V0 exp(-a y) [M c^2]; infinite far inside the wall."""
        with np.errstate(over="ignore"):
            return np.asarray(self.V0 * np.exp(-self.a * y))

    def force_at(self, y: Array | float) -> Array:
        """a V0 exp(-a y) [M c^2/R]."""
        return self.a * self.potential(y)

    def height_of(self, energy: float, heights: Array | float = 0.0) -> float:
        """Distance at which a point has the potential `energy` [M c^2]; of the lowest of several, all together.

        `heights` (k,) are those of the points above the lowest [R].
        """
        total = np.log(np.exp(-self.a * heights).sum()) + np.log(self.V0)
        return float((total - np.log(energy)) / self.a)

    def height_of_force(self, force: float, heights: Array | float = 0.0) -> float:
        """Distance at which the wall pushes with `force` [M c^2/R], else as `height_of`."""
        return float(np.log(self.a * self.V0 * np.exp(-self.a * heights).sum() / force) / self.a)

    def added_stiffness(self, force: float) -> float:
        """What the wall adds to the stiffness of a point that it pushes with `force` [M c^2/R^2]: a F."""
        return self.a * force
