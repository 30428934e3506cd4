"""Progress bars in terminals and notebooks, and printed results."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from decimal import ROUND_CEILING, Decimal
from functools import wraps
from inspect import signature
from pathlib import Path
from time import monotonic
from typing import Any, TextIO, TypeAlias, TypeVar

from taichi_disk.errors import InputError

Progress: TypeAlias = Callable[[str, float, "float | None"], object]  # callback(stage, done, total)
MAX_ROUNDING = 1e-12  # smaller values are rounding errors
DIGITS = 8  # printed digits of a result that does not depend on a time step
UNESTIMATED_DIGITS = 4  # printed digits of a result whose error has not been estimated
BAR_DELAY, BAR_INTERVAL = 0.5, 0.1  # delay of a bar's appearance and time between its updates in a notebook [s]
F = TypeVar("F", bound=Callable[..., Any])
UNESTIMATED = "(error of the time step not estimated)"


def silent(stage: str, done: float, total: float | None) -> None:
    """Default callback, which shows nothing."""


def reported(function: F) -> F:
    """Decorate `function` so that `progress=None` shows a bar in a notebook while the function runs.

    The decorated function raises InputError if `progress` cannot be called with (stage, done, total).
    """
    arguments = signature(function)

    @wraps(function)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        call = arguments.bind(*args, **kwargs)
        progress = call.arguments.get("progress")
        try:
            signature(silent if progress is None else progress).bind("simulate", 0.0, None)
        except (TypeError, ValueError):  # ValueError: some built-in functions have no signature
            name = getattr(progress, "__name__", type(progress).__name__)
            raise InputError(f"progress: must be a function of (stage, done, total), which {name} is not") from None
        with _notebook() if progress is None else nullcontext(progress) as call.arguments["progress"]:
            return function(*call.args, **call.kwargs)

    return wrapped  # type: ignore[return-value]


@contextmanager
def _notebook() -> Iterator[Progress]:
    bars = _Bars(None) if "IPython" in sys.modules else None
    if bars is None or not bars.progress.console.is_jupyter:
        yield silent
        return
    from IPython.display import display

    handle, due = None, monotonic() + BAR_DELAY

    def show(stage: str, done: float, total: float | None) -> None:
        nonlocal handle, due
        bars.show(stage, done, total)
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
def terminal(stream: TextIO | None) -> Iterator[Progress]:
    """Show a bar on `stream` for each stage, if it is a terminal. Yields the progress callback."""
    if stream is None or not stream.isatty():
        yield silent
        return
    bars = _Bars(stream)
    try:
        yield bars.show
    finally:
        bars.progress.stop()


class _Bars:
    def __init__(self, stream: TextIO | None) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TaskProgressColumn, TimeElapsedColumn, TimeRemainingColumn

        console = Console(file=stream)
        columns = BarColumn(), TaskProgressColumn(), TimeElapsedColumn(), TimeRemainingColumn()
        self.progress = Progress(
            "{task.description:<10}",
            *columns,
            "{task.fields[note]}",
            console=console,
            redirect_stdout=False,  # printed text goes to stdout, not to the stream of the bar
            disable=console.is_jupyter,  # rich's thread cannot write to a notebook cell without a widget
        )

    def show(self, stage: str, done: float, total: float | None) -> None:
        bars = self.progress
        bars.start()
        if not bars.tasks or bars.tasks[-1].description != stage:
            # A stage may end before its total, as an impact ends before its time limit. Its bar is then completed.
            for task in bars.tasks:
                bars.update(task.id, completed=1.0, total=1.0)
            # The time of a simulation is a float; equilibria, lattices, scenes and pictures are counted.
            bars.add_task(stage, total=total, note="to the time limit" * isinstance(total, float))
        bars.update(bars.task_ids[-1], completed=done, total=total)


def duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{max(10, 10 * round(seconds / 10)):g} s"
    return f"{round(seconds / 60)} min" if seconds < 6000.0 else f"{seconds / 3600:.1f} h"


# ---- results


def print_result(summary: Mapping[str, Any], labels: Mapping[str, tuple[str, str]], out: Path) -> None:
    """Print the result, how it was computed, its time and the folder `out`; print warnings on stderr.

    `labels` maps keys of the summary to (name, unit). The text is plain, because paths must not be wrapped.
    """
    for name, value, unit in rows(summary, labels):
        print(f"{name:<36}{value:>16} {unit}".rstrip())
    print(f"files in {out}")
    for text in summary.get("warnings", ()):
        print(f"warning: {text}", file=sys.stderr)


def rows(summary: Mapping[str, Any], labels: Mapping[str, tuple[str, str]]) -> Iterator[tuple[str, str, str]]:
    errors, source = summary.get("error_estimate") or {}, summary.get("error_source", "time step")
    for key, (name, unit) in labels.items():
        if key in summary:
            value, error = shown(summary[key], errors.get(key), exact="dt" not in summary, source=source)
            if mean := over_lattices(summary, key):
                yield name, mean[0], f"{unit} {mean[1]}".strip()
                name = f"  of this lattice, seed {summary['seed']}"
            yield name, value, f"{unit} {error or UNESTIMATED * ('dt' in summary and not errors)}".strip()
    if "dt" in summary:
        yield "time step", f"{summary['dt']:.6g}", "R/c"
        yield "steps", f"{summary['steps']:,}", f"({summary['integrator']})"
        yield "energy imbalance at the end", f"{summary['energy']['closing_imbalance']:.2e}", ""
    else:
        yield "iterations", str(summary["steps"]), f"({summary['integrator']})"
    seconds = summary["wall_clock"]
    parts = ", ".join(f"{name} {time:.1f}" for name, time in seconds.items())
    yield "wall clock", f"{sum(seconds.values()):.1f}", f"s ({parts})"


def over_lattices(summary: Mapping[str, Any], key: str) -> tuple[str, str] | None:
    """Return the mean of a result over lattices and "± scatter", or None if there is only one lattice."""
    lattices = summary.get("lattices", {})
    if key not in lattices:
        return None
    source = f"mean and scatter of {len(lattices['seeds'])} lattices"
    return shown(lattices[key]["mean"], lattices[key]["standard_deviation"], source=source)


def headline(summary: Mapping[str, Any], labels: Mapping[str, tuple[str, str]]) -> str:
    key, (name, unit) = next(iter(labels.items()))
    value, scatter = over_lattices(summary, key) or ("", "")
    return " ".join(f"{name} {value} {unit} {scatter}".split()) if value else ""


def shown(value: float, error: float | None, exact: bool = False, source: str = "time step") -> tuple[str, str]:
    """Format a result and "± error"; the latter is empty if the error is not known.

    The error (None: not estimated) is rounded up to two digits, and the value gets the same last digit: 0.967234 ±
    1.4e-5. A value has at most 12 digits. `exact`: only rounding limits the result, as in Newton's method.
    """
    if error is None or not error < 1e9:  # also true for NaN
        return f"{value:.{DIGITS if exact else UNESTIMATED_DIGITS}g}", ""
    bound = Decimal(repr(max(error, 1e-10 * abs(value), 1e-300)))
    rounded = bound.quantize(Decimal(1).scaleb(min(0, bound.adjusted() - 1)), ROUND_CEILING)
    number = Decimal(repr(value)).quantize(rounded)
    text = f"{number:f}" if abs(value) >= 1e-4 or not value else f"{number:e}"
    if not number and error < MAX_ROUNDING:  # for example the tangential impulse without friction
        text = "0"
    return text, f"± {rounded:{'f' if error >= 1e-3 else 'e'}} ({source})"
