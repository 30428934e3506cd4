"""Telling how far a stage has come: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

import sys
from typing import TextIO


class Progress:
    """What a long computation reports to; this one says nothing. `stop` may be called at any time, also twice."""

    def start(self, stage: str, total: float | None) -> None:
        """A new stage begins; `total` is the amount at its end, None if that is not known."""

    def update(self, done: float) -> None:
        """The present stage has come to `done`, in the units of its total."""

    def stop(self) -> None:
        """Nothing more will come."""


class BarProgress(Progress):
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
    return BarProgress(stream) if stream.isatty() else Progress()


def duration(seconds: float) -> str:
    """A time that is still to come, rounded to what such an estimate is worth."""
    if seconds < 90.0:
        return f"{max(10, 10 * round(seconds / 10)):g} s"
    return f"{round(seconds / 60)} min" if seconds < 6000.0 else f"{seconds / 3600:.1f} h"
