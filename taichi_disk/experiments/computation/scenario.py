"""A scene ready to be computed: initial state, forces, end, and results of the time
series. Each kind is a subclass."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from math import inf
from typing import TYPE_CHECKING, Any, ClassVar

from taichi_disk.base.progress import Progress, silent
from taichi_disk.experiments.computation.words import Lines, Numbers, Words as Words
from taichi_disk.mechanics.lattice import Array as Array, Lattice, OwnStart
from taichi_disk.mechanics.simulation.observables import Bounds, Columns as Columns

if TYPE_CHECKING:  # scene files are checked without Taichi
    from taichi_disk.mechanics.physics import Model


@dataclass(frozen=True, kw_only=True, eq=False)
class Scenario(ABC):
    """One scene with its start, ready to be stepped. Nothing changes it afterwards: use
    `dataclasses.replace` for another start, law or limit.

    Attributes:
        scene: the scene from which it was made.
        lattice: lattice at t = 0, in scene coordinates.
        velocities: (n, 2) at t = 0 [c].
        model: all forces.
        point_force: estimate of the largest force of the wall on one point [M c^2/R].
        max_time: time limit [R/c].
        sample_interval: longest time between two rows from which `result` can be found
            [R/c].
        view: (xmin, xmax, ymin, ymax) of the film [R].
        spoke: point to which pictures draw a line from the disk's centre, to show a
            rotation; -1: none.
        wall_step: longest step that resolves the wall [R/c].
        quiet_time: settling time for which rows must stay within `end_bounds` [R/c]; 0:
            one row suffices.
        own: user-supplied lattice and velocities.
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
    wall_step: float = inf
    quiet_time: float = 0.0
    own: OwnStart = field(default=OwnStart())

    # whether the primary result depends on the time step
    step_dependent: ClassVar[bool] = True
    # whether `t` is the fraction of a load, whose equilibria end at the full load
    static: ClassVar[bool] = False
    # whether the disk flies at a wall, so that it can be aimed
    is_thrown: ClassVar[bool] = False

    @property
    def falls_back(self) -> bool:
        """Whether gravity brings the disk back to the wall."""
        return self.is_thrown and self.model.load is not None

    @property
    def stored_scene(self) -> Any:
        """The scene as files hold it: it reads user-supplied points and velocities from
        lattice.npz."""
        return self.own.repeating(self.scene)

    @property
    def row_interval(self) -> float:
        """Time between two computed rows [R/c]: at most `sample_interval`, or less if
        the user asks for it."""
        # The result and the end of a run must not depend on the number of rows that the
        # user wants.
        asked = self.scene.time.sample_interval
        if asked == "auto":
            return self.sample_interval
        return min(asked, self.sample_interval)

    def quasistatic(self, loads: int, progress: Progress = silent) -> Any:
        """Return the `Outcome` of `loads` equilibria under growing loads. Only a
        compression has one."""
        raise NotImplementedError

    # ---- the end

    def end_bounds(self) -> Bounds:
        """Return (smallest, largest) value of columns at the end of the scene; kernels
        stop when all are within."""
        return {}

    def time_to_end(self, columns: Columns) -> float:
        """Return 0 if the scene has ended at the last row, which is within
        `end_bounds`; otherwise about how much later it will [R/c]."""
        return 0.0

    def unfinished(self, columns: Columns) -> str:
        return f"the scene has not ended by t = {columns['t'][-1]:.6g} R/c"

    # ---- the result

    @abstractmethod
    def result(self, columns: Columns) -> Numbers:
        """Return the results from the time series of a finished scene, the primary
        result first."""

    def result_scales(self, columns: Columns) -> Numbers:
        """Return, for each result with an error estimate, the primary one first, its
        approximate error at a relative energy imbalance of 1."""
        return {self.primary(columns)[0]: 1.0}

    def primary(self, columns: Columns) -> tuple[str, float]:
        """Return name and value of the primary result, to which a tolerance applies."""
        return next(iter(self.result(columns).items()))

    def end_truncation_error(self, columns: Columns) -> float:
        """Return how much the primary result would change if a finished scene went on,
        whatever the step."""
        return 0.0

    def energy_scale(self, columns: Columns) -> float:
        """Return the energy by which the imbalance is divided [M c^2]."""
        return self.reference_energy

    @property
    def reference_energy(self) -> float:
        """Energy by which the imbalance is divided before the end is known [M c^2]."""
        return 1.0

    @property
    def sensitivity(self) -> float:
        """Factor by which a relative imbalance may be amplified in the result."""
        return 1.0

    # ---- pictures

    def conclusion(self, columns: Columns) -> str:
        """Return one sentence on what has happened, or "", from the time series of a
        finished scene."""
        return ""

    @property
    @abstractmethod
    def words(self) -> Words:
        """The names of its quantities for films, plots, tables and messages."""

    @abstractmethod
    def motion(self, columns: Columns) -> Array:
        """Return the main curve of the scene (rows,)."""

    def momentary_motion(self, row: Any) -> Any:
        """Return the quantity that `words.momentary` names. `row`: observables, as
        numbers or as arrays (rows,)."""
        return row["com_vy"]

    def continuum(self, columns: Columns) -> Columns:
        """Return predictions of continuum laws for `motion` by the name of the law."""
        return {}

    def quality(self, columns: Columns) -> Array:
        """Return a curve of the run's accuracy (rows,): by default the relative energy
        imbalance."""
        lost = columns["total"] - columns["total"][0]
        return lost / self.energy_scale(columns)

    def caption(self, row: Numbers) -> Lines:
        """Return the changing lines of one picture of a film from its observables."""
        return (time_text(row["t"]),)


def time_text(t: float) -> str:
    return f"t = {minus(t)} R/c"


def minus(value: float, digits: int = 2) -> str:
    """Return a number with a minus sign instead of a hyphen, and without "-0.00"."""
    text = f"{round(value, digits) + 0.0:.{digits}f}"
    return text.replace("-", "\u2212")


def signed(value: float, digits: int = 2) -> str:
    """Return a number like `minus`, with a sign also if it is positive."""
    text = minus(value, digits)
    return f"+{text}" if round(value, digits) > 0.0 else text
