"""What a step costs by the number of points, on one core and on all: it should stay flat, and halve on two.

Beside the explicit step the one that takes dashpots implicitly, whose solver depends on the size.
"""

from __future__ import annotations

import os
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from math import ceil

import numpy as np

from taichi_disk.benchmark.engine import ours
from taichi_disk.benchmark.stopwatch import Timing, in_turn
from taichi_disk.benchmark.task import Task
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build

PART = "size"
POINTS = (1_000, 10_000, 100_000, 1_000_000)
WORK = 6_000_000  # springs times steps of a run: some 20 ms on one core
STEPS = 8  # at least
STRONG = 100  # eta* of the dashpots that are taken implicitly


def measure(repeats: int) -> list[Timing]:
    """Some steps above the rigid wall, with dashpots; each compared with explicit ones, on one core, at that size."""
    cores = os.cpu_count() or 1
    found = []
    with ExitStack() as stack:
        processes = {threads: stack.enter_context(ours(threads=threads)) for threads in sorted({1, cores})}
        for points in POINTS:
            explicit = above_wall(points)
            tasks = {False: explicit, True: with_implicit_dashpots(explicit)}
            cases = [(implicit, threads) for implicit in tasks for threads in processes]
            runs = {
                name_of(points, threads, implicit): partial(
                    processes[threads].run, processes[threads].open(tasks[implicit])
                )
                for implicit, threads in cases
            }
            seconds = in_turn(runs, repeats)
            base = [one / explicit.work for one in seconds[name_of(points, 1)]]
            for (implicit, threads), (name, times) in zip(cases, seconds.items(), strict=True):
                found.append(Timing(PART, name, tasks[implicit].work, times, base, 1, "f64", threads, points))
    return found


def name_of(points: int, threads: int, implicit: bool = False) -> str:
    how = f", eta* = {STRONG} trapezoidal" if implicit else ""
    return f"{points:,} points, {'one core' if threads == 1 else 'all cores'}{how}"


def with_implicit_dashpots(task: Task) -> Task:
    """The same disk with eta* = STRONG, at the step that a run would take: how much there is to solve depends on it."""
    eta = STRONG / task.lattice.disk_points
    physics = replace(task.physics, eta=eta, integrator="trapezoidal")
    return replace(task, physics=physics, dt=5.0 * task.dt)


def above_wall(points: int) -> Task:
    """A disk whose lowest point is 0.05 R above the wall, at some step that is surely stable."""
    setup = build(load_scene("exponential_wall", ["material.eta_star=10", f"lattice.points={points}"]))
    x = setup.lattice.positions - [0.0, setup.lattice.positions[:, 1].min() - 0.05]
    steps = max(STEPS, ceil(WORK / len(setup.lattice.bonds)))
    dt = 0.1 / np.sqrt(points)  # an eighth of the limit of the springs
    return Task(replace(setup.lattice, positions=x), setup.physics, setup.velocities[None], dt, 8.0 * dt, steps)
