"""Compute the points of a sweep in this process, a pool of processes, or a
`concurrent.futures.Executor`."""

from __future__ import annotations

import asyncio
import gc
import multiprocessing
import os
import pickle
import threading
from collections.abc import Generator, Iterator
from concurrent.futures import (
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
)
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from itertools import groupby
from multiprocessing.connection import Connection
from queue import Empty, SimpleQueue
from typing import Any

from taichi_disk import runtime
from taichi_disk.errors import (
    InputError,
    SimulationError,
    TaichiDiskError,
    install_extra,
)
from taichi_disk.machine import cores
from taichi_disk.scenes import Scene
from taichi_disk.scenes.setup import lattice_key
from taichi_disk.signals import POLL_INTERVAL, ignored_by_children, raise_if_interrupted
from taichi_disk.sweep.work import (
    PointResult,
    compute_points,
    compute_task,
    relevant_versions,
)

Scenes = dict[str, Scene]  # scenes by the key of their point
Results = Generator[tuple[str, PointResult], None, None]
Finished = Future[list[PointResult]]

# figure 3 then has 96 tasks of 0.25 s; setting up the lattice takes a tenth of that
SCENES_PER_TASK = 6
LARGE_LATTICE = 2000  # a scene with more points is a task by itself
CONNECT_TIMEOUT = 8.0  # how long a scheduler may take to answer [s]


def ordered(scenes: Scenes) -> Scenes:
    """Sort scenes by lattice, then by key. Keys are hashes, so every section of the
    order is a random sample."""
    lattices: dict[object, list[str]] = {}
    for key, scene in scenes.items():
        lattices.setdefault(lattice_key(scene), []).append(key)
    return {key: scenes[key] for keys in lattices.values() for key in sorted(keys)}


def part_of(part: str, scenes: Scenes) -> Scenes:
    """Return part K of N, written "K/N", of `ordered` scenes; consecutive scenes share
    lattices."""
    k, _, n = part.partition("/")
    if not (k.isdecimal() and n.isdecimal() and 1 <= int(k) <= int(n) <= 1_000_000):
        raise InputError(
            f"part: must be K/N with 1 <= K <= N, for example 3/16, not {part}"
        )
    first, last = ((len(scenes) * edge) // int(n) for edge in (int(k) - 1, int(k)))
    return dict(list(scenes.items())[first:last])


def tasks_of(scenes: Scenes) -> list[list[str]]:
    tasks: list[list[str]] = []
    for _, group in groupby(scenes, lambda key: lattice_key(scenes[key])):
        keys = list(group)
        size = 1 if scenes[keys[0]].lattice.points > LARGE_LATTICE else SCENES_PER_TASK
        tasks += [keys[first : first + size] for first in range(0, len(keys), size)]
    return tasks


def computed(
    scenes: Scenes,
    estimate: bool,
    jobs: int | None,
    executor: Executor | None,
    scheduler: str | None,
) -> Results:
    """Yield (key, result) of `ordered` scenes as they finish, computed by a scheduler,
    an executor or `jobs` processes.

    Raises InputError if workers have other versions, SimulationError if workers fail.
    """
    tasks, futures, finished = tasks_of(scenes), {}, SimpleQueue[Finished]()
    processes = min(jobs or cores(), len(tasks))
    workers: AbstractContextManager[Executor]
    if not tasks:
        return
    if scheduler is not None:
        workers = _dask(scheduler)
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
            with ignored_by_children():  # a pool starts its processes here
                for keys in tasks:
                    packed = pickle.dumps([scenes[key] for key in keys])
                    future = pool.submit(
                        compute_task, relevant_versions(), packed, estimate
                    )
                    futures[future] = keys
                    future.add_done_callback(finished.put)
            import taichi_disk.figures.curves  # noqa: F401 (import now, while workers compute)

            for _ in tasks:
                future = _next(finished)
                yield from zip(futures[future], future.result(), strict=True)
        except TaichiDiskError:
            raise
        except Exception as error:
            cause = f"{type(error).__name__}: {error}"
            if isinstance(error, BrokenExecutor):
                cause = "one died, perhaps for lack of memory: use fewer jobs"
            text = (
                f"the workers failed ({cause}); finished points are kept: repeat the"
                " command to go on"
            )
            raise SimulationError(text) from error
        finally:
            for future in futures:
                future.cancel()


@contextmanager
def _pool(jobs: int) -> Iterator[Executor]:
    """Open a pool whose processes end with this one, and at once after an error in the
    block."""
    context = multiprocessing.get_context("spawn")  # a forked Taichi hangs
    # affects only workers: NumPy is already imported here
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    receiver, sender = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(jobs, context, _begin_worker, (receiver,))
    try:
        yield pool
    except BaseException:
        sender.close()
        raise
    finally:
        pool.shutdown(cancel_futures=True)
        sender.close()
        receiver.close()


def _next(finished: SimpleQueue[Finished]) -> Finished:
    while True:
        raise_if_interrupted()
        with suppress(Empty):
            return finished.get(timeout=POLL_INTERVAL)


def _begin_worker(receiver: Connection) -> None:
    """Exit when the other end of the pipe closes; otherwise workers would survive a
    killed parent."""
    gc.set_threshold(100_000)  # as in the commands

    def watch() -> None:
        with suppress(EOFError, OSError):
            receiver.recv()
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def count_workers(address: str) -> int:
    """Return the number of workers of the Dask scheduler at `address`. Raises
    InputError if no scheduler answers."""
    try:
        from distributed import Security
        from distributed.core import rpc
    except ImportError:
        raise InputError(
            f"Dask needs the package distributed: {install_extra('cluster')}"
        ) from None

    async def identity() -> Any:
        async with rpc(
            address, connection_args=Security().get_connection_args("client")
        ) as scheduler:
            return await asyncio.wait_for(scheduler.identity(), CONNECT_TIMEOUT)

    try:
        with ThreadPoolExecutor(1) as thread:  # avoids the event loop of a notebook
            return len(thread.submit(asyncio.run, identity()).result()["workers"])
    except Exception as error:  # a server of another kind may answer anything
        cause = f" ({error})" if isinstance(error, ValueError) else ""
        raise InputError(
            f"no Dask scheduler answers at {address}{cause}; start one with `dask"
            " scheduler`"
        ) from None


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    from distributed import Client

    with Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False) as client:
        yield client.get_executor()
