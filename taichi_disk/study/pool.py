"""Worker processes, each with its own Taichi on one core, that compute lists of scenes.

Not `concurrent.futures`: its workers outlive a parent that is killed. These end with it.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator, Sequence
from multiprocessing.connection import Connection, wait
from typing import cast

from taichi_disk.errors import SimulationError
from taichi_disk.scene import Scene
from taichi_disk.study.work import Computer, PointResult

Task = Sequence[Scene]
GRACE = 10.0  # seconds for a worker to end by itself


def compute_all(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[int, int, PointResult]]:
    """(task, index in it, result) for every scene of every task, as they come.

    Each task's scenes agree in `lattice_key`. With one job, or one task, all happens in this process. More
    processes need a main module that can be imported (`if __name__ == "__main__":` in a script).
    Raises SimulationError when a worker dies.
    """
    if min(jobs, len(tasks)) <= 1:
        computer = Computer()
        for number, task in enumerate(tasks):
            for index, result in computer.compute(task):
                yield number, index, result
        return
    with _Workers(min(jobs, len(tasks))) as workers:
        yield from workers.compute(tasks)


class _Workers:
    def __init__(self, count: int) -> None:
        context = multiprocessing.get_context("spawn")  # a forked Taichi hangs
        self._processes, self._pipes = [], []
        for _ in range(count):
            ours, theirs = context.Pipe()
            process = context.Process(target=_work, args=(theirs,), daemon=True)
            process.start()
            theirs.close()
            self._processes.append(process)
            self._pipes.append(ours)

    def __enter__(self) -> _Workers:
        return self

    def __exit__(self, kind: object, *_: object) -> None:
        for pipe in self._pipes:
            pipe.close()
        for process in self._processes:
            if kind is None:
                # All is done: they end by themselves, with what they compiled kept for the next sweep.
                process.join(GRACE)
            process.terminate()
            process.join()

    def compute(self, tasks: Sequence[Task]) -> Iterator[tuple[int, int, PointResult]]:
        todo = iter(range(len(tasks)))
        doing: dict[Connection, int] = {}
        for pipe in self._pipes:
            self._give(pipe, tasks, todo, doing)
        while doing:
            for ready in wait(list(doing)):
                pipe = cast(Connection, ready)
                try:
                    message = pipe.recv()
                except EOFError:
                    raise SimulationError(
                        "a worker process died (out of memory?); what was done is kept: start the sweep again, "
                        "perhaps with fewer --jobs"
                    ) from None
                if message is None:
                    del doing[pipe]
                    self._give(pipe, tasks, todo, doing)
                else:
                    yield doing[pipe], *message

    @staticmethod
    def _give(pipe: Connection, tasks: Sequence[Task], todo: Iterator[int], doing: dict[Connection, int]) -> None:
        number = next(todo, None)
        if number is not None:
            doing[pipe] = number
            pipe.send(list(tasks[number]))


def _work(pipe: Connection) -> None:
    """Take a list of scenes, send (index, result) for each and then None; until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    threading.Thread(target=_end_with_parent, daemon=True).start()
    computer = Computer()
    try:
        while True:
            task = pipe.recv()
            for found in computer.compute(task):
                pipe.send(found)
            pipe.send(None)
    except (EOFError, BrokenPipeError, ConnectionResetError):
        computer.close()


def _end_with_parent() -> None:
    """A killed parent cannot end its workers, and a point may take minutes until the pipe is used again."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)
