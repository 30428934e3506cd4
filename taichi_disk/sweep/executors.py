"""Who computes the points of a sweep: this process, a pool of processes, or any `concurrent.futures.Executor`."""

from __future__ import annotations

import asyncio
import multiprocessing
import os
import pickle
import threading
from collections.abc import Callable, Generator, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor, ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from itertools import groupby
from multiprocessing.connection import Connection
from queue import Empty, SimpleQueue
from typing import Any

from taichi_disk import runtime
from taichi_disk.errors import InputError, SimulationError, TaichiDiskError, pip_install
from taichi_disk.machine import cores
from taichi_disk.scenes import Scene
from taichi_disk.scenes.setup import lattice_key
from taichi_disk.signals import ignored_by_children, raise_if_interrupted
from taichi_disk.sweep.work import PointResult, compute_points, compute_task, relevant_versions

Scenes = dict[str, Scene]  # by key
Results = Generator[tuple[str, PointResult], None, None]
Finished = Future[list[PointResult]]
Say = Callable[[str], None]

SCENES_PER_TASK = 6  # figure 3: 96 tasks of a quarter of a second; to set up a lattice takes a tenth
LARGE = 2000  # points, from which a scene takes a task of its own
POLL = 0.2  # [s] between two looks for an interrupt, while workers compute
CONNECT = 8.0  # seconds within which a scheduler has to answer


def ordered(scenes: Scenes) -> Scenes:
    """Lattice by lattice, and within a lattice in the order of the keys, which is any: a part is like the whole."""
    lattices: dict[object, list[str]] = {}
    for key, scene in scenes.items():
        lattices.setdefault(lattice_key(scene), []).append(key)
    return {key: scenes[key] for keys in lattices.values() for key in sorted(keys)}


def part_of(part: str, scenes: Scenes) -> Scenes:
    """The scenes of `part`, written K/N, out of `ordered` ones: neighbours, so that it sets up few lattices."""
    k, _, n = part.partition("/")
    if not (k.isdecimal() and n.isdecimal() and 1 <= int(k) <= int(n) <= 1_000_000):
        raise InputError(f"--part: must be K/N with 1 <= K <= N, for example 3/16, not {part}")
    first, last = ((len(scenes) * edge) // int(n) for edge in (int(k) - 1, int(k)))
    return dict(list(scenes.items())[first:last])


def tasks_of(scenes: Scenes) -> list[list[str]]:
    """The keys of `ordered` scenes, in tasks of one lattice each."""
    tasks: list[list[str]] = []
    for _, group in groupby(scenes, lambda key: lattice_key(scenes[key])):
        keys = list(group)
        size = 1 if scenes[keys[0]].lattice.points > LARGE else SCENES_PER_TASK
        tasks += [keys[first : first + size] for first in range(0, len(keys), size)]
    return tasks


def computed(
    scenes: Scenes, estimate: bool, jobs: int | None, executor: Executor | None, scheduler: str | None, say: Say
) -> Results:
    """The results of `ordered` scenes as they come: from a scheduler, else an executor, else so many processes.

    Raises InputError where no scheduler answers or workers have other versions, SimulationError when workers fail.
    """
    tasks, futures, finished = tasks_of(scenes), {}, SimpleQueue[Finished]()
    processes = min(jobs or cores(), len(tasks))
    workers: AbstractContextManager[Executor]
    if not tasks:
        return
    if scheduler is not None:
        workers = _dask(scheduler, say)
    elif executor is not None:
        workers = nullcontext(executor)
    elif processes > 1:
        workers = _pool(processes)
    else:
        runtime.start()
        yield from zip(scenes, compute_points(scenes.values(), estimate), strict=True)
        return
    with workers as pool:
        try:
            with ignored_by_children():  # a pool starts its processes now
                for keys in tasks:
                    packed = pickle.dumps([scenes[key] for key in keys])
                    future = pool.submit(compute_task, relevant_versions(), packed, estimate)
                    futures[future] = keys
                    future.add_done_callback(finished.put)
            import taichi_disk.figures.curves  # noqa: F401 (which will be drawn, while workers compute)

            for _ in tasks:
                future = _next(finished)
                yield from zip(futures[future], future.result(), strict=True)
        except TaichiDiskError:
            raise
        except Exception as error:
            died = isinstance(error, BrokenExecutor)
            what = "one died: out of memory? Take fewer --jobs" if died else f"{type(error).__name__}: {error}"
            raise SimulationError(
                f"the workers failed ({what}); the same command goes on where this stopped"
            ) from error
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def _pool(jobs: int) -> Iterator[Executor]:
    """Processes that end with this one, and at once when the block is left by an error."""
    context = multiprocessing.get_context("spawn")  # a forked Taichi hangs
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of the workers: this process has imported NumPy
    until, alive = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(jobs, context, _begin_worker, (until,))
    try:
        yield pool
    except BaseException:
        alive.close()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        alive.close()
        until.close()


def _next(finished: SimpleQueue[Finished]) -> Finished:
    while True:
        raise_if_interrupted()
        with suppress(Empty):
            return finished.get(timeout=POLL)


def _begin_worker(until: Connection) -> None:
    """End when the other end of `until` closes: processes of `concurrent.futures` outlive a parent that is killed."""

    def watch() -> None:
        with suppress(EOFError, OSError):
            until.recv()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


@contextmanager
def _dask(address: str, say: Say) -> Iterator[Executor]:
    """The workers of the Dask scheduler at `address`. Raises InputError where there is none."""
    try:
        from distributed import Client, Security
        from distributed.core import rpc
    except ImportError:
        raise InputError(f"--scheduler needs the package distributed: {pip_install('taichi-disk[cluster]')}") from None

    async def identity() -> Any:
        async with rpc(address, connection_args=Security().get_connection_args("client")) as scheduler:
            return await asyncio.wait_for(scheduler.identity(), CONNECT)

    try:
        # Asked first: a client waits for ever where nobody speaks. By a thread: a notebook has a loop of its own.
        with ThreadPoolExecutor(1) as thread:
            workers = len(thread.submit(asyncio.run, identity()).result()["workers"])
        client = Client(address, timeout=CONNECT, set_as_default=False)
    except Exception as error:  # what answers may be anything
        why = f" ({error})" if isinstance(error, ValueError) else ""
        raise InputError(f"no Dask scheduler answers at {address}{why}; `dask scheduler` starts one") from None
    with client:
        say(f"{workers} Dask workers" if workers else f"{address} has no workers yet: waiting for them")
        yield client.get_executor()
