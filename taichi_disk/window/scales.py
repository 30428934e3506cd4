"""The meaning of full colour and of the longest arrow, in the page and in the window."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.render.palette import full_scale, round_near
from taichi_disk.window.sandbox import Sandbox, load_of

UPDATE_INTERVAL = 5  # pictures between two comparisons of the scales with what they show


class Scales:
    """The scales grow with what they show, and begin again with each hit and quantity.

    Attributes:
        colour: value of full colour, in units of the quantity; for fringes the stress from one fringe to the next.
        force: force of the wall on one point at the longest arrow [M c^2/R].
    """

    colour = force = 1.0
    _key: tuple[int, int, str] | None = None
    _is_reset = False

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox

    def update(self, values: NDArray[Any], forces: NDArray[Any]) -> None:
        """Enlarge the scales to hold the disk's `values` (N,) and the wall's `forces` (k, 3): point, fx, fy."""
        sandbox = self._sandbox
        scenario, name = sandbox.seen.segment.scenario, sandbox.scene.video.colour
        key = sandbox.starts, sandbox.seen.segment.hit, name
        if key != self._key:
            if not self._key or key[:2] != self._key[:2]:
                self.force = round_near(0.5 * scenario.point_force)
            self._key, load = key, load_of(scenario.scene)  # before anything is known
            self.colour = round_near(0.25 * load**2 / len(values) if name == "kinetic" else 0.05 * load)
        lowest = 0.0 if self._is_reset else self.colour
        self._is_reset, self.colour = False, max(lowest, full_scale(values.astype(np.float64), name))
        largest = float(np.hypot(forces[:, 1], forces[:, 2]).max(initial=0.0))
        if largest > self.force:
            self.force = round_near(1.2 * largest)

    def reset(self) -> None:
        """Fit the colour scale to the next picture alone."""
        self._is_reset = True
