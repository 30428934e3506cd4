"""This program as an engine."""

from __future__ import annotations

from typing import Any

from taichi_disk.benchmark.engine import Engine
from taichi_disk.benchmark.stopwatch import seconds_to_advance
from taichi_disk.benchmark.task import Task
from taichi_disk.model import runtime
from taichi_disk.model.world import World


class Ours(Engine):
    """The stepping kernel, all steps in one launch, with its energy ledger."""

    @classmethod
    def begin(cls, **options: Any) -> None:
        runtime.start("cpu", **options)

    def __init__(self, task: Task, **options: Any) -> None:
        self._task = task
        self._world = World(task.lattice, task.physics, task.velocities, task.dt)
        self._world.advance(0)
        self._start = self._world.export_state()

    def run(self) -> float:
        return seconds_to_advance(self._world, self._start, self._task.steps)

    def restitution(self) -> float:
        return self._task.restitution(self._world.velocities()[0])
