"""Progress bars in terminals and notebooks."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import wraps
from inspect import signature
from time import monotonic
from typing import Any, TextIO, TypeAlias, TypeVar

from taichi_disk.base.errors import InputError

# callback(stage, done, total)
Progress: TypeAlias = Callable[[str, float, "float | None"], object]
# delay of a bar's appearance and time between its updates in a notebook [s]
BAR_DELAY = 0.5
BAR_INTERVAL = 0.1
F = TypeVar("F", bound=Callable[..., Any])


class Silence:
    """Default callback, which shows nothing."""

    def __call__(self, stage: str, done: float, total: float | None) -> None:
        """Show how much of a stage is done."""

    def rest(self) -> None:
        """End the bars, so that text can be printed before the next stage."""


silent = Silence()


def reported(function: F) -> F:
    """Decorate `function` so that `progress=None` shows a bar in a notebook while the
    function runs.

    The decorated function raises InputError if `progress` cannot be called with (stage,
    done, total).
    """
    arguments = signature(function)

    @wraps(function)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        call = arguments.bind(*args, **kwargs)
        progress = call.arguments.get("progress")
        bar: AbstractContextManager[Progress] = _notebook()
        if progress is not None:
            _check_callback(progress)
            bar = nullcontext(progress)
        with bar as call.arguments["progress"]:
            return function(*call.args, **call.kwargs)

    return wrapped  # type: ignore[return-value]


def _check_callback(progress: Any) -> None:
    try:
        signature(progress).bind("simulate", 0.0, None)
    # ValueError: some built-in functions have no signature
    except (TypeError, ValueError):
        name = getattr(progress, "__name__", type(progress).__name__)
        raise InputError(
            f"progress: must be a function of (stage, done, total), which {name} is not"
        ) from None


@contextmanager
def _notebook() -> Iterator[Progress]:
    if "IPython" not in sys.modules:
        yield silent
        return
    bars = _Bars(None)
    if not bars.progress.console.is_jupyter:
        yield silent
        return
    from IPython.display import display

    handle = None
    due = monotonic() + BAR_DELAY

    def show(stage: str, done: float, total: float | None) -> None:
        nonlocal handle, due
        bars(stage, done, total)
        if monotonic() > due:
            handle = handle or display(bars.progress, display_id=True)
            handle.update(bars.progress)
            due = monotonic() + BAR_INTERVAL

    try:
        yield show
    finally:
        if handle:
            handle.update({"text/plain": ""}, raw=True)


@contextmanager
def terminal(stream: TextIO | None) -> Iterator[Silence]:
    """Show a bar on `stream` for each stage, if it is a terminal. Yields the progress
    callback."""
    bars = silent
    if stream is not None and stream.isatty():
        bars = _Bars(stream)
    try:
        yield bars
    finally:
        bars.rest()


class _Bars(Silence):
    def __init__(self, stream: TextIO | None) -> None:
        self._stream = stream
        self._begin()

    def _begin(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            TaskProgressColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        console = Console(file=self._stream)
        columns = (
            BarColumn(),
            TaskProgressColumn(),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
        )
        self.progress = Progress(
            "{task.description:<10}",
            *columns,
            "{task.fields[note]}",
            console=console,
            # printed text goes to stdout, not to the stream of the bar
            redirect_stdout=False,
            # rich's thread cannot write to a notebook cell without a widget
            disable=console.is_jupyter,
        )

    def __call__(self, stage: str, done: float, total: float | None) -> None:
        with suppress(OSError):  # the terminal has gone
            bars = self.progress
            bars.start()
            if not bars.tasks or bars.tasks[-1].description != stage:
                # A stage may end before its total, as an impact ends before its time
                # limit. Its bar is then completed.
                for task in bars.tasks:
                    bars.update(task.id, completed=1.0, total=1.0)
                # The time of a simulation is a float; equilibria, lattices, scenes and
                # pictures are counted.
                note = ""
                if stage == "simulate" and isinstance(total, float):
                    note = "to the time limit"
                bars.add_task(stage, total=total, note=note)
            bars.update(bars.task_ids[-1], completed=done, total=total)

    def rest(self) -> None:
        with suppress(OSError):
            self.progress.stop()
        # The old bars would remove the lines above them, which the user has printed
        # meanwhile.
        self._begin()
