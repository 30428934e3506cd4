"""Programs that carry out a task, each in a process of its own, so that none disturbs the other's libraries."""

from __future__ import annotations

import multiprocessing
import signal
import traceback
from abc import ABC, abstractmethod
from contextlib import suppress
from importlib import import_module
from typing import Any

from taichi_disk.benchmark.task import Task
from taichi_disk.errors import SimulationError
from taichi_disk.model.runtime import Precision


class Engine(ABC):
    """A task made ready: compiled, read in, set up."""

    @classmethod  # noqa: B027 (most have nothing to do)
    def begin(cls, **options: Any) -> None:
        """Once in the process, before the first task."""

    @abstractmethod
    def __init__(self, task: Task, **options: Any) -> None:
        pass

    @abstractmethod
    def run(self) -> float:
        """Carry the task out from its start; wall-clock seconds of the stepping alone."""

    @abstractmethod
    def restitution(self) -> float:
        """e of the first lane, after `run`."""


class EngineProcess:
    """A process with engines of one kind; `engine` is "module:Class". Runs are numbered in the order of `open`."""

    def __init__(self, engine: str, **options: Any) -> None:
        context = multiprocessing.get_context("spawn")  # a forked Taichi hangs
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(theirs, engine, options), daemon=True)
        self._process.start()
        theirs.close()
        self._opened = 0

    def open(self, task: Task, **options: Any) -> int:
        """Make an engine for `task` and run it once; returns its number. Raises SimulationError if it cannot."""
        self._ask("open", task, options)
        self._opened += 1
        return self._opened - 1

    def restitution(self, number: int) -> float:
        return float(self._ask("restitution", number))

    def run(self, number: int) -> float:
        """Seconds."""
        self.start(number)
        return self.finish()

    def start(self, number: int) -> None:
        """Begin a run and return at once."""
        self._send(("run", number))

    def finish(self) -> float:
        """Wait for the run that was begun; its seconds."""
        return float(self._answer())

    def close(self) -> None:
        self._pipe.close()  # it then ends by itself, and Taichi keeps what it has compiled
        self._process.join(10.0)
        self._process.terminate()

    def __enter__(self) -> EngineProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, *message: Any) -> Any:
        self._send(message)
        return self._answer()

    def _send(self, message: Any) -> None:
        with suppress(BrokenPipeError):  # `_answer` tells that the process has died
            self._pipe.send(message)

    def _answer(self) -> Any:
        try:
            good, answer = self._pipe.recv()
        except (EOFError, ConnectionResetError):
            raise SimulationError("its process died") from None
        if not good:
            raise SimulationError(answer)
        return answer


def ours(precision: Precision = "f64", threads: int = 1) -> EngineProcess:
    """A process of this program."""
    return EngineProcess("taichi_disk.benchmark.ours:Ours", threads=threads, precision=precision)


def _serve(pipe: Any, engine: str, options: dict[str, Any]) -> None:
    """Answer (request, arguments ...) with (True, answer) or (False, reason), until the other end is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is the parent's to handle
    module, name = engine.split(":")
    engines: list[Engine] = []
    kind: type[Engine] | None = None
    try:
        while True:
            what, *arguments = pipe.recv()
            try:
                if kind is None:
                    kind = getattr(import_module(module), name)
                    kind.begin(**options)
                answer = None
                if what == "open":
                    task, special = arguments
                    engines.append(kind(task, **special))
                    engines[-1].run()
                else:
                    answer = getattr(engines[arguments[0]], what)()
            except Exception as error:
                pipe.send((False, traceback.format_exception_only(error)[-1].strip()))
            else:
                pipe.send((True, answer))
    except (EOFError, BrokenPipeError, ConnectionResetError):
        pass
