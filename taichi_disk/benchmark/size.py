"""What a step costs by the number of points, on one core and on all: it should stay flat, and halve on two."""

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


def measure(repeats: int) -> list[Timing]:
    """Some steps in contact with the rigid wall, with dashpots; each compared with one core at the same size."""
    cores = os.cpu_count() or 1
    found = []
    with ExitStack() as stack:
        processes = {threads: stack.enter_context(ours(threads=threads)) for threads in sorted({1, cores})}
        for points in POINTS:
            task = in_contact(points)
            runs = {threads: partial(one.run, one.open(task)) for threads, one in processes.items()}
            seconds = in_turn({str(threads): run for threads, run in runs.items()}, repeats)
            base = [one / task.work for one in seconds["1"]]
            found += [
                Timing(
                    PART, name_of(points, threads), task.work, seconds[str(threads)], base, 1, "f64", threads, points
                )
                for threads in processes
            ]
    return found


def name_of(points: int, threads: int) -> str:
    return f"{points:,} points, {'one core' if threads == 1 else 'all cores'}"


def in_contact(points: int) -> Task:
    """A disk whose lowest point is 0.05 R above the wall, at some step that is surely stable."""
    setup = build(load_scene("exponential_wall", ["material.eta_star=10", f"lattice.points={points}"]))
    x = setup.lattice.positions - [0.0, setup.lattice.positions[:, 1].min() - 0.05]
    steps = max(STEPS, ceil(WORK / len(setup.lattice.bonds)))
    dt = 0.1 / np.sqrt(points)  # an eighth of the limit of the springs
    return Task(replace(setup.lattice, positions=x), setup.physics, setup.velocities[None], dt, 8.0 * dt, steps)
