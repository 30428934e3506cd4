"""Stepping a scene to its end, chunk by chunk, and looking at what comes out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from numpy.typing import NDArray

from taichi_disk.diagnosis import Diagnosis, diagnose, gone_through
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice
from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Physics
from taichi_disk.model.storage import State
from taichi_disk.model.sums import PEAK
from taichi_disk.model.world import World
from taichi_disk.progress import Progress
from taichi_disk.scenes.setup import Columns, Setup
from taichi_disk.time_step import TimeStep

SPRINGS_PER_LAUNCH = 3_000_000  # spring evaluations in one kernel launch: about 15 ms on one core
ENERGIES = [COLUMNS.index(name) for name in ("kinetic", "elastic", "wall", "dissipated", "absorbed", "sliding", "load")]
SPRINGS_BETWEEN_LOOKS = 100 * SPRINGS_PER_LAUNCH  # of a large lattice, whose launches are short by themselves
BLOW_UP = 0.1  # imbalance of the energy, relative to the largest energy so far, that ends a run

SLID = "points that slid along the elastic wall's springs have changed the energy by a tenth"


class BlowUp(SimulationError):
    """The state became meaningless.

    `last_good` holds positions and velocities (n, 2) and the time of the last state that was still good; `stubborn`
    says that a shorter step seldom mends it.
    """

    def __init__(self, message: str, world: World, state: State, stubborn: bool = False) -> None:
        super().__init__(message)
        world.import_state(state)
        self.stubborn = stubborn
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
    start = good = world.export_state()
    stride = max(1, round(interval / step.dt))
    last = ceil(setup.max_time / (stride * step.dt))  # number of the last row
    launch = _launch(world)
    rows = world.first_row[None, :, 0]
    progress.start("simulate", setup.max_time)
    while True:
        now, known = world.export_state(), len(rows)
        good = _checked(setup, world, now, good, float(rows[0, ENERGIES].sum()))
        if known > last:
            raise SimulationError(setup.unfinished(as_columns(rows, step.dt, stride)))
        rows = np.concatenate([rows, _advance(world, launch, stride, last + 1 - known)])
        columns = as_columns(rows, step.dt, stride)
        if (lost := first_lost(columns, known)) is not None:
            world.import_state(good)
            _steps(world, (lost - known) * stride, launch)
            raise _trace(setup, world, step, columns, lost, stride)
        over = np.flatnonzero(setup.ended(columns)[known:])
        if len(over):
            # The launch went past the end: go back, and stop there.
            count = known + int(over[0]) + 1
            world.import_state(good)
            _steps(world, (count - known) * stride, launch)
            columns = as_columns(rows[:count], step.dt, stride)
            _checked(setup, world, world.export_state(), good, float(columns["total"][0]))
            return Simulation(world, step, start, world.export_state(), columns)
        progress.update(world.time)


def _launch(world: World) -> int:
    """Steps to ask a world for at once: so few that Ctrl-C is heard soon."""
    springs = SPRINGS_PER_LAUNCH if world.chunks == 1 else SPRINGS_BETWEEN_LOOKS
    return max(1, springs // len(world.lattice.bonds))


def _advance(world: World, launch: int, stride: int, most: int) -> NDArray[np.float64]:
    """About `launch` steps, at least one row and no more than `most`; (rows, columns)."""
    if stride > launch:
        return _steps(world, stride, launch)
    return world.advance(min(launch // stride, most), stride)[:, :, 0]


def _steps(world: World, steps: int, launch: int) -> NDArray[np.float64]:
    """`steps` steps in launches short enough for Ctrl-C to be heard; the last row, (1, columns), none of no steps."""
    row = np.zeros((0, len(COLUMNS)))
    while steps:
        part = min(steps, launch)
        row = world.advance(1, part)[:, :, 0]
        steps -= part
    return row


def as_columns(rows: NDArray[np.float64], dt: float, stride: int) -> Columns:
    """Name the columns of `rows` (rows, columns), the first at t = 0, and add time and total energy."""
    columns: Columns = {"t": np.arange(len(rows), dtype=np.float64) * (stride * dt)}
    columns.update({name: rows[:, k].copy() for k, name in enumerate(COLUMNS)})
    with np.errstate(invalid="ignore"):  # after a blow-up there may be infinite energies of both signs
        columns["total"] = rows[:, ENERGIES].sum(axis=1)
    return columns


def imbalance(columns: Columns) -> NDArray[np.float64]:
    """Deviation of the total energy from its value at t = 0, (rows,) [M c^2]."""
    return columns["total"] - columns["total"][0]


def first_lost(columns: Columns, first: int) -> int | None:
    """The first row from `first` on at which the energy balance, or a number, is lost; None where none is."""
    energy = np.abs(columns["kinetic"]) + np.abs(columns["elastic"]) + np.abs(columns["wall"])
    scale = np.maximum.accumulate(energy + np.abs(columns["load"] - columns["load"][0]))
    with np.errstate(invalid="ignore"):
        lost = np.maximum(np.abs(imbalance(columns)), np.abs(columns["sliding"] - columns["sliding"][0]))
        bad = ~((lost <= BLOW_UP * scale + 1e-300) & (lost < np.inf))  # a wall met too deep holds infinite energy
    bad[:first] = False
    return int(bad.argmax()) if bad.any() else None


def blown_up(
    lattice: Lattice, physics: Physics, columns: Columns, first: int, x: NDArray[np.float64] | None
) -> Diagnosis | None:
    """What is wrong with the rows from `first` on, or with the positions (n, 2) that there are now, if they are given.

    The same that `simulate` looks for, which then finds the step, and the cause from that.
    """
    if (k := first_lost(columns, first)) is not None:
        t0, t1, what = columns["t"][max(k - 1, 0)], columns["t"][k], _what(columns, k)
        cause = f"blow-up between t = {t0:.6g} and {t1:.6g} R/c: {what}"
        return Diagnosis(cause, "set time.dt: auto", stubborn=what == SLID)
    return None if x is None else gone_through(lattice, physics, x, float(columns["total"][0]))


def _what(columns: Columns, row: int) -> str:
    if not np.isfinite(columns["total"][row]):
        return "a number is no longer finite"
    if abs(imbalance(columns)[row]) > abs(columns["sliding"][row]):
        return "the energy balance is lost"
    return SLID


def _checked(setup: Setup, world: World, now: State, good: State, energy: float) -> State:
    """The state `now` of `world`, if it is a good one; else raises BlowUp, with `good` as the last that was."""
    when = f"blow-up by step {now.step:,}, t = {world.time:.6g} R/c"
    lost = np.flatnonzero(~np.isfinite(now.vectors).all(axis=(0, 2, 3)))
    if len(lost):
        message = (
            f"{when}: {len(lost)} of {len(now.vectors[0])} points have no finite state, among them point {lost[0]}"
        )
        message += "; what was computed before this step is good: the state was changed since"
        raise BlowUp(message, world, good, stubborn=True)
    if through := gone_through(setup.lattice, setup.physics, world.places(now)[0], energy):
        raise BlowUp(f"{when}: {through.cause}; {through.remedy}", world, good, through.stubborn)
    return now


def _trace(setup: Setup, world: World, step: TimeStep, columns: Columns, row: int, stride: int) -> BlowUp:
    """The blow-up before `row`, found to the step; `world` stands at the row before."""
    known = {name: values[:row] for name, values in columns.items()}
    total = float(columns["total"][row - 1] - columns["sliding"][row - 1])
    for _ in range(stride):
        good = world.export_state()
        after = as_columns(world.advance(1, 1)[:, :, 0], step.dt, 1)
        gained = float(after["total"][0] - after["sliding"][0]) - total
        trial = {name: np.concatenate([values, after[name]]) for name, values in known.items()}
        if first_lost(trial, row) is not None:
            break
        total += gained
    else:
        message = f"blow-up between t = {columns['t'][row - 1]:.6g} and {columns['t'][row]:.6g} R/c: "
        message += f"{_what(columns, row)}; computed again, it is not: the state was changed, or the machine errs"
        return BlowUp(message, world, world.export_state())
    before, now = world.places(good)[0], world.positions()[0]
    physics = replace(setup.physics, integrator=step.integrator)
    found: Diagnosis | None = gone_through(setup.lattice, physics, before, float(columns["total"][0]))
    found = found or diagnose(setup.lattice, physics, step.dt, step.limit, before, now, gained)
    remedy = found.remedy
    if setup.scene.time.dt != "auto" and "auto" not in remedy:
        remedy = f"set time.dt: auto; if that fails too, {remedy}"
    message = (
        f"blow-up at step {world.step_number:,}, t = {world.time:.6g} R/c: {_what(trial, row)}, "
        f"{_where(world, now)}. Likely cause: {found.cause}. Remedy: {remedy}"
    )
    return BlowUp(message, world, good, found.stubborn)


def _where(world: World, x: NDArray[np.float64]) -> str:
    """The point or spring in which the state is worst."""
    lattice = world.lattice
    lost = np.flatnonzero(~np.isfinite(x).all(axis=1))
    if len(lost):
        return f"{len(lost)} of {len(x)} points have no position, among them point {lost[0]}"
    i, j = lattice.bonds.T
    strain = np.hypot(*(x[i] - x[j]).T) / lattice.rest_lengths - 1.0
    worst = int(np.abs(strain).argmax())
    return f"spring {worst} between points {i[worst]} and {j[worst]} strained by {strain[worst]:+.3g}"


def replay(
    simulation: Simulation, times: NDArray[np.float64]
) -> Iterator[tuple[float, NDArray[np.float64], NDArray[np.float64]]]:
    """Run again from the start and stop at the steps nearest to `times` (ascending).

    Yields (t, positions (n, 2), velocities (n, 2)).
    """
    world = simulation.world
    launch = _launch(world)
    world.import_state(simulation.start)
    for number in np.rint(times / world.dt).astype(int):
        if number > world.step_number:
            _steps(world, int(number) - world.step_number, launch)
        yield world.time, world.positions()[0], world.velocities()[0]
