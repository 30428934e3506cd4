"""A scale, of colours or arrows, that grows with what it has to show."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.render.colouring import round_up

_FULL = 98.0  # percentile that takes the full colour


class Scale:
    """The end of a scale: 1, 2 or 5 times a power of ten, never smaller than it was."""

    def __init__(self, limit: float, full: float = _FULL) -> None:
        """`full`: percentile of the values that may reach the end."""
        self.limit, self._full = round_up(limit), full

    def places(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """`values` as places in the scale, -1 to 1, after growing it where they need that."""
        largest = float(np.percentile(np.abs(values), self._full)) if values.size else 0.0
        if largest > self.limit:
            self.limit = round_up(largest)
        return np.asarray(values / self.limit)
