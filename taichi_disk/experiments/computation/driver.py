"""Step a scenario to its end in launches of many steps, and detect blow-ups."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, inf
from time import perf_counter
from typing import Literal, NamedTuple

import numpy as np

from taichi_disk.base import runtime
from taichi_disk.base.errors import SimulationError
from taichi_disk.experiments.computation.diagnostics import (
    BlowUp,
    EnergyBalance,
    LostBalance,
    explained,
    unacceptable,
)
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.computation.stability import TimeStep
from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.simulation.observables import (
    INDEX,
    Columns,
    as_columns,
    bounds_array,
    within,
)
from taichi_disk.mechanics.simulation.simulation import (
    MAX_STEPS,
    NEVER,
    Simulation,
    shared_kernels,
)
from taichi_disk.mechanics.simulation.stepping import Snapshot

Status = Literal["running", "finished", "failed"]

# spring evaluations in one kernel launch: about 50 ms on one core
SPRINGS_PER_LAUNCH = 12_000_000
# spring evaluations between checks of a large lattice (a launch per step)
SPRINGS_PER_CHECK = 25 * SPRINGS_PER_LAUNCH
# part of the remaining time after which the end of a scene is checked again; a rim that
# swings up may have left a little earlier
PART_TO_WAIT = 0.5


class State(NamedTuple):
    """State at time t [R/c]: positions (n, 2) [R], those of the disk first, and
    velocities (n, 2) [c]."""

    t: float
    positions: Array
    velocities: Array


class Driver:
    """One run of a scenario with one time step, from t = 0 to its end or its failure.

    Attributes:
        scenario, step: as given.
        stride: number of steps between two rows.
        interval: time between two rows [R/c].
        last_step: number of the step at which the run fails if it has not ended.
        bounds: (2, columns) smallest and largest values at the end of the scene.
        needed_rows, settled_rows: number of successive rows within `bounds` at the end
            of the scene, and their number so far.
        state: last valid state.
        row: observables (columns,) of `state`.
        balance: energy balance of the rows so far.
        status: the last return value of `advance`.
        failure: why there is no result, if the status is "failed".
        end, final: state at the end, and its time, positions and velocities, if the
            status is "finished".
        largest_force: largest force of the wall on one point [M c^2/R], if the run has
            finished or failed.
        can_end: whether the scene may end.
    """

    can_end = True

    def __init__(self, scenario: Scenario, step: TimeStep) -> None:
        self.scenario = scenario
        self.step = step
        self.stride = max(1, round(scenario.row_interval / step.dt))
        self.interval = self.stride * step.dt
        self.simulation = self._simulation()
        rows_to_limit = ceil(scenario.max_time / self.interval)
        self.last_step = min(rows_to_limit * self.stride, MAX_STEPS)
        self.bounds = bounds_array(scenario.end_bounds())
        self.needed_rows = 1 + ceil(scenario.quiet_time / self.interval - 1e-9)
        self.settled_rows = 0
        self._launch_steps = self._steps_of_a_launch()

        first_row = self.simulation.first_row
        self._rows: Array = np.empty((256, first_row.size))
        self._rows[0] = first_row
        self.count = 1
        self.row = first_row
        self.balance = EnergyBalance(first_row, scenario.model.elastic)
        self.state = self.simulation.snapshot()
        self.status: Status = "running"
        self.failure: SimulationError | None = None
        self.end: Snapshot | None = None
        self.largest_force = 0.0

    def _simulation(self) -> Simulation:
        return shared_kernels().simulation(
            lattice=self.scenario.lattice,
            model=self.scenario.model,
            integrator=self.step.integrator,
            velocities=self.scenario.velocities,
            dt=self.step.dt,
        )

    def _steps_of_a_launch(self) -> int:
        springs = SPRINGS_PER_LAUNCH
        if self.simulation.arrangement.subdomains > 1:
            springs = SPRINGS_PER_CHECK
        springs_of_a_step = (
            len(self.scenario.lattice.bonds) * self.step.integrator.forces
        )
        return max(1, springs // springs_of_a_step)

    # ---- results so far

    @property
    def rows(self) -> Array:
        """Observables (rows, columns) of all rows so far, which are `interval` apart in
        time."""
        return self._rows[: self.count]

    @property
    def columns(self) -> Columns:
        return as_columns(self.rows, self.interval)

    @property
    def has_ended(self) -> bool:
        """Whether the scene has come to its end, with or without a result."""
        return self.status == "finished" or isinstance(self.failure, LostBalance)

    # ---- time

    def advance(self, seconds: float = inf, steps: int = MAX_STEPS) -> Status:
        """Compute up to `steps` steps (default: to the end), for not much longer than
        `seconds` of wall-clock time.

        Returns "running", "finished" (the scene has ended) or "failed" (see `failure`).
        """
        if self.status != "running":
            return self.status
        until = perf_counter() + seconds
        last = min(self.last_step, self.simulation.step_number + steps)
        while self.simulation.step_number < last:
            self._launch(last)
            if self.status != "running" or perf_counter() >= until:
                break
        if self.status == "running" and self.simulation.step_number >= self.last_step:
            self._fail(SimulationError(self.scenario.unfinished(self.columns)))
        return self.status

    def _launch(self, last: int) -> None:
        simulation = self.simulation
        needed = NEVER
        if self.can_end:
            needed = self.needed_rows
        rows, self.settled_rows = simulation.advance(
            steps=min(self._launch_steps, last - simulation.step_number),
            stride=self.stride,
            bounds=self.bounds,
            needed=needed,
            settled=self.settled_rows,
        )
        state = simulation.snapshot()
        new_rows = np.vstack([rows, simulation.now])
        lost = self.balance.first_lost(new_rows)
        self._append(rows[:lost])
        if lost is not None:
            self._blow_up(self.balance.loss(new_rows[lost]))
        else:
            self.state = state
            self.row = simulation.now
            if self.settled_rows >= needed:
                self._end_if_settled()

    def _end_if_settled(self) -> None:
        # Copy only the rows of the settling time, because this check may run at every
        # row.
        last_rows = self.rows[-self.needed_rows - 1 :]
        columns = as_columns(last_rows, self.interval)
        if self.scenario.falls_back:  # to count the bounces
            columns |= zip(INDEX, self.rows.T, strict=True)
        remaining = self.scenario.time_to_end(columns)
        if remaining == 0.0:
            self._finish()
            return
        remaining = min(remaining, self.scenario.max_time)
        rows_to_wait = max(1, int(PART_TO_WAIT * remaining / self.interval))
        # The kernel stops after `rows_to_wait` rows more, as if so many were missing.
        self.settled_rows = self.needed_rows - rows_to_wait

    def _append(self, rows: Array) -> None:
        while self.count + len(rows) > len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self.count : self.count + len(rows)] = rows
        self.count += len(rows)

    def let_go(self) -> None:
        """Forget what only a run that goes on needs."""
        del self.simulation

    def replay(self, times: Array) -> Iterator[State]:
        """Repeat the last attempt bitwise, and yield the states at the steps nearest
        to `times` (ascending)."""
        runtime.start()  # another process may have computed the run
        simulation = self._simulation()
        stride = self._launch_steps
        for number in np.rint(np.asarray(times) / self.step.dt).astype(int):
            while simulation.step_number < number:
                simulation.advance(
                    min(int(number) - simulation.step_number, stride), stride
                )
            snapshot = simulation.snapshot()
            yield State(
                simulation.time,
                simulation.positions(snapshot),
                simulation.velocities(snapshot),
            )

    def back_to(self, state: Snapshot, row: Array) -> None:
        """Continue from an earlier `state` of this attempt and its observables `row`,
        and forget everything later."""
        self.simulation = self._simulation()
        self.simulation.restore(state)
        self.count = 1 + state.step // self.stride
        is_inside = within(self.rows[1:], self.bounds)
        last_outside = np.flatnonzero(is_inside == 0.0).max(initial=-1)
        rows_inside = len(is_inside) - 1 - last_outside
        self.settled_rows = min(rows_inside, self.needed_rows - 1)
        self.balance = EnergyBalance(self.rows[0], self.scenario.model.elastic)
        self.balance.first_lost(self.rows)
        self.state = state
        self.row = row
        self.status = "running"
        self.failure = None
        if self.end and state.step >= self.end.step:
            self.status = "finished"
        else:
            self.end = None

    def pull(self, point: int, target: tuple[float, float]) -> None:
        """Tie a point to the mouse at `target` [R] from now on."""
        jump = self.simulation.set_mouse_target(point, target)
        self.row = self.row.copy()
        self.row[INDEX["load"]] += jump
        self.balance.give(jump)
        self.state = self.simulation.snapshot()

    # ---- finish or fail

    def _finish(self) -> None:
        simulation = self.simulation
        state = self.state
        self.largest_force = simulation.peak_point_force(state)
        if self.scenario.scene.time.dt == "auto":
            reason = unacceptable(self.scenario, self.columns)
            if reason:
                self._fail(LostBalance(reason))
                return
        self.status = "finished"
        self.end = state
        self.final = State(
            simulation.time,
            simulation.positions(state),
            simulation.velocities(state),
        )

    def _blow_up(self, what: str) -> None:
        """Go back to the last valid row, and fail there."""
        simulation = self.simulation
        simulation.restore(self.state)
        steps = (self.count - 1) * self.stride - simulation.step_number
        if steps > 0:
            simulation.advance(steps, self.stride)
            self.state = simulation.snapshot()
            self.row = simulation.now
        self.largest_force = simulation.peak_point_force()
        fraction = self.step.dt / self.step.limit_under(self.largest_force)
        x = simulation.positions()
        v = simulation.velocities()
        reason = explained(self.scenario, self.step.dt, fraction, x, what)
        self._fail(
            BlowUp(
                f"blow-up after t = {simulation.time:.6g} R/c: {reason}",
                {"positions": x, "velocities": v, "t": np.array(simulation.time)},
            )
        )

    def _fail(self, failure: SimulationError) -> None:
        self.status = "failed"
        self.failure = failure
