"""What a step costs in a sweep: every core steps lanes of its own."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from time import perf_counter

from taichi_disk.benchmark.engine import EngineProcess, ours
from taichi_disk.benchmark.stopwatch import Timing, in_turn
from taichi_disk.benchmark.task import impact
from taichi_disk.model.runtime import Precision

PART = "sweep"
LANES = (1, 4, 8, 16)  # in each process
PRECISIONS: tuple[Precision, ...] = ("f64", "f32")


def name_of(lanes: int, precision: Precision, cores: str) -> str:
    return f"{lanes:2} lane{'s' * (lanes > 1)}, {precision}, {cores}"


def measure(repeats: int) -> list[Timing]:
    """One process at work, and one for each core at the same time; compared with one lane in f64 on one core."""
    single = impact("exponential_wall", "material.eta_star=10", "time.integrator=velocity_verlet")
    tasks = {lanes: single.in_lanes(lanes) for lanes in LANES}
    crews = {"one core": 1, "all cores": os.cpu_count() or 1}
    cases = [(lanes, precision, crew) for precision in PRECISIONS for lanes in LANES for crew in crews]
    with ExitStack() as stack:
        processes = {
            precision: [stack.enter_context(ours(precision)) for _ in range(crews["all cores"])]
            for precision in PRECISIONS
        }
        for precision in PRECISIONS:
            for task in tasks.values():
                for process in processes[precision]:
                    process.open(task)
        runs = {
            name_of(lanes, precision, crew): partial(_together, processes[precision][: crews[crew]], LANES.index(lanes))
            for lanes, precision, crew in cases
        }
        seconds = in_turn(runs, repeats)
    base = [one / single.work for one in next(iter(seconds.values()))]
    return [
        Timing(
            part=PART,
            name=name_of(lanes, precision, crew),
            work=tasks[lanes].work * crews[crew],
            seconds=seconds[name_of(lanes, precision, crew)],
            base=base,
            lanes=lanes,
            precision=precision,
            threads=crews[crew],
        )
        for lanes, precision, crew in cases
    ]


def _together(processes: Sequence[EngineProcess], number: int) -> float:
    began = perf_counter()
    for process in processes:
        process.start(number)
    for process in processes:
        process.finish()
    return perf_counter() - began
