"""Telling how far a stage has come: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

import sys
from typing import Protocol, TextIO


class Progress(Protocol):
    """What a long computation reports to. `stop` may be called at any time, also twice."""

    def start(self, stage: str, total: float | None) -> None:
        """A new stage begins; `total` is the amount at its end, None if that is not known."""

    def update(self, done: float) -> None:
        """The present stage has come to `done`, in the units of its total."""

    def stop(self) -> None:
        """Nothing more will come."""


class QuietProgress:
    """Says nothing."""

    def start(self, stage: str, total: float | None) -> None:
        pass

    def update(self, done: float) -> None:
        pass

    def stop(self) -> None:
        pass


class BarProgress:
    """One line of a terminal for each stage."""

    def __init__(self, stream: TextIO) -> None:
        from rich import progress
        from rich.console import Console

        self._bars = progress.Progress(
            progress.TextColumn("{task.description:<10}"),
            progress.BarColumn(),
            progress.TaskProgressColumn(),
            progress.TimeElapsedColumn(),
            progress.TimeRemainingColumn(),
            console=Console(file=stream),
            redirect_stdout=False,  # what is printed goes to stdout, not to the stream of the bar
        )

    def start(self, stage: str, total: float | None) -> None:
        # A stage may end before its total, an impact before its time limit: what is done is then all of it.
        for task in self._bars.tasks:
            self._bars.update(task.id, completed=1.0, total=1.0)
        self._bars.start()
        self._bars.add_task(stage, total=total)

    def update(self, done: float) -> None:
        self._bars.update(self._bars.task_ids[-1], completed=done)

    def stop(self) -> None:
        self._bars.stop()


def progress_for(stream: TextIO | None = None) -> Progress:
    """A bar if `stream` (default stderr) is a terminal, else silence."""
    stream = stream or sys.stderr
    return BarProgress(stream) if stream.isatty() else QuietProgress()
