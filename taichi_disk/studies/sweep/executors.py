"""Compute the points of a sweep: here, by processes of this machine, or by an executor
of somebody else."""

from __future__ import annotations

import pickle
import re
from collections.abc import Generator, Iterator
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from importlib import import_module
from itertools import groupby, islice
from queue import Empty, SimpleQueue
from typing import Any

from taichi_disk.base import runtime
from taichi_disk.base.errors import (
    NOTICES,
    InputError,
    SimulationError,
    TaichiDiskError,
    described,
    pip_install,
)
from taichi_disk.base.machine import can_start_python, cores
from taichi_disk.base.processes.pool import Pool, awaited
from taichi_disk.base.signals import POLL_INTERVAL, raise_if_interrupted
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.setup import lattice_key
from taichi_disk.studies.sweep.work import (
    PointResult,
    check_versions,
    compute_points,
    compute_task,
    relevant_versions,
    start_worker,
)

Scenes = dict[str, Scene]  # scenes by the key of their point
Results = Generator[tuple[str, PointResult], None, None]
Finished = Future[list[PointResult]]

# figure 3 then has 96 tasks of 0.25 s; setting up the lattice takes a tenth of that
SCENES_PER_TASK = 6
LARGE_LATTICE = 2000  # a scene with more points is a task by itself
# of the figure and its fits, 0.5 s in all
SLOW_IMPORTS = (
    "taichi_disk.studies.figures.drawing",
    "scipy.integrate",
    "scipy.interpolate",
)
CONNECT_TIMEOUT = 8.0  # how long a Dask scheduler may take to answer [s]


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
    tasks = []
    for _, group in groupby(scenes, lambda key: lattice_key(scenes[key])):
        keys = list(group)
        size = SCENES_PER_TASK
        if _is_large(scenes[keys[0]]):
            size = 1
        for first in range(0, len(keys), size):
            tasks.append(keys[first : first + size])
    return tasks


def _is_large(scene: Scene) -> bool:
    return scene.lattice.points > LARGE_LATTICE


def executor_for(
    asked: Any, scenes: Scenes, jobs: int | None, stack: ExitStack
) -> Executor | None:
    """Return the executor that computes `scenes`, or None if this process does it
    alone. `stack` closes what is opened here.

    asked: an executor, a client of Dask, the address of a Dask scheduler, or None for
        `jobs` processes of this machine.
    """
    if isinstance(asked, str):
        asked = stack.enter_context(_client(asked))
    if hasattr(asked, "get_executor"):
        _check_workers(asked)
        return asked.get_executor()
    if asked is not None:
        if not isinstance(asked, Executor):
            raise InputError(
                "executor: must be an executor of concurrent.futures, a client of Dask"
                f" or the address of its scheduler, not {asked!r:.60}"
            )
        return asked
    processes = min(jobs or cores(), len(tasks_of(scenes)))
    if processes < 2 or not can_start_python():
        return None
    return stack.enter_context(Pool(processes - _computes_here(scenes)))


def _computes_here(scenes: Scenes) -> bool:
    """Return whether this process computes beside its pool: only short tasks, because
    it stores nothing meanwhile."""
    return not any(map(_is_large, scenes.values()))


@contextmanager
def _client(address: str) -> Iterator[Any]:
    """Open a client of the Dask scheduler at `address`. Raises InputError if none
    answers."""
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            f"Dask needs the package distributed: {pip_install('distributed')}"
        ) from None
    NOTICES.info(f"waiting for the Dask scheduler at {address}")
    connect = partial(Client, address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    try:
        # a server of another kind that says nothing lets it wait for ever
        client = awaited(connect, 2.0 * CONNECT_TIMEOUT)
    except Exception as error:  # a server of another kind may answer anything
        raise InputError(
            f"no Dask scheduler answers at {address} ({error!r:.100}); start one with"
            " `dask scheduler`"
        ) from None
    with client:
        yield client


def _check_workers(client: Any) -> None:
    """Raise InputError if a worker of Dask has other versions, or lacks this package:
    it would close itself without a word."""
    try:
        installed = awaited(partial(client.run, relevant_versions))
    except Exception as error:
        raise InputError(
            f"a worker cannot import this package ({error}): install the same packages"
            " everywhere"
        ) from None
    for worker, versions in installed.items():
        check_versions(worker, versions, relevant_versions())
    NOTICES.info(
        f"{len(installed)} Dask workers, each of which computes one scene at a time;"
        " while there are none, the sweep waits"
    )


def computed(scenes: Scenes, estimate: bool, executor: Executor | None) -> Results:
    """Yield (key, result) of `ordered` scenes as they finish.

    Raises InputError if workers have other versions, SimulationError if workers fail.
    """
    if not scenes:
        return
    if executor is None:
        runtime.start()
        yield from _here(scenes, list(scenes), estimate)
        return
    try:
        yield from _carried_out(executor, scenes, estimate)
    except TaichiDiskError:
        raise
    except Exception as error:
        raise SimulationError(
            f"the workers failed ({_cause(error)}); finished points are kept: repeat"
            " the command to go on"
        ) from error


def _here(scenes: Scenes, keys: list[str], estimate: bool) -> Results:
    results = compute_points([scenes[key] for key in keys], estimate)
    yield from zip(keys, results, strict=True)


def _cause(error: Exception) -> str:
    if isinstance(error, BrokenExecutor):
        return "one died, perhaps for lack of memory: use fewer jobs"
    if isinstance(error, CancelledError):
        return "the scheduler has gone"
    return described(error)


def _carried_out(executor: Executor, scenes: Scenes, estimate: bool) -> Results:
    """Yield (key, result) of the scenes of all tasks."""
    versions = relevant_versions()
    finished = SimpleQueue[Finished]()
    futures = {}
    try:
        for keys in tasks_of(scenes):
            # pickled here, because a worker of other versions could not unpickle them
            packed = pickle.dumps([scenes[key] for key in keys])
            future = executor.submit(compute_task, versions, packed, estimate)
            futures[future] = keys
            future.add_done_callback(finished.put)
        for_this_process = []
        if isinstance(executor, Pool):
            for name in SLOW_IMPORTS:  # the others compute meanwhile
                import_module(name)
            if _computes_here(scenes):
                start_worker()
                for_this_process = list(futures)
        for _ in range(len(futures)):
            if for_this_process and finished.empty():
                last = for_this_process.pop()
                if last.cancel():  # no process has begun it
                    yield from _here(scenes, futures.pop(last), estimate)
            future = _next(finished)
            if future in futures:
                yield from zip(futures[future], future.result(), strict=True)
    finally:
        for future in futures:
            future.cancel()


def _next(finished: SimpleQueue[Finished]) -> Finished:
    while True:
        raise_if_interrupted()
        with suppress(Empty):
            return finished.get(timeout=POLL_INTERVAL)
