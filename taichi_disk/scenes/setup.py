"""What the engine needs to know of a scene, and what it hands back to be judged."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.scene import Scene

Columns = dict[str, NDArray[np.float64]]  # the time series: one array (rows,) per column


@dataclass(frozen=True)
class Headline:
    """The numbers that a scene is run for, and lines that show them."""

    values: dict[str, float]
    notes: dict[str, str]  # how each was measured


class Setup(ABC):
    """One scene, ready to be stepped.

    Attributes:
        scene: the checked values it was made from.
        lattice: in scene coordinates, at t = 0.
        velocities: (n, 2) at t = 0 [c].
        physics: what acts, except the integrator, which the time step decides.
        point_force: estimate of the largest force of the wall on one point [M c^2/R].
        max_time: when to give up [R/c].
        sample_interval: longest time between two rows from which the scene can be judged [R/c].
        energy_scale: what the energy balance is measured against [M c^2].
        view: (xmin, xmax, ymin, ymax) that the film keeps in sight [R].
        depends_on_step: whether the headline does, beyond where the run happens to end.
        resolving_step: the longest step that resolves the wall, where the headline depends on the step [R/c].
        less_left_over: which keys make `left_over` smaller.
    """

    scene: Scene
    lattice: Lattice
    velocities: NDArray[np.float64]
    physics: Physics
    point_force: float
    max_time: float
    sample_interval: float
    view: tuple[float, float, float, float]
    depends_on_step: bool
    resolving_step: float
    less_left_over: str

    @property
    def row_interval(self) -> float:
        """Time between two rows to take [R/c]: shorter than `sample_interval` where that is asked for, never longer.

        What a run finds, and when it ends, must not depend on how few lines somebody wants to read.
        """
        asked = self.scene.time.sample_interval
        return self.sample_interval if asked == "auto" else min(asked, self.sample_interval)

    @abstractmethod
    def ended(self, columns: Columns) -> NDArray[np.bool_]:
        """For each row, whether the scene is over there."""

    @abstractmethod
    def unfinished(self, columns: Columns) -> str:
        """What to tell when `max_time` has come first."""

    @abstractmethod
    def headline(self, columns: Columns) -> Headline:
        """The result, from the whole time series of a scene that has ended."""

    def main_number(self, columns: Columns) -> tuple[str, float]:
        """Name and value of the first of the headline's numbers, the one that a tolerance is for."""
        return next(iter(self.headline(columns).values.items()))

    @abstractmethod
    def left_over(self, columns: Columns) -> float:
        """By how much the main number would still change if a scene that has ended went on, at any step."""

    @abstractmethod
    def energy_scale(self, columns: Columns) -> float:
        """What the closing imbalance of the energy is divided by [M c^2]."""

    @abstractmethod
    def frame_times(self, columns: Columns, frames: int) -> NDArray[np.float64]:
        """When to look, (frames,) [R/c], so that most of the film shows what matters."""

    @abstractmethod
    def title(self) -> tuple[str, ...]:
        """Lines for the film and the plot: the scene and its numbers."""

    @abstractmethod
    def caption(self, row: dict[str, float]) -> tuple[str, ...]:
        """Lines for one moment of the film, from the observables then."""


def spread(times: list[float], shares: list[float], frames: int) -> NDArray[np.float64]:
    """`frames` times from times[0] to times[-1], of which the share shares[i] lies in times[i]..times[i+1]."""
    marks = np.concatenate([[0.0], np.cumsum(shares)]) / np.sum(shares)
    return np.interp(np.linspace(0.0, 1.0, frames), marks, times)
