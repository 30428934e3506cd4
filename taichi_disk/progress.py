"""What a terminal shows: how far a stage has come, as a bar, and the result of a run."""

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

Progress: TypeAlias = Callable[[str, float, "float | None"], object]  # told a stage, how much is done, of how much
ROUNDING = 1e-12  # an error that only rounding makes
DIGITS = 8  # of a result that does not depend on a time step
UNSURE_DIGITS = 4  # of one that does, by an amount that nobody has estimated
SOON, EVERY = 0.5, 0.1  # [s] a notebook shows a bar for what takes longer, and draws it so often
F = TypeVar("F", bound=Callable[..., Any])
UNSURE = "(error of the time step not estimated)"


def silent(stage: str, done: float, total: float | None) -> None:
    """A progress that nobody looks at."""


def reporter(progress: Progress | None) -> Progress:
    """`progress`, for None `silent`. Raises InputError for what cannot be called as progress(stage, done, total)."""
    if progress is None:
        return silent
    try:
        signature(progress).bind("simulate", 0.0, None)
    except (TypeError, ValueError):  # ValueError: of some built-in functions it is not known
        name = getattr(progress, "__name__", type(progress).__name__)
        raise InputError(f"progress: must be callable as progress(stage, done, total), which {name} is not") from None
    return progress


def reported(function: F) -> F:
    """Give `function` a `progress` that can be called: for None a bar in a notebook, which goes when it returns."""
    arguments = signature(function)

    @wraps(function)
    def wrapped(*args: Any, **kwargs: Any) -> Any:
        given = arguments.bind(*args, **kwargs)
        progress = given.arguments.get("progress")
        with _notebook() if progress is None else nullcontext(reporter(progress)) as given.arguments["progress"]:
            return function(*given.args, **given.kwargs)

    return wrapped  # type: ignore[return-value]


@contextmanager
def _notebook() -> Iterator[Progress]:
    """Within, a progress that a notebook's cell shows; silent elsewhere."""
    if "IPython" not in sys.modules:
        yield silent
        return
    from IPython.display import display
    from rich.console import Console

    if not (console := Console()).is_jupyter:
        yield silent
        return
    bars, handle, due = _Bars(console), None, monotonic() + SOON

    def show(stage: str, done: float, total: float | None) -> None:
        nonlocal handle, due
        bars.show(stage, done, total)
        if monotonic() > due:  # rich's own thread, which would draw the bars as a widget, writes to no cell
            handle = handle or display(bars.progress, display_id=True)
            handle.update(bars.progress)
            due = monotonic() + EVERY

    try:
        yield show
    finally:
        if handle:
            handle.update({"text/plain": ""}, raw=True)


@contextmanager
def terminal(stream: TextIO | None) -> Iterator[Progress]:
    """Within, a progress that is shown on `stream`, a line for each stage; silent where that is no terminal."""
    if stream is None or not stream.isatty():
        yield silent
        return
    from rich.console import Console

    bars = _Bars(Console(file=stream))

    def show(stage: str, done: float, total: float | None) -> None:
        bars.progress.start()
        bars.show(stage, done, total)

    try:
        yield show
    finally:
        bars.progress.stop()


class _Bars:
    """A line for each stage; `progress` is rich's."""

    def __init__(self, console: Any) -> None:
        from rich import progress

        self.progress = progress.Progress(
            progress.TextColumn("{task.description:<10}"),
            progress.BarColumn(),
            progress.TaskProgressColumn(),
            progress.TimeElapsedColumn(),
            progress.TimeRemainingColumn(),
            console=console,
            redirect_stdout=False,  # what is printed goes to stdout, not to the stream of the bar
        )

    def show(self, stage: str, done: float, total: float | None) -> None:
        bars = self.progress
        if not bars.tasks or bars.tasks[-1].description != stage:
            # A stage may end before its total, an impact before its time limit: what is done is then all of it.
            for task in bars.tasks:
                bars.update(task.id, completed=1.0, total=1.0)
            bars.add_task(stage, total=total)
        bars.update(bars.task_ids[-1], completed=done, total=total)


