"""The wall potential V0 exp(-a y). NumPy is imported when used, because --help and the
sections of a scene file need no arrays."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taichi_disk.mechanics.lattice import Array


class ExponentialPotential:
    """Base class of wall laws and of the walls' sections in scene files. `y`: distance
    from the wall [R]."""

    a: float  # hardness [1/R]
    V0: float  # potential at distance 0 [M c^2]
    friction = 0.0  # Coulomb friction coefficient mu; 0: none

    @property
    def decay_length(self) -> float:
        """Length over which potential and force fall to 1/e [R]."""
        return 1.0 / self.a

    def potential(self, y: Array | float) -> Array:
        """Return V0 exp(-a y) [M c^2], which is infinite far inside the wall."""
        import numpy as np

        with np.errstate(over="ignore"):
            return self.V0 * np.exp(-self.a * y)

    def force_at(self, y: Array | float) -> Array:
        """Return a V0 exp(-a y) [M c^2/R]."""
        return self.a * self.potential(y)

    def height_of(self, energy: float, heights: Array | float = 0.0) -> float:
        """Return the distance of the lowest point [R] at which all points together have
        the potential `energy` [M c^2].

        `heights` (k,): heights of the points above the lowest one [R].
        """
        import numpy as np

        total = np.log(np.exp(-self.a * heights).sum()) + np.log(self.V0)
        return float((total - np.log(energy)) / self.a)

    def height_of_force(self, force: float, heights: Array | float = 0.0) -> float:
        """Return the distance of the lowest point [R] at which the wall's total force
        is `force` [M c^2/R]."""
        import numpy as np

        force_at_0 = self.a * self.V0 * np.exp(-self.a * heights).sum()
        return float(np.log(force_at_0 / force) / self.a)

    def added_stiffness(self, force: float) -> float:
        """Return the wall's contribution a F to the stiffness of a point under the wall
        force F [M c^2/R^2]."""
        return self.a * force
