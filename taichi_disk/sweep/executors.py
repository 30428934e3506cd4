"""Compute the points of a sweep in this process, a pool of processes, or a
`concurrent.futures.Executor`."""

from __future__ import annotations

import pickle
import re
from collections.abc import Generator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import suppress
from itertools import groupby, islice
from queue import Empty, SimpleQueue

from taichi_disk import runtime
from taichi_disk.errors import InputError, SimulationError, TaichiDiskError
from taichi_disk.machine import can_start_python, cores
from taichi_disk.processes.pool import Pool
from taichi_disk.scenes import Scene
from taichi_disk.scenes.setup import lattice_key
from taichi_disk.signals import POLL_INTERVAL, raise_if_interrupted
from taichi_disk.sweep.work import (
    PointResult,
    Task,
    compute_points,
    relevant_versions,
)

Scenes = dict[str, Scene]  # scenes by the key of their point
Results = Generator[tuple[str, PointResult], None, None]
Finished = Future[list[PointResult]]

# figure 3 then has 96 tasks of 0.25 s; setting up the lattice takes a tenth of that
SCENES_PER_TASK = 6
LARGE_LATTICE = 2000  # a scene with more points is a task by itself


def ordered(scenes: Scenes) -> Scenes:
    """Sort scenes by lattice, then by key. Keys are hashes, so every section of the
    order is a random sample."""
    lattices = {key: lattice_key(scene) for key, scene in scenes.items()}
    rank = {lattice: k for k, lattice in enumerate(dict.fromkeys(lattices.values()))}
    keys = sorted(scenes, key=lambda key: (rank[lattices[key]], key))
    return {key: scenes[key] for key in keys}


def part_of(part: str, scenes: Scenes) -> Scenes:
    """Return part K of N, written "K/N", of `ordered` scenes; consecutive scenes share
    lattices."""
    number = count = 0
    if re.fullmatch("[0-9]+/[0-9]+", part):
        number, count = map(int, part.split("/"))
    if not 1 <= number <= count:
        raise InputError(
            f"part: must be K/N with 1 <= K <= N, for example 3/16, not {part}"
        )
    first = len(scenes) * (number - 1) // count
    end = len(scenes) * number // count
    return dict(islice(scenes.items(), first, end))


def tasks_of(scenes: Scenes) -> list[list[str]]:
    tasks: list[list[str]] = []
    for _, group in groupby(scenes, lambda key: lattice_key(scenes[key])):
        keys = list(group)
        size = SCENES_PER_TASK
        if scenes[keys[0]].lattice.points > LARGE_LATTICE:
            size = 1
        for first in range(0, len(keys), size):
            tasks.append(keys[first : first + size])
    return tasks


def computed(
    scenes: Scenes, estimate: bool, jobs: int | None, executor: Executor | None
) -> Results:
    """Yield (key, result) of `ordered` scenes as they finish, computed by an executor
    or `jobs` processes.

    Raises InputError if workers have other versions, SimulationError if workers fail.
    """
    tasks = tasks_of(scenes)
    processes = min(jobs or cores(), len(tasks))
    if executor is None and (processes < 2 or not can_start_python()):
        runtime.start()
        yield from zip(scenes, compute_points(scenes.values(), estimate), strict=True)
        return
    try:
        if executor is not None:
            yield from _carried_out(executor, tasks, scenes, estimate)
            return
        with Pool(processes) as pool:
            yield from _carried_out(pool, tasks, scenes, estimate)
    except TaichiDiskError:
        raise
    except ModuleNotFoundError as error:
        package = str(error.name).partition(".")[0]
        raise InputError(
            f"a worker cannot import {package}: install the same packages everywhere"
        ) from None
    except Exception as error:
        raise SimulationError(
            f"the workers failed ({_cause(error)}); finished points are kept: repeat"
            " the command to go on"
        ) from error


def _cause(error: Exception) -> str:
    if isinstance(error, BrokenExecutor):
        return "one died, perhaps for lack of memory: use fewer jobs"
    if isinstance(error, CancelledError):
        return "the scheduler has gone"
    return f"{type(error).__name__}: {error}"


def _carried_out(
    executor: Executor, tasks: list[list[str]], scenes: Scenes, estimate: bool
) -> Results:
    """Yield (key, result) of the scenes of all tasks."""
    versions = relevant_versions()
    finished = SimpleQueue[Finished]()
    futures: dict[Finished, list[str]] = {}
    try:
        for keys in tasks:
            packed = pickle.dumps([scenes[key] for key in keys])
            task = Task(versions=versions, scenes=packed, estimate=estimate)
            future = executor.submit(pickle.loads, pickle.dumps(task))
            futures[future] = keys
            future.add_done_callback(finished.put)
        import taichi_disk.figures.curves  # noqa: F401 (while workers compute)

        for _ in tasks:
            future = _next(finished)
            yield from zip(futures[future], future.result(), strict=True)
    finally:
        for future in futures:
            future.cancel()


def _next(finished: SimpleQueue[Finished]) -> Finished:
    while True:
        raise_if_interrupted()
        with suppress(Empty):
            return finished.get(timeout=POLL_INTERVAL)
