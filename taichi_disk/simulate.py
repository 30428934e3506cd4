"""Stepping a scene to its end, chunk by chunk, and looking at what comes out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError
from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.storage import State
from taichi_disk.model.sums import PEAK
from taichi_disk.model.world import World
from taichi_disk.progress import Progress
from taichi_disk.scenes.setup import Columns, Setup
from taichi_disk.time_step import TimeStep

SPRINGS_PER_LAUNCH = 3_000_000  # spring evaluations in one kernel launch: about 15 ms on one core
BLOW_UP = 0.1  # imbalance of the energy, relative to the largest energy so far, that ends a run


class BlowUp(SimulationError):
    """The state became meaningless.

    `last_good` holds positions and velocities (n, 2) and the time of the last state that was still good.
    """

    def __init__(self, message: str, world: World, state: State) -> None:
        super().__init__(message)
        world.import_state(state)
        self.peak_point_force = float(state.sums[PEAK].max())
        self.last_good = {
            "positions": world.positions()[0],
            "velocities": world.velocities()[0],
            "t": np.array(world.time),
        }


@dataclass(frozen=True)
class Simulation:
    """A scene that has ended: its time series, its world, and the states of that world at start and end."""

    world: World
    step: TimeStep
    start: State
    end: State
    columns: Columns

    @property
    def peak_point_force(self) -> float:
        """Largest force of the wall on one point during the run [M c^2/R]."""
        return float(self.end.sums[PEAK].max())


def make_world(setup: Setup, step: TimeStep, earlier: World | None = None) -> World:
    """`setup` at t = 0, compiled; in the fields and with the kernels of an `earlier` world where that can be."""
    arguments = setup.lattice, replace(setup.physics, integrator=step.integrator), setup.velocities[None], step.dt
    if earlier is not None and earlier.restart(*arguments):
        return earlier
    world = World(*arguments)
    world.advance(0)
    return world


def simulate(setup: Setup, world: World, step: TimeStep, interval: float, progress: Progress) -> Simulation:
    """Step `setup`, fresh in `world`, until it has ended, taking a row of observables about every `interval` [R/c].

    Raises SimulationError when `max_time` comes first, BlowUp when the energy balance or a number is lost.
    """
    start = world.export_state()
    stride = max(1, round(interval / step.dt))
    last = ceil(setup.max_time / (stride * step.dt))  # number of the last row
    launch = max(1, SPRINGS_PER_LAUNCH // len(setup.lattice.bonds))  # steps
    rows = world.first_row[None, :, 0]
    progress.start("simulate", setup.max_time)
    while True:
        good, known = world.export_state(), len(rows)
        if known > last:
            raise SimulationError(setup.unfinished(as_columns(rows, step.dt, stride)))
        rows = np.concatenate([rows, _advance(world, launch, stride, last + 1 - known)])
        columns = as_columns(rows, step.dt, stride)
        if problem := blown_up(columns, known):
            message = f"{problem}, {_where(world)}; {_advice(step)}"
            raise BlowUp(message, world, good)
        over = np.flatnonzero(setup.ended(columns)[known:])
        if len(over):
            # The launch went past the end: go back, and stop there.
            count = known + int(over[0]) + 1
            world.import_state(good)
            _steps(world, (count - known) * stride, launch)
            columns = as_columns(rows[:count], step.dt, stride)
            return Simulation(world, step, start, world.export_state(), columns)
        progress.update(world.time)


def _advance(world: World, launch: int, stride: int, most: int) -> NDArray[np.float64]:
    """About `launch` steps, at least one row and no more than `most`; (rows, columns)."""
    if stride > launch:
        return _steps(world, stride, launch)
    return world.advance(min(launch // stride, most), stride)[:, :, 0]


def _steps(world: World, steps: int, launch: int) -> NDArray[np.float64]:
    """`steps` steps in launches short enough for Ctrl-C to be heard; the last row, (1, columns)."""
    while True:
        part = min(steps, launch)
        row = world.advance(1, part)[:, :, 0]
        steps -= part
        if steps == 0:
            return row


def as_columns(rows: NDArray[np.float64], dt: float, stride: int) -> Columns:
    """Name the columns of `rows` (rows, columns), the first at t = 0, and add time and total energy."""
    columns: Columns = {"t": np.arange(len(rows), dtype=np.float64) * (stride * dt)}
    columns.update({name: rows[:, k].copy() for k, name in enumerate(COLUMNS)})
    columns["total"] = np.sum(
        [columns[name] for name in ("kinetic", "elastic", "wall", "dissipated", "absorbed", "sliding", "load")], axis=0
    )
    return columns


def imbalance(columns: Columns) -> NDArray[np.float64]:
    """Deviation of the total energy from its value at t = 0, (rows,) [M c^2]."""
    return columns["total"] - columns["total"][0]


def blown_up(columns: Columns, first: int) -> str | None:
    """What is wrong with the rows from `first` on, or None."""
    energy = np.abs(columns["kinetic"]) + np.abs(columns["elastic"]) + np.abs(columns["wall"])
    scale = np.maximum.accumulate(energy + np.abs(columns["load"] - columns["load"][0]))
    with np.errstate(invalid="ignore"):
        bad = ~(np.abs(imbalance(columns)) <= BLOW_UP * scale + 1e-300)
    bad[:first] = False
    if not bad.any():
        return None
    k = int(np.flatnonzero(bad)[0])
    t0, t1 = columns["t"][max(k - 1, 0)], columns["t"][k]
    what = "a number is no longer finite" if not np.isfinite(columns["total"][k]) else "the energy balance is lost"
    return f"blow-up between t = {t0:.6g} and {t1:.6g} R/c: {what}"


def _where(world: World) -> str:
    """The point or spring in which the state of `world` is worst."""
    x, lattice = world.positions()[0], world.lattice
    lost = np.flatnonzero(~np.isfinite(x).all(axis=1))
    if len(lost):
        return f"{len(lost)} of {len(x)} points have no position, among them point {lost[0]}"
    i, j = lattice.bonds.T
    strain = np.hypot(*(x[i] - x[j]).T) / lattice.rest_lengths - 1.0
    worst = int(np.abs(strain).argmax())
    return f"spring {worst} between points {i[worst]} and {j[worst]} strained by {strain[worst]:+.3g}"


def _advice(step: TimeStep) -> str:
    if step.dt > step.limit:
        return f"the step {step.dt:.6g} R/c is beyond the stability limit {step.limit:.6g} R/c; set time.dt: auto"
    return f"the step is {step.dt / step.limit:.2f} of the stability limit; try a smaller time.safety or a lower speed"


def replay(
    simulation: Simulation, times: NDArray[np.float64]
) -> Iterator[tuple[float, NDArray[np.float64], NDArray[np.float64]]]:
    """Run again from the start and stop at the steps nearest to `times` (ascending).

    Yields (t, positions (n, 2), velocities (n, 2)).
    """
    world = simulation.world
    launch = max(1, SPRINGS_PER_LAUNCH // len(world.lattice.bonds))
    world.import_state(simulation.start)
    for number in np.rint(times / world.dt).astype(int):
        if number > world.step_number:
            _steps(world, int(number) - world.step_number, launch)
        yield world.time, world.positions()[0], world.velocities()[0]
