"""Cost and error of every integrator at several time steps, compared with a reference
solution."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import ceil
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.base.errors import SimulationError
from taichi_disk.base.progress import Progress
from taichi_disk.base.signals import raise_if_interrupted
from taichi_disk.experiments.computation.diagnostics import relative_imbalance
from taichi_disk.experiments.computation.outcome import Outcome
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.computation.stability import spectrum, step_limit
from taichi_disk.mechanics.integrators import INTEGRATORS, Integrator
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import Model
from taichi_disk.mechanics.simulation.observables import as_columns
from taichi_disk.mechanics.simulation.simulation import shared_kernels

# steps as fractions of the stability limit
FRACTIONS = (0.95, 0.8, 0.6, 0.4, 0.2, 0.1, 0.05)
REPEATS = 3
ENERGY_SAMPLES = 200  # number of samples of the energy imbalance
REFERENCE_RTOL = 1e-11


@dataclass(frozen=True)
class StepError:
    """Cost and absolute errors of one integrator at one step."""

    integrator: str
    is_default: bool  # whether `run` would choose this step
    fraction: float  # step as a fraction of the stability limit
    dt: float  # [R/c]
    steps: int
    seconds: float  # shortest of REPEATS runs, without compilation
    ns_per_spring_and_step: float
    error: float  # error of the primary result
    trajectory_error: float  # largest error of a coordinate at the end [R]
    # energy imbalance at the end, relative to the energy scale of the scene
    closing_imbalance: float
    # largest energy imbalance, relative to the energy scale of the scene
    worst_imbalance: float


class StepStudy:
    """Runs of one scenario with several integrators and steps, which all end at the
    time at which `outcome` ends."""

    def __init__(self, scenario: Scenario, outcome: Outcome) -> None:
        self.scenario = scenario
        self.spectrum = spectrum(scenario.lattice, scenario.model)
        model = scenario.model
        self.end = outcome.end
        if model.reset_interval:
            self.end = (
                max(1, round(self.end / model.reset_interval)) * model.reset_interval
            )
        self.default = (
            INTEGRATORS[outcome.summary["integrator"]],
            self._steps(outcome.summary["dt"] * (1.0 + 1e-9)),
        )
        runs = {self.default}
        for method in INTEGRATORS.values():
            if method.takes(model):
                limit = self._limit(method)
                runs |= {(method, self._steps(part * limit)) for part in FRACTIONS}
        self.runs = sorted(runs, key=lambda run: (run[0].order, run[0].name, run[1]))

    def _limit(self, integrator: Integrator) -> float:
        return step_limit(
            self.spectrum, self.scenario.model, integrator, self.scenario.point_force
        )

    def _steps(self, longest: float) -> int:
        """Return the smallest number of steps of at most `longest` [R/c] that is a
        multiple of the number of resets."""
        interval = self.scenario.model.reset_interval or self.end
        return round(self.end / interval) * ceil(interval / longest)

    def measure(self, progress: Progress) -> list[StepError]:
        """Compute the reference and all runs."""
        scenario = self.scenario
        integrator, steps = self.default
        errors: list[StepError] = []
        stage = "reference and steps"
        count = 1 + len(self.runs)
        progress(stage, 0, count)
        x, v = reference_state(
            scenario.lattice, scenario.model, scenario.velocities, self.end
        )
        end = replace(scenario.lattice, positions=x)
        # A simulation that starts from the reference solution measures the same
        # observables as in the runs.
        first = (
            shared_kernels()
            .simulation(end, scenario.model, integrator, v, self.end / steps)
            .first_row
        )
        truth = scenario.primary(as_columns(first[None], 0.0))[1]
        for run in self.runs:
            progress(stage, 1 + len(errors), count)
            errors.append(self._measured(*run, x, truth))
        return errors

    def _measured(
        self, integrator: Integrator, steps: int, x: Array, truth: float
    ) -> StepError:
        scenario = self.scenario
        dt = self.end / steps
        stride = max(1, steps // ENERGY_SAMPLES)
        simulation = shared_kernels().simulation(
            scenario.lattice, scenario.model, integrator, scenario.velocities, dt
        )
        start = simulation.snapshot()
        rows, _ = simulation.advance(steps, stride)
        columns = as_columns(
            np.vstack([simulation.first_row, rows, simulation.now]), stride * dt
        )
        closing, worst = relative_imbalance(scenario, columns)
        trajectory_error = float(np.abs(simulation.positions() - x).max())
        times = []
        for _ in range(REPEATS):
            simulation.restore(start)
            started = perf_counter()
            simulation.advance(steps, steps)
            times.append(perf_counter() - started)
        return StepError(
            integrator=integrator.name,
            is_default=(integrator, steps) == self.default,
            fraction=dt / self._limit(integrator),
            dt=dt,
            steps=steps,
            seconds=min(times),
            ns_per_spring_and_step=1e9
            * min(times)
            / steps
            / len(scenario.lattice.bonds),
            error=abs(scenario.primary(columns)[1] - truth),
            trajectory_error=trajectory_error,
            closing_imbalance=closing,
            worst_imbalance=worst,
        )


def reference_state(
    lattice: Lattice,
    model: Model,
    velocities: Array,
    end: float,
    rtol: float = REFERENCE_RTOL,
) -> Array:
    """Return positions and velocities (2, n, 2) at time `end` [R/c], by SciPy's DOP853
    and the laws in NumPy, independent of the Taichi kernels.

    The motion starts from the lattice's positions with `velocities` (n, 2) [c]. Raises
    SimulationError if SciPy fails.
    """
    from scipy.integrate import solve_ivp

    def rate(_t: float, y: Array) -> Array:
        """Return the time derivative of the state `y`: positions x0, y0, x1, … and then
        velocities."""
        raise_if_interrupted()
        x, v = y.reshape(2, -1, 2)
        force = model.forces_moving(lattice, x, v)
        return np.concatenate([v, force / lattice.masses[:, None]]).ravel()

    interval = model.reset_interval
    count = 0
    if interval:
        count = int(end / interval * (1 + 1e-12))  # one at the end counts
    resets = interval * np.arange(1, count + 1)
    t = 0.0
    y = np.concatenate([lattice.positions, velocities]).ravel()
    for stop in [*resets, end]:
        if stop > t:  # `end` may be the last reset
            # only the end of the motion is stored
            options: dict[str, Any] = {"t_eval": [stop]}
            if interval:
                # one or two steps suffice between resets
                options = {"first_step": stop - t}
            # DOP853 rejects trial steps that crush the disk
            with np.errstate(all="ignore"):
                solution = solve_ivp(
                    rate,
                    (t, stop),
                    y,
                    "DOP853",
                    rtol=rtol,
                    atol=1e-3 * rtol,
                    **options,
                )
            if not solution.success:
                raise SimulationError(
                    f"the reference solution ends before t = {stop:.6g} R/c:"
                    f" {solution.message}"
                )
            y = np.array(solution.y[:, -1])
            t = stop
        if stop in resets:
            y.reshape(2, -1, 2)[1, lattice.wall_boundary] = 0.0
    return y.reshape(2, -1, 2)
