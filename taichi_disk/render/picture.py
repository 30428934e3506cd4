"""What a picture shows: the subject, which does not change during a film, and the single frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

if TYPE_CHECKING:
    from taichi_disk.lattice import Lattice
    from taichi_disk.scene import Colouring, Show


@dataclass(frozen=True)
class Subject:
    """What is filmed. In the lines of text, `_` begins a subscript: `v_cm`, `k_a`, `τ_{reset}`."""

    lattice: Lattice
    rigid_wall: bool  # a line at y = 0, hatched below
    title: tuple[str, ...]  # first the scene's name, then lines with its numbers
    limit: float  # the scale of colours runs from -limit, or from 0, to +limit
    view: tuple[float, float, float, float]  # xmin, xmax, ymin, ymax in R: what must be kept in view
    colouring: Colouring = "strain"
    show: Show = "both"
    full_force: float = 0.0  # of the wall on a point, drawn as an arrow of ARROW [M c^2/R]; 0: no arrows


@dataclass(frozen=True)
class Frame:
    """One instant: positions (n, 2) in scene coordinates [R], and the lines of text that change with time.

    `values` (springs,): what is coloured, in units of the subject's limit; by default the strain.
    `pushed`: the points (k,) that the wall pushes, and how hard, (k, 2) in units of the subject's full force.
    """

    t: float  # [R/c]
    positions: NDArray[np.float64]
    text: tuple[str, ...]
    values: NDArray[np.float64] | None = None
    pushed: tuple[NDArray[np.intp], NDArray[np.float64]] | None = None

    def require_finite(self) -> None:
        """Raise SimulationError if a point has no finite position: such a frame must not be drawn."""
        bad = np.flatnonzero(~np.isfinite(self.positions).all(axis=1))
        if bad.size:
            raise SimulationError(
                f"the frame at t = {self.t:g} R/c cannot be drawn: {bad.size} of {len(self.positions)} "
                f"points have no finite position (the first is point {bad[0]}); the state has blown up, "
                "try a smaller time step"
            )
