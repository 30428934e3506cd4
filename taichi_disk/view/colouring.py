"""What the springs' colours can show, and a scale that grows with what it has to show."""

from __future__ import annotations

from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from taichi_disk.view.sandbox import Sandbox

Colouring = Literal["strain", "force", "speed", "energy"]
COLOURINGS: tuple[Colouring, ...] = get_args(Colouring)
UNITS = {"strain": "", "force": "M c^2/R", "speed": "c", "energy": "M c^2"}
_FULL = 98.0  # percentile that takes the full colour


def spring_values(sandbox: Sandbox, colouring: Colouring) -> NDArray[np.float64]:
    """(springs,) strain, tension, or the mean speed or kinetic energy of a spring's two ends."""
    lattice, physics = sandbox.setup.lattice, sandbox.world.physics
    i, j = lattice.bonds.T
    if colouring in ("strain", "force"):
        x = sandbox.positions
        stretch = np.hypot(*(x[i] - x[j]).T) - lattice.rest_lengths
        if colouring == "strain":
            return np.asarray(stretch / lattice.rest_lengths)
        return np.asarray(physics.k_a * stretch + physics.k_b * stretch**3)
    squares = (sandbox.velocities**2).sum(axis=1)
    each = np.sqrt(squares) if colouring == "speed" else 0.5 * lattice.masses * squares
    return np.asarray(0.5 * (each[i] + each[j]))


class Scale:
    """The end of the scale of colours: 1, 2 or 5 times a power of ten, never smaller than it was."""

    def __init__(self, limit: float) -> None:
        self.limit = round_up(limit)

    def places(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """`values` as places in the scale, -1 to 1, after growing it where they need that."""
        largest = float(np.percentile(np.abs(values), _FULL))
        if largest > self.limit:
            self.limit = round_up(largest)
        return np.asarray(values / self.limit)


def round_up(value: float) -> float:
    """The next of 1, 2 and 5 times a power of ten."""
    decade = 10.0 ** np.floor(np.log10(max(value, 1e-12)))
    return float(decade * next(step for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= value * (1 - 1e-9)))
