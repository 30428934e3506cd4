"""What the springs' colours can show: the quantities, their values, and what is written beside their scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.scene import Colouring

COLOURINGS: tuple[Colouring, ...] = get_args(Colouring)


@dataclass(frozen=True)
class Quantity:
    """What is said about a colouring: `label` below its scale, `ends` beside it, `unit` in the window."""

    label: str
    ends: tuple[str, str]
    unit: str
    signed: bool = False  # from -limit to limit, else from 0 to limit


QUANTITIES: dict[Colouring, Quantity] = {
    "strain": Quantity("strain of the springs, (|r| − L) / L", ("compressed", "stretched"), "", True),
    "force": Quantity("force of the springs [Mc²/R]", ("push", "pull"), "M c^2/R", True),
    "speed": Quantity("speed of the points [c]", ("at rest", "fast"), "c"),
    "kinetic": Quantity("kinetic energy of a point [Mc²]", ("at rest", "fast"), "M c^2"),
}


def spring_values(
    lattice: Lattice,
    physics: Physics,
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
    colouring: Colouring,
) -> NDArray[np.float64]:
    """(springs,) strain, tension, or the mean speed or kinetic energy of a spring's two ends.

    `positions` [R] and `velocities` [c]: (n, 2).
    """
    i, j = lattice.bonds.T
    if colouring in ("strain", "force"):
        stretch = np.hypot(*(positions[i] - positions[j]).T) - lattice.rest_lengths
        if colouring == "strain":
            return np.asarray(stretch / lattice.rest_lengths)
        return np.asarray(physics.k_a * stretch + physics.k_b * stretch**3)
    squares = (velocities**2).sum(axis=1)
    each = np.sqrt(squares) if colouring == "speed" else 0.5 * lattice.masses * squares
    return np.asarray(0.5 * (each[i] + each[j]))


def round_up(value: float) -> float:
    """The next of 1, 2 and 5 times a power of ten: where a scale may end."""
    decade = 10.0 ** np.floor(np.log10(max(value, 1e-12)))
    return float(decade * next(step for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= value * (1 - 1e-9)))
