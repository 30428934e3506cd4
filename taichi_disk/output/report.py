"""Results as text: a value with its error, the lines that `run` prints."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from decimal import ROUND_CEILING, Decimal
from pathlib import Path
from typing import Any, TypeAlias

Summary: TypeAlias = Mapping[str, Any]  # contents of summary.json
# name and unit of each result that is shown
Labels: TypeAlias = Mapping[str, tuple[str, str]]

MAX_ROUNDING = 1e-12  # smaller values are rounding errors
DIGITS = 8  # printed digits of a result that does not depend on a time step
UNESTIMATED_DIGITS = 4  # printed digits of a result whose error has not been estimated
UNESTIMATED = "(error of the time step not estimated)"


def print_result(summary: Summary, labels: Labels, out: Path | None) -> None:
    """Print the result, how it was computed, its time and the folder `out` if there is
    one; print warnings on stderr.

    `labels` maps keys of the summary to (name, unit). The text is plain, because paths
    must not be wrapped.
    """
    for name, value, unit in rows(summary, labels):
        print(f"{name:<36}{value:>16} {unit}".rstrip())
    if out is not None:
        print(f"files in {out}")
    for text in summary.get("warnings", ()):
        print(f"warning: {text}", file=sys.stderr)


def rows(summary: Summary, labels: Labels) -> Iterator[tuple[str, str, str]]:
    errors, source = (
        summary.get("error_estimate") or {},
        summary.get("error_source", "time step"),
    )
    for key, (name, unit) in labels.items():
        if key in summary:
            value, error = shown(
                summary[key], errors.get(key), exact="dt" not in summary, source=source
            )
            if mean := over_lattices(summary, key):
                yield name, mean[0], f"{unit} {mean[1]}".strip()
                name = f"  of this lattice, seed {summary['seed']}"
            if not error and "dt" in summary and not errors:
                error = UNESTIMATED
            yield name, value, f"{unit} {error}".strip()
    if "dt" in summary:
        yield "time step", f"{summary['dt']:.6g}", "R/c"
        yield "steps", f"{summary['steps']:,}", f"({summary['integrator']})"
        yield (
            "energy imbalance at the end",
            f"{summary['energy']['closing_imbalance']:.2e}",
            "",
        )
    else:
        yield "iterations", str(summary["steps"]), f"({summary['integrator']})"
    seconds = summary["wall_clock"]
    parts = ", ".join(f"{name} {time:.1f}" for name, time in seconds.items())
    yield "wall clock", f"{sum(seconds.values()):.1f}", f"s ({parts})"


def over_lattices(summary: Summary, key: str) -> tuple[str, str] | None:
    """Return the mean of a result over lattices and "± scatter", or None if there is
    only one lattice."""
    lattices = summary.get("lattices", {})
    if key not in lattices:
        return None
    source = f"mean and scatter of {len(lattices['seeds'])} lattices"
    return shown(
        lattices[key]["mean"], lattices[key]["standard_deviation"], source=source
    )


def headline(summary: Summary, labels: Labels) -> str:
    key, (name, unit) = next(iter(labels.items()))
    value, scatter = over_lattices(summary, key) or ("", "")
    return " ".join(f"{name} {value} {unit} {scatter}".split()) if value else ""


def shown(
    value: float, error: float | None, exact: bool = False, source: str = "time step"
) -> tuple[str, str]:
    """Format a result and "± error"; the latter is empty if the error is not known.

    The error (None: not estimated) is rounded up to two digits, and the value gets the
    same last digit: 0.967234 ± 1.4e-5. A value has at most 12 digits. `exact`: only
    rounding limits the result, as in Newton's method.
    """
    if error is None or not error < 1e9:  # also true for NaN
        return f"{value:.{DIGITS if exact else UNESTIMATED_DIGITS}g}", ""
    bound = Decimal(repr(max(error, 1e-10 * abs(value), 1e-300)))
    rounded = bound.quantize(
        Decimal(1).scaleb(min(0, bound.adjusted() - 1)), ROUND_CEILING
    )
    number = Decimal(repr(value)).quantize(rounded)
    text = f"{number:f}" if abs(value) >= 1e-4 or not value else f"{number:e}"
    # for example the tangential impulse without friction
    if not number and error < MAX_ROUNDING:
        text = "0"
    return text, f"± {rounded:{'f' if error >= 1e-3 else 'e'}} ({source})"
