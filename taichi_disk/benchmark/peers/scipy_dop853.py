"""SciPy's DOP853 on the plain NumPy force, at the loosest tolerance that gives an error of e asked for."""

from __future__ import annotations

from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.benchmark.engine import Engine
from taichi_disk.benchmark.task import Task
from taichi_disk.errors import SimulationError
from taichi_disk.study.reference import Reference

TOLERANCES = tuple(10.0 ** (-0.5 * k) for k in range(2, 20))


class ScipyDop853(Engine):
    """`truth` is e, `error` the largest deviation from it that will do. Raises SimulationError if no tolerance does."""

    def __init__(self, task: Task, truth: float = 0.0, error: float = 1e-5, **options: Any) -> None:
        self._task = task
        self._reference = Reference(task.lattice, task.physics)
        for self._rtol in TOLERANCES:
            self.run()
            if abs(self.restitution() - truth) <= error:
                return
        raise SimulationError(f"no tolerance down to {self._rtol:g} gives e within {error:g}")

    def run(self) -> float:
        task = self._task
        began = perf_counter()
        with np.errstate(all="ignore"):  # at a loose tolerance it tries steps that crush the disk, and takes them back
            state = self._reference.solve(task.velocities[0], task.steps * task.dt, self._rtol)
        seconds = perf_counter() - began
        self._velocities = state[1]
        return seconds

    def restitution(self) -> float:
        return self._task.restitution(self._velocities)
