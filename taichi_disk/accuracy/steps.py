"""Work against error: every integrator at several time steps, compared with a reference solution."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.computation.diagnostics import relative_imbalance
from taichi_disk.computation.outcome import Outcome
from taichi_disk.computation.scenario import Scenario
from taichi_disk.computation.stability import Spectrum, step_limit
from taichi_disk.errors import SimulationError
from taichi_disk.integrators import INTEGRATORS, Integrator
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model
from taichi_disk.signals import raise_if_interrupted
from taichi_disk.simulation.observables import as_columns
from taichi_disk.simulation.simulation import KernelCache

FRACTIONS = (0.95, 0.8, 0.6, 0.4, 0.2, 0.1, 0.05)  # of the stability limit
REPEATS = 3
ROWS = 200  # at which the energy is looked at
RTOL = 1e-11  # of the reference


@dataclass(frozen=True)
class StepError:
    """One integrator at one step. Errors are absolute: e is of the order 1, positions are in R.

    Attributes:
        own: whether it is the step that `run` takes.
        fraction: of the stability limit.
        seconds: of all steps, without compilation, the best of REPEATS.
        error: of the primary result.
        trajectory_error: largest of any coordinate at the end [R].
        closing_imbalance, worst_imbalance: of the energy, over the scene's scale.
    """

    integrator: str
    own: bool
    fraction: float
    dt: float  # [R/c]
    steps: int
    seconds: float
    ns_per_spring_and_step: float
    error: float
    trajectory_error: float
    closing_imbalance: float
    worst_imbalance: float


class StepStudy:
    """The runs to be made for one scenario. They end when `outcome`, that of `run`, does."""

    def __init__(self, scenario: Scenario, modes: Spectrum, outcome: Outcome) -> None:
        self.scenario, self.modes, model = scenario, modes, scenario.model
        self.end = float(outcome.columns["t"][-1])
        if model.reset_interval:
            self.end = max(1, round(self.end / model.reset_interval)) * model.reset_interval
        self.own = INTEGRATORS[outcome.summary["integrator"]], self._steps(outcome.summary["dt"] * (1.0 + 1e-9))
        integrators = [one for one in INTEGRATORS.values() if one.takes(model)]
        runs = {(one, self._steps(part * self._limit(one))) for one in integrators for part in FRACTIONS}
        self.runs = sorted({*runs, self.own}, key=lambda run: (run[0].order, run[0].name, run[1]))
        self.reference = Reference(scenario.lattice, model)

    def _limit(self, integrator: Integrator) -> float:
        return step_limit(self.modes, self.scenario.model, integrator, self.scenario.point_force)

    def _steps(self, longest: float) -> int:
        """The fewest steps to the end that are not longer than `longest` [R/c], a whole number to each reset."""
        interval = self.scenario.model.reset_interval or self.end
        return round(self.end / interval) * ceil(interval / longest)

    def seconds(self, run: float) -> float:
        """About how long all will take if the run with the own step takes `run` [s]."""
        integrator, own_steps = self.own
        work = sum(steps * one.forces for one, steps in self.runs) / (own_steps * integrator.forces)
        state = np.concatenate([self.scenario.lattice.positions, self.scenario.velocities]).ravel()
        began = perf_counter()
        self.reference.rate(0.0, state)
        evaluation = perf_counter() - began
        # Force evaluations of DOP853: some 10 for each radian of the fastest vibration, fewer where dashpots bind it.
        springs, interval = self.scenario.model.springs, self.scenario.model.reset_interval
        rate = 9.0 * self.modes.omega + 3.0 * springs.eta * self.modes.damping + (12.0 / interval if interval else 0.0)
        return (1 + REPEATS) * work * run + self.end * rate * evaluation

    def measure(self, kernels: KernelCache, done: Callable[[int], object]) -> list[StepError]:
        """Compute the reference and all runs; `done` gets the number of those that are."""
        scenario, (integrator, steps), found = self.scenario, self.own, []
        x, v = self.reference.solve(scenario.velocities, self.end)
        end = replace(scenario.lattice, positions=x)
        # Where a simulation begins it measures what it is given, as it does for the runs.
        first = kernels.simulation(end, scenario.model, integrator, v, self.end / steps).first_row
        truth = scenario.primary(as_columns(first[None], 0.0))[1]
        for number, (integrator, steps) in enumerate(self.runs):
            done(1 + number)
            found.append(self._measured(kernels, integrator, steps, x, truth))
        return found

    def _measured(self, kernels: KernelCache, integrator: Integrator, steps: int, x: Array, truth: float) -> StepError:
        """`x` (n, 2) [R] and `truth`: positions and primary result at the end of the reference."""
        scenario, dt, stride = self.scenario, self.end / steps, max(1, steps // ROWS)
        simulation = kernels.simulation(scenario.lattice, scenario.model, integrator, scenario.velocities, dt)
        start = simulation.snapshot()
        rows, _ = simulation.advance(steps, stride)
        columns = as_columns(np.vstack([simulation.first_row, rows, simulation.now]), stride * dt)
        closing, worst = relative_imbalance(scenario, columns)
        off = np.abs(simulation.positions() - x).max()
        times = []
        for _ in range(REPEATS):
            simulation.restore(start)
            began = perf_counter()
            simulation.advance(steps, steps)
            times.append(perf_counter() - began)
        return StepError(
            integrator=integrator.name,
            own=(integrator, steps) == self.own,
            fraction=dt / self._limit(integrator),
            dt=dt,
            steps=steps,
            seconds=min(times),
            ns_per_spring_and_step=1e9 * min(times) / steps / len(scenario.lattice.bonds),
            error=abs(scenario.primary(columns)[1] - truth),
            trajectory_error=float(off),
            closing_imbalance=closing,
            worst_imbalance=worst,
        )


class Reference:
    """The motion of a `model` on a `lattice` by SciPy's DOP853 on the laws in NumPy: nothing that the kernels use."""

    def __init__(self, lattice: Lattice, model: Model) -> None:
        self.lattice, self.model = lattice, model

    def solve(self, velocities: Array, end: float, rtol: float = RTOL) -> Array:
        """(2, n, 2): positions and velocities at time `end` [R/c], from the lattice's positions at t = 0.

        Raises SimulationError where SciPy gives up.
        """
        from scipy.integrate import solve_ivp

        stops, interval = [end], self.model.reset_interval
        if interval:
            stops = [*(np.arange(1, int(end / interval * (1 + 1e-12)) + 1) * interval), end]
        t = 0.0
        y: Array = np.concatenate([self.lattice.positions, velocities]).ravel()
        for stop in stops:
            if stop > t:
                # Between resets a step or two do; of a whole motion the end alone is kept.
                how: dict[str, Any] = {"first_step": stop - t} if interval else {"t_eval": [stop]}
                with np.errstate(all="ignore"):  # it tries steps that crush the disk, and takes them back
                    found = solve_ivp(self.rate, (t, stop), y, "DOP853", rtol=rtol, atol=1e-3 * rtol, **how)
                if not found.success:
                    raise SimulationError(f"the reference solution ends before t = {stop:.6g} R/c: {found.message}")
                y, t = np.array(found.y[:, -1]), stop
            if interval and stop is not stops[-1]:
                y.reshape(2, -1, 2)[1, self.lattice.wall_boundary] = 0.0
        return y.reshape(2, -1, 2)

    def rate(self, _t: float, y: Array) -> Array:
        """Velocities and accelerations of the state `y`: x0, y0, x1 ... and the velocities likewise."""
        raise_if_interrupted()
        x, v = y.reshape(2, -1, 2)
        force = self.model.forces_moving(self.lattice, x, v)
        return np.concatenate([v, force / self.lattice.masses[:, None]]).ravel()
