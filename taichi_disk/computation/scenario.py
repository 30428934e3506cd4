"""What a scene gives the engine: start, laws, end, and results from the time series. Each kind is a subclass."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from taichi_disk.lattice import Array, Lattice
from taichi_disk.progress import Progress, silent
from taichi_disk.simulation.observables import Columns

if TYPE_CHECKING:  # scene files are checked without Taichi
    from taichi_disk.physics import Model
    from taichi_disk.statics.equilibrium import Equilibrium


class Scenario(ABC):
    """One scene, ready to be stepped.

    Attributes:
        scene: the checked values it was made from.
        lattice: in scene coordinates, at t = 0.
        velocities: (n, 2) at t = 0 [c].
        model: what acts.
        point_force: estimate of the largest force of the wall on one point [M c^2/R].
        max_time: when to give up [R/c].
        sample_interval: longest time between two rows from which `result` can be found [R/c].
        view: (xmin, xmax, ymin, ymax) that the film keeps in sight [R].
        spoke: the point to which pictures draw a line from the disk's centre, so that a rotation is seen; -1: none.
        step_dependent: whether the primary result depends on the time step, beyond where the run happens to end.
        wall_step: the longest step that resolves the wall, where the result depends on the step [R/c].
        truncation_remedy: which keys make `end_truncation_error` smaller.
        own_velocities: whether those at t = 0 were given.
        static: whether nothing moves: equilibria under growing loads take the place of time, and the last is `rest`.
        rest: the equilibrium under the load, by Newton's method, if there is a load.
        quiet_time: how long rows have to stay within `end_bounds` [R/c]; 0: one row is enough.
        is_thrown: whether the disk flies at a wall: it can be aimed, and a contact passes in slow motion.
        symbol: of the primary result.
        end_words: what has happened at the end, for messages.
        momentary_label: name and unit of `momentary_motion`.
        time_label, pace: what `t` is, for the axes of curves; how much of it a film shows, to be filled in.
        labels: name and unit of each number of `result` that is shown.
        notes: how each number of `result` was measured.
    """

    scene: Any
    lattice: Lattice
    velocities: Array
    model: Model
    point_force: float
    max_time: float
    sample_interval: float
    view: tuple[float, float, float, float]
    spoke: int = -1
    step_dependent: bool = True
    wall_step: float = float("inf")
    truncation_remedy: str = ""
    rest: Equilibrium | None = None
    quiet_time: float = 0.0
    own_velocities: bool = False
    static: ClassVar[bool] = False
    is_thrown: ClassVar[bool] = False
    symbol: ClassVar[str] = ""
    end_words: ClassVar[str] = ""
    momentary_label: ClassVar[tuple[str, str]] = ("velocity upwards", "c")
    time_label: ClassVar[str] = "time  [R/c]"
    pace: ClassVar[str] = "slow motion: 1 s = {:g} R/c"
    labels: ClassVar[dict[str, tuple[str, str]]]
    notes: ClassVar[dict[str, str]] = {}

    @property
    def row_interval(self) -> float:
        """Time between two rows to take [R/c]: shorter than `sample_interval` where that is asked for, never longer.

        What a run finds, and when it ends, must not depend on how few lines somebody wants to read.
        """
        asked = self.scene.time.sample_interval
        return self.sample_interval if asked == "auto" else min(asked, self.sample_interval)

    def quasistatic(self, loads: int, progress: Progress = silent) -> Any:
        """Return the `Outcome` of `loads` equilibria under growing loads. Only a compression has one."""
        raise NotImplementedError

    def go_on_from(self, positions: Array, velocities: Array) -> None:
        """Begin in another state, (n, 2) [R] and [c], instead."""
        self.lattice, self.velocities = replace(self.lattice, positions=positions), velocities

    # ---- the end

    def end_bounds(self) -> dict[str, tuple[float, float]]:
        """Least and largest value of columns at the end of the scene: kernels stop at a row that is within them."""
        return {}

    def ended(self, columns: Columns) -> bool:
        """Whether the scene is over at the last row, which is within `end_bounds`."""
        return True

    def unfinished(self, columns: Columns) -> str:
        """The message where `max_time` has come first."""
        return f"the scene has not ended by t = {columns['t'][-1]:.6g} R/c"

    # ---- the result

    @abstractmethod
    def result(self, columns: Columns) -> dict[str, float]:
        """The numbers that the scene is run for, the primary result first, from the time series of an ended scene."""

    def result_scales(self, columns: Columns) -> dict[str, float]:
        """By how much each result that has an error estimate is off for a relative energy imbalance of 1, about."""
        return {self.primary(columns)[0]: 1.0}

    def primary(self, columns: Columns) -> tuple[str, float]:
        """Name and value of the primary result, the one that a tolerance is for."""
        return next(iter(self.result(columns).items()))

    def end_truncation_error(self, columns: Columns) -> float:
        """By how much the primary result would still change if an ended scene went on, at any step."""
        return 0.0

    def energy_scale(self, columns: Columns) -> float:
        """What the energy imbalance is divided by [M c^2]."""
        return self.reference_energy

    @property
    def reference_energy(self) -> float:
        """What the energy imbalance is divided by before the end is known [M c^2]."""
        return 1.0

    @property
    def sensitivity(self) -> float:
        """How many times as much a relative imbalance may mean for the result, which is a part of the motion only."""
        return 1.0

    # ---- pictures

    def frame_times(self, columns: Columns, frames: int) -> Array:
        """When to look, (frames,) [R/c], so that most of the film shows what matters."""
        return np.linspace(0.0, columns["t"][-1], frames)

    @abstractmethod
    def motion(self, columns: Columns) -> tuple[Array, str]:
        """The curve that the scene is about, (rows,), and the label of its axis."""

    def momentary_motion(self, row: Any) -> Any:
        """Return the quantity of `momentary_label` from observables, numbers or arrays (rows,), of any moment."""
        return row["com_vy"]

    def continuum(self, columns: Columns) -> dict[str, Array]:
        """What laws of the continuum say of `motion`, by their names."""
        return {}

    def last_motion(self, columns: Columns) -> float:
        """Where the curves' time axis ends [R/c]."""
        return float(columns["t"][-1])

    def marks(self, columns: Columns) -> tuple[str, str]:
        """What to write at the end of `motion`, "e = 0.96723", and beside the wall's force; may be empty."""
        return "", ""

    def quality(self, columns: Columns) -> tuple[Array, str, str] | None:
        """A curve of how good the run is (rows,), its label, and the scale of its axis: "linear" or "log"."""
        return None

    @abstractmethod
    def title(self) -> tuple[str, ...]:
        """Lines for the film and the plot: the scene and its numbers."""

    def caption(self, row: dict[str, float]) -> tuple[str, ...]:
        """Lines for one frame of the film, from the observables then."""
        return (f"t = {row['t']:7.3f} R/c",)


def distribute(times: list[float], shares: list[float], frames: int) -> Array:
    """Return `frames` times from times[0] to times[-1], of which the share shares[i] lies in times[i]..times[i+1]."""
    marks = np.concatenate([[0.0], np.cumsum(shares)]) / np.sum(shares)
    return np.interp(np.linspace(0.0, 1.0, frames), marks, times)
