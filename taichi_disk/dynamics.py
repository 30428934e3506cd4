"""A scene in time: choose the step, simulate, and take the step back if the wall proved harder than estimated."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.model.stability import Spectrum, step_limit
from taichi_disk.outcome import Outcome
from taichi_disk.progress import Progress
from taichi_disk.scene import TimeSection
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import BlowUp, Simulation, imbalance, replay, simulate
from taichi_disk.time_step import TimeStep, choose

MARGIN = 0.95  # of the limit that the measured wall stiffness leaves; an automatic step above it is redone
ATTEMPTS = 8


def move(setup: Setup, time: TimeSection, modes: Spectrum, step: TimeStep, progress: Progress) -> Outcome:
    """Simulate `setup` to its end, beginning with `step`.

    Raises SimulationError when the scene does not end in time, BlowUp when the state becomes meaningless.
    """
    interval = setup.sample_interval if time.sample_interval == "auto" else time.sample_interval
    for attempt in range(1, ATTEMPTS + 1):
        result: Simulation | BlowUp
        try:
            result = simulate(setup, step, interval, progress)
        except BlowUp as failure:
            result = failure
        physics = replace(setup.physics, integrator=step.integrator)
        limit = step_limit(modes, physics, result.peak_point_force)
        if time.dt != "auto" or step.dt <= MARGIN * limit or attempt == ATTEMPTS:
            break
        step = choose(time, setup.physics, modes, 1.5 * result.peak_point_force)
    if isinstance(result, BlowUp):
        raise result
    return _describe(setup, result, limit, attempt)


def _describe(setup: Setup, simulation: Simulation, limit: float, attempts: int) -> Outcome:
    world, columns = simulation.world, simulation.columns
    world.import_state(simulation.end)
    lost = imbalance(columns) / setup.energy_scale(columns)
    energy = {name: float(columns[name][-1]) for name in ("kinetic", "elastic", "wall", "dissipated", "absorbed")}
    facts: dict[str, Any] = {
        "steps": simulation.end.step,
        "dt": simulation.step.dt,
        "dt_limit": limit,
        "attempts": attempts,
        "integrator": simulation.step.integrator,
        "energy": energy
        | {
            "scale": setup.energy_scale(columns),
            "closing_imbalance": float(lost[-1]),
            "worst_imbalance": float(np.abs(lost).max()),
        },
    }

    def snapshots(times: NDArray[np.float64]) -> Iterator[tuple[float, NDArray[np.float64]]]:
        return replay(simulation, times)

    return Outcome(columns, world.positions()[0], world.velocities()[0], snapshots, facts, simulation.compile_seconds)
