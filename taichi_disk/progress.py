"""Telling how far a stage has come: a bar on a terminal, nothing elsewhere."""

from __future__ import annotations

from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Bars
    from typing_extensions import Self


class Progress:
    """What a long computation reports to: one line for each stage, if `stream` is a terminal.

    It is stopped at the end of a `with` block; `stop` may be called at any time, also twice.
    """

    def __init__(self, stream: TextIO | None = None) -> None:
        self._bars: Bars | None = None
        if stream is None or not stream.isatty():
            return
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
        """A new stage begins; `total` is the amount at its end, None if that is not known."""
        if self._bars:
            # A stage may end before its total, an impact before its time limit: what is done is then all of it.
            for task in self._bars.tasks:
                self._bars.update(task.id, completed=1.0, total=1.0)
            self._bars.start()
            self._bars.add_task(stage, total=total)

    def update(self, done: float) -> None:
        """The present stage has come to `done`, in the units of its total."""
        if self._bars:
            self._bars.update(self._bars.task_ids[-1], completed=done)

    def stop(self) -> None:
        """Nothing more will come."""
        if self._bars:
            self._bars.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()


def duration(seconds: float) -> str:
    """A time that is still to come, rounded to what such an estimate is worth."""
    if seconds < 90.0:
        return f"{max(10, 10 * round(seconds / 10)):g} s"
    return f"{round(seconds / 60)} min" if seconds < 6000.0 else f"{seconds / 3600:.1f} h"
