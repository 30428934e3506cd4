"""Step a scenario to its end in launches of many steps, restart with a shorter step,
and detect blow-ups."""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil, inf
from time import perf_counter
from typing import Any, Literal

import numpy as np

from taichi_disk import runtime
from taichi_disk.computation.diagnostics import (
    BlowUp,
    EnergyBalance,
    explained,
    gone_through,
    unacceptable,
)
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum
from taichi_disk.computation.step_control import StepControl
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Array
from taichi_disk.simulation.observables import Columns, as_columns, bounds_array
from taichi_disk.simulation.simulation import NEVER, KernelCache, Simulation
from taichi_disk.simulation.stepping import Snapshot

# t [R/c], positions (n, 2) [R], velocities (n, 2) [c]
Moment = tuple[float, Array, Array]
Status = Literal["running", "restarted", "finished", "failed"]

# spring evaluations in one kernel launch: about 50 ms on one core
SPRINGS_PER_LAUNCH = 12_000_000
# spring evaluations between checks of a large lattice (a launch per step)
SPRINGS_PER_CHECK = 25 * SPRINGS_PER_LAUNCH


class Driver:
    """Steps one scenario from t = 0 to its end, and restarts with a shorter step if
    necessary.

    Args:
        scenario, time, spectrum, force: as for `StepControl`.
        kernels: cache of compiled simulations.

    Attributes:
        interval: time between two rows [R/c], of `stride` steps.
        state, row: last valid state, and its observables (columns,).
        status: the last return value of `advance`.
        failure: why there is no result, if the status is "failed".
        end, final: state at the end, and its time, positions and velocities, if the
            status is "finished".
        largest_force: largest force of the wall on one point [M c^2/R], if the status
            is "finished".
        can_end: whether the scene may end or restart.

    Raises InputError if the user's step is beyond the stability limit.
    """

    can_end = True

    def __init__(
        self,
        scenario: Scenario,
        time: Any,
        kernels: KernelCache,
        spectrum: Spectrum,
        *,
        force: bool = False,
    ) -> None:
        self.scenario, self.kernels = scenario, kernels
        self.control = StepControl(scenario, time, spectrum, force)
        self.compile_seconds = 0.0
        self.failure: SimulationError | None = None
        self.end: Snapshot | None = None
        self.status: Status = "running"
        self._bounds = bounds_array(scenario.end_bounds())
        self._begin()

    def _begin(self) -> None:
        scenario, began = self.scenario, perf_counter()
        self.step, self.attempt = self.control.step, self.control.attempt
        self.stride = max(1, round(scenario.row_interval / self.step.dt))
        self.interval = self.stride * self.step.dt
        self.simulation = self._simulation()
        self.compile_seconds += perf_counter() - began
        self._last = ceil(scenario.max_time / self.interval) * self.stride
        self._needed, self._quiet = (
            1 + ceil(scenario.quiet_time / self.interval - 1e-9),
            0,
        )
        springs = (
            SPRINGS_PER_CHECK if self.simulation.subdomains > 1 else SPRINGS_PER_LAUNCH
        )
        self._launch_steps = max(
            1, springs // (len(scenario.lattice.bonds) * self.step.integrator.forces)
        )
        self._rows: Array = np.empty((256, self.simulation.first_row.size))
        self._rows[0], self.count = self.simulation.first_row, 1
        self._balance = EnergyBalance(self.simulation.first_row)
        self.start = self.state = self.simulation.snapshot()
        self.row = self.simulation.first_row

    def _simulation(self) -> Simulation:
        scenario, step = self.scenario, self.step
        return self.kernels.simulation(
            scenario.lattice,
            scenario.model,
            step.integrator,
            scenario.velocities,
            step.dt,
        )

    # ---- results so far

    @property
    def rows(self) -> Array:
        """Observables (rows, columns) of all rows so far, which are `interval` apart in
        time."""
        return self._rows[: self.count]

    @property
    def columns(self) -> Columns:
        return as_columns(self.rows, self.interval)

    # ---- time

    def advance(self, seconds: float = inf, steps: int | None = None) -> Status:
        """Compute up to `steps` steps (default: to the end), for not much longer than
        `seconds` of wall-clock time.

        Returns "running", "restarted" (with a shorter step), "finished" (the scene has
        ended) or "failed" (see `failure`).
        """
        if self.status in ("finished", "failed"):
            return self.status
        self.status, until = "running", perf_counter() + seconds
        last = (
            self._last
            if steps is None
            else min(self._last, self.simulation.step_number + steps)
        )
        while self.simulation.step_number < last:
            self._launch(last)
            if self.status != "running" or perf_counter() >= until:
                break
        if self.status == "running" and self.simulation.step_number >= self._last:
            self._fail(SimulationError(self.scenario.unfinished(self.columns)))
        return self.status

    def _launch(self, last: int) -> None:
        simulation, needed = self.simulation, self._needed if self.can_end else NEVER
        steps = min(self._launch_steps, last - simulation.step_number)
        rows, self._quiet = simulation.advance(
            steps, self.stride, self._bounds, needed, self._quiet
        )
        now, seen, what = simulation.snapshot(), np.vstack([rows, simulation.now]), ""
        if (lost := self._balance.first_lost(seen)) is not None:
            what = self._balance.loss(seen[lost])
        elif gone_through(
            self.scenario.lattice,
            self.scenario.model,
            now.vectors[0],
            self._balance.total,
        ):
            what = "the disk has gone through the surface of the wall"
        self._append(rows[:lost])
        if what:
            self._blown_up(what)
            return
        self.state, self.row = now, simulation.now
        if self.can_end and self._quiet >= self._needed:
            # Use only the rows of the settling time, because this check may run at
            # every row.
            last_rows = self._rows[max(0, self.count - self._needed - 1) : self.count]
            if self.scenario.ended(as_columns(last_rows, self.interval)):
                self._at_end()
            else:
                self._quiet = self._needed - 1

    def _append(self, rows: Array) -> None:
        while self.count + len(rows) > len(self._rows):
            self._rows = np.concatenate([self._rows, np.empty_like(self._rows)])
        self._rows[self.count : self.count + len(rows)] = rows
        self.count += len(rows)

    def __getstate__(self) -> dict[str, Any]:
        return {
            name: value for name, value in vars(self).items() if name != "simulation"
        }

    def replay(self, times: Array) -> Iterator[Moment]:
        """Repeat the last attempt bitwise, and yield the moments at the steps nearest
        to `times` (ascending)."""
        runtime.start()  # another process may have computed the run
        simulation, snapshot = self._simulation(), self.start
        mine, stride = simulation.generation, self._launch_steps
        for number in np.rint(np.asarray(times) / self.step.dt).astype(int):
            # another run has reset the simulation meanwhile
            if simulation.generation != mine:
                simulation = self._simulation()
                simulation.restore(snapshot)
                mine = simulation.generation
            while simulation.step_number < number:
                simulation.advance(
                    min(int(number) - simulation.step_number, stride), stride
                )
            snapshot = simulation.snapshot()
            yield (
                simulation.time,
                simulation.positions(snapshot),
                simulation.velocities(snapshot),
            )

    # ---- finish, restart or fail

    def _at_end(self) -> None:
        columns, simulation, state = self.columns, self.simulation, self.state
        self.largest_force = simulation.peak_point_force(state)
        if self.control.shorten_after_run(self.largest_force, columns):
            self._restart()
            return
        if self.control.time.dt == "auto" and (
            reason := unacceptable(self.scenario, columns)
        ):
            self._fail(SimulationError(reason))
            return
        self.status, self.end = "finished", state
        self.final = (
            simulation.time,
            simulation.positions(state),
            simulation.velocities(state),
        )

    def _blown_up(self, lost: str) -> None:
        simulation = self.simulation
        simulation.restore(self.state)
        if (steps := (self.count - 1) * self.stride - simulation.step_number) > 0:
            simulation.advance(steps, self.stride)
            self.state, self.row = simulation.snapshot(), simulation.now
        largest = simulation.peak_point_force()
        if self.can_end and self.control.shorten_after_blow_up(largest):
            self._restart()
            return
        x, v, t = simulation.positions(), simulation.velocities(), simulation.time
        part = self.step.dt / self.control.limit(self.step.integrator, largest)
        text = (
            f"blow-up after t = {t:.6g} R/c:"
            f" {explained(self.scenario, self.step.dt, part, x, lost)}"
        )
        self._fail(BlowUp(text, {"positions": x, "velocities": v, "t": np.array(t)}))

    def _restart(self) -> None:
        self.status = "restarted"
        self._begin()

    def _fail(self, failure: SimulationError) -> None:
        self.status, self.failure = "failed", failure