def duration(seconds: float) -> str:
    """A time that is still to come, rounded to what such an estimate is worth."""
    if seconds < 90.0:
        return f"{max(10, 10 * round(seconds / 10)):g} s"
    return f"{round(seconds / 60)} min" if seconds < 6000.0 else f"{seconds / 3600:.1f} h"


# ---- a result


def print_result(summary: Mapping[str, Any], labels: Mapping[str, tuple[str, str]], out: Path) -> None:
    """Print the result, how it was computed, how long that took, where the files are; warnings on stderr.

    It is plain text: a path must not be wrapped.

    `labels` are name and unit of each number of the result, by its key in the summary.
    """
    for name, value, unit in rows(summary, labels):
        print(f"{name:<36}{value:>16} {unit}".rstrip())
    print(f"files in {out}")
    for text in summary.get("warnings", ()):
        print(f"warning: {text}", file=sys.stderr)


def rows(summary: Mapping[str, Any], labels: Mapping[str, tuple[str, str]]) -> Iterator[tuple[str, str, str]]:
    """(name, value, unit and remarks) of each line."""
    errors, source = summary.get("error_estimate") or {}, summary.get("error_source", "time step")
    for key, (name, unit) in labels.items():
        if key in summary:
            value, error = shown(summary[key], errors.get(key), exact="dt" not in summary, source=source)
            if mean := over_lattices(summary, key):
                yield name, mean[0], f"{unit} {mean[1]}".strip()
                name = f"  of this lattice, seed {summary['seed']}"
            yield name, value, f"{unit} {error or UNSURE * ('dt' in summary and not errors)}".strip()
    if "dt" in summary:
        yield "time step", f"{summary['dt']:.6g}", "R/c"
        yield "steps", f"{summary['steps']:,}", f"({summary['integrator']})"
        yield "energy imbalance at the end", f"{summary['energy']['closing_imbalance']:.2e}", ""
    else:
        yield "iterations", str(summary["steps"]), f"({summary['integrator']})"
    seconds = summary["wall_clock"]
    parts = ", ".join(f"{name} {one:.1f}" for name, one in seconds.items())
    yield "wall clock", f"{sum(seconds.values()):.1f}", f"s ({parts})"


def over_lattices(summary: Mapping[str, Any], key: str) -> tuple[str, str] | None:
    """The mean of a result over lattices and "± its scatter"; None if there is one lattice alone."""
    lattices = summary.get("lattices", {})
    if key not in lattices:
        return None
    source = f"mean and scatter of {len(lattices['seeds'])} lattices"
    return shown(lattices[key]["mean"], lattices[key]["standard_deviation"], source=source)


def headline(summary: Mapping[str, Any], labels: Mapping[str, tuple[str, str]]) -> str:
    """The primary result over lattices in a few words; empty if there is one lattice alone."""
    key, (name, unit) = next(iter(labels.items()))
    value, scatter = over_lattices(summary, key) or ("", "")
    return " ".join(f"{name} {value} {unit} {scatter}".split()) if value else ""


def shown(value: float, error: float | None, exact: bool = False, source: str = "time step") -> tuple[str, str]:
    """A result with no more digits than are meant, and "± its error"; empty if that is not known.

    The error, None if not estimated, is rounded up to two digits, and the value ends where it does: 0.967234 ± 1.4e-5.
    No value has more than 12 digits. A result without estimate that is `exact`, as that of Newton's method, is good to
    rounding.
    """
    if error is None or not error < 1e9:  # NaN, too
        return f"{value:.{DIGITS if exact else UNSURE_DIGITS}g}", ""
    bound = Decimal(repr(max(error, 1e-10 * abs(value), 1e-300)))
    rounded = bound.quantize(Decimal(1).scaleb(min(0, bound.adjusted() - 1)), ROUND_CEILING)
    number = Decimal(repr(value)).quantize(rounded)
    text = f"{number:f}" if abs(value) >= 1e-4 or not value else f"{number:e}"
    if not number and error < ROUNDING:  # an impulse along a wall without friction
        text = "0"
    return text, f"± {rounded:{'f' if error >= 1e-3 else 'e'}} ({source})"
