"""What a picture shows: the subject, which does not change during a film, and the single frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

if TYPE_CHECKING:
    from taichi_disk.lattice import Lattice


@dataclass(frozen=True)
class Subject:
    """What is filmed. In the lines of text, `_` begins a subscript: `v_cm`, `k_a`, `τ_{reset}`."""

    lattice: Lattice
    rigid_wall: bool  # a line at y = 0, hatched below
    title: tuple[str, ...]  # first the scene's name, then lines with its numbers
    strain_limit: float  # the colour scale runs from -strain_limit to +strain_limit
    view: tuple[float, float, float, float]  # xmin, xmax, ymin, ymax in R: what must be kept in view


@dataclass(frozen=True)
class Frame:
    """One instant: positions (n, 2) in scene coordinates [R], and the lines of text that change with time."""

    t: float  # [R/c]
    positions: NDArray[np.float64]
    text: tuple[str, ...]

    def require_finite(self) -> None:
        """Raise SimulationError if a point has no finite position: such a frame must not be drawn."""
        bad = np.flatnonzero(~np.isfinite(self.positions).all(axis=1))
        if bad.size:
            raise SimulationError(
                f"the frame at t = {self.t:g} R/c cannot be drawn: {bad.size} of {len(self.positions)} "
                f"points have no finite position (the first is point {bad[0]}); the state has blown up, "
                "try a smaller time step"
            )
