"""A scene in time: simulate it, and take an automatic step back where wall or energy prove it too long."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.model.stability import Spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.outcome import Outcome
from taichi_disk.progress import Progress
from taichi_disk.scene import TimeSection
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import BlowUp, Simulation, imbalance, make_world, replay, simulate
from taichi_disk.time_step import TimeStep, choose

MARGIN = 0.95  # of the limit that the measured wall stiffness leaves; an automatic step above it is redone
CLOSING, WORST = 2e-5, 1e-4  # largest imbalance of the energy, at the end and ever, that an automatic step may leave
ATTEMPTS = 8


def move(setup: Setup, time: TimeSection, modes: Spectrum, step: TimeStep, progress: Progress) -> Outcome:
    """Simulate `setup` to its end, beginning with `step`; an automatic step that proves too long is shortened.

    Raises SimulationError when the scene does not end in time, BlowUp when the state becomes meaningless.
    """
    interval = setup.sample_interval if time.sample_interval == "auto" else time.sample_interval
    point_force = setup.point_force
    world: World | None = None
    compile_seconds = 0.0
    for attempt in range(1, ATTEMPTS + 1):
        progress.start("compile", None)
        began = perf_counter()
        world = make_world(setup, step, world)
        compile_seconds += perf_counter() - began
        result: Simulation | BlowUp
        try:
            result = simulate(setup, world, step, interval, progress)
        except BlowUp as failure:
            result = failure
        limit = step_limit(modes, replace(setup.physics, integrator=step.integrator), result.peak_point_force)
        if time.dt != "auto" or attempt == ATTEMPTS:
            break
        if step.dt > MARGIN * limit:
            point_force = 1.5 * result.peak_point_force
        elif isinstance(result, BlowUp):
            time = time.model_copy(update={"safety": 0.5 * time.safety})
        else:
            lost = np.abs(imbalance(result.columns)) / setup.energy_scale(result.columns)
            excess = max(lost[-1] / CLOSING, lost.max() / WORST)
            if excess <= 1.0:
                break
            # Order 2: the error falls with the square of the step.
            time = time.model_copy(update={"safety": time.safety * max(0.25, 0.9 / float(np.sqrt(excess)))})
        step = choose(time, setup.physics, modes, point_force)
    if isinstance(result, BlowUp):
        raise result
    return _describe(setup, result, limit, attempt, compile_seconds)


def _describe(setup: Setup, simulation: Simulation, limit: float, attempts: int, compile_seconds: float) -> Outcome:
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

    return Outcome(columns, world.positions()[0], world.velocities()[0], snapshots, facts, compile_seconds)
