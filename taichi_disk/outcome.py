"""What a computation hands on to the files, the plot and the film, however it was computed."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.scenes.setup import Columns

# t [R/c], positions (n, 2) [R], velocities (n, 2) [c]
Snapshot = tuple[float, NDArray[np.float64], NDArray[np.float64]]
Snapshots = Iterator[Snapshot]


@dataclass(frozen=True)
class Outcome:
    """A scene computed to its end.

    Attributes:
        columns: the time series.
        positions, velocities: (n, 2) at the end.
        snapshots: the states at given ascending times, computed when asked for.
        facts: how it was computed, for the summary: steps, dt, integrator, energy balance.
        compile_seconds: wall-clock time spent on compiling.
    """

    columns: Columns
    positions: NDArray[np.float64]
    velocities: NDArray[np.float64]
    snapshots: Callable[[NDArray[np.float64]], Snapshots]
    facts: dict[str, Any]
    compile_seconds: float = 0.0
