"""Time to a restitution within 10^-5, automatic step and integrator; and SciPy's solver to the same error."""

from __future__ import annotations

from functools import partial

from taichi_disk.benchmark.engine import EngineProcess, ours
from taichi_disk.benchmark.peers import SCIPY
from taichi_disk.benchmark.stopwatch import Timing, in_turn
from taichi_disk.benchmark.task import Task, impact
from taichi_disk.study.reference import Reference, cached_solution

PART = "solution"
ETAS = (0, 10, 100)
SINGLE_PRECISION = "eta* = 0, f32"
SOLVER = "SciPy DOP853 on NumPy, eta* = 0"


def measure(repeats: int) -> tuple[list[Timing], float]:
    """Timings of whole impacts, and how long the undamped step is, as a fraction of the stability limit.

    Errors are those of e against DOP853 at a relative tolerance of 10^-11 (kept, see `accuracy`).
    """
    tasks = {eta_star: impact("exponential_wall", f"material.eta_star={eta_star}") for eta_star in ETAS}
    truths = {eta_star: _truth(task) for eta_star, task in tasks.items()}
    runs, errors = {}, {}
    with ours() as double, ours("f32") as single, EngineProcess(SCIPY) as scipy:
        for eta_star, task in tasks.items():
            name = f"eta* = {eta_star:g}, {task.physics.integrator}, {task.steps:,} steps"
            number = double.open(task)
            runs[name] = partial(double.run, number)
            errors[name] = abs(double.restitution(number) - truths[eta_star])
        single.open(tasks[0])
        scipy.open(tasks[0], truth=truths[0], error=next(iter(errors.values())))
        for name, process in ((SINGLE_PRECISION, single), (SOLVER, scipy)):
            runs[name] = partial(process.run, 0)
            errors[name] = abs(process.restitution(0) - truths[0])
        seconds = in_turn(runs, repeats)
    base = next(iter(seconds.values()))
    timings = [Timing(PART, name, 1, times, base, error=errors[name]) for name, times in seconds.items()]
    return timings, tasks[0].dt / tasks[0].limit


def _truth(task: Task) -> float:
    end = cached_solution(Reference(task.lattice, task.physics), task.velocities[0], task.steps * task.dt)
    return task.restitution(end[1])
