"""Results as text: a value with its error, the lines that `run` prints."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from decimal import ROUND_CEILING, Decimal
from pathlib import Path
from typing import TypeAlias

from taichi_disk.base.files import Summary

# name and unit of each result that is shown
Labels: TypeAlias = Mapping[str, tuple[str, str]]

MAX_ROUNDING = 1e-12  # smaller values are rounding errors
DIGITS = 8  # printed digits of a result that does not depend on a time step
UNESTIMATED_DIGITS = 4  # printed digits of a result whose error has not been estimated
PLAIN_ERROR = 1e-4  # errors from here on are printed as 0.00021, smaller ones as 2.1e-5
UNESTIMATED = "(error of the time step not estimated)"


def print_result(summary: Summary, labels: Labels, out: Path | None) -> None:
    """Print the result, how it was computed, and the folder `out` if there is one.

    `labels` maps keys of the summary to (name, unit). The text is plain, because paths
    must not be wrapped.
    """
    for name, value, unit in rows(summary, labels):
        print(f"{name:<36}{value:>16} {unit}".rstrip())
    if out is not None:
        print(f"files in {out}")
    # A driver that crashes while the film is drawn takes unwritten lines along.
    print(end="", flush=True)


def print_time(summary: Summary) -> None:
    """Print how long a run took, and each of its stages."""
    seconds = summary["wall_clock"]
    parts = ", ".join(f"{name} {time:.1f}" for name, time in seconds.items())
    print(f"{'wall clock':<36}{sum(seconds.values()):>16.1f} s ({parts})")


def rows(summary: Summary, labels: Labels) -> Iterator[tuple[str, str, str]]:
    """Yield (name, value, remark) of each printed line about a finished run."""
    for key, label in labels.items():
        if key in summary:
            yield from _result_rows(summary, key, *label)
        if key == "restitution" and "gained_from" in summary:
            yield "  energy became flight:", summary["gained_from"], ""
    if "dt" in summary:
        yield "time step", f"{summary['dt']:.6g}", "R/c"
        yield "steps", f"{summary['steps']:,}", f"({summary['integrator']})"
        imbalance = summary["energy"]["closing_imbalance"]
        yield "energy imbalance at the end", f"{imbalance:.2e}", ""
    else:
        yield "iterations", str(summary["steps"]), f"({summary['integrator']})"


def _result_rows(
    summary: Summary, key: str, name: str, unit: str
) -> Iterator[tuple[str, str, str]]:
    """Yield the line to quote, if there are several lattices, and the line of this
    lattice."""
    mean = over_lattices(summary, key)
    seeds = summary.get("lattices", {}).get("seeds", [])
    if mean is None and len(seeds) > 1:
        remark = "(this lattice only: another has no such result)"
        yield name, shown(summary[key], None)[0], f"{unit} {remark}".strip()
        return
    has_steps = "dt" in summary
    errors = summary.get("error_estimate") or {}
    source = summary.get("error_source", "time step")
    value, error = shown(
        summary[key],
        errors.get(key),
        exact=not has_steps,
        source=f"{source}, this lattice only",
    )
    if has_steps and not errors:
        error = UNESTIMATED
    if mean is not None:
        yield name, mean[0], f"{unit} {mean[1]}".strip()
        name = f"  seed {summary['seed']}"
    yield name, value, f"{unit} {error}".strip()


def over_lattices(summary: Summary, key: str) -> tuple[str, str] | None:
    """Return the mean of a result over lattices and a text with its 95 % interval and
    the scatter, or None if there is only one lattice."""
    lattices = summary.get("lattices", {})
    if key not in lattices:
        return None
    found = lattices[key]
    source = f"95 % interval, mean of {len(lattices['seeds'])} lattices"
    half_width = found["interval_95"][1] - found["mean"]
    mean, error = shown(found["mean"], half_width, source=source)
    return mean, f"{error}, lattice to lattice {found['standard_deviation']:.2g}"


def headline(summary: Summary, labels: Labels) -> str:
    """Return the result to quote, with its error, or "" if there is only one
    lattice."""
    key, (name, unit) = next(iter(labels.items()))
    mean = over_lattices(summary, key)
    if mean is None:
        return ""
    return " ".join(f"{name} {mean[0]} {unit} {mean[1]}".split())


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
    # no smaller, so that a value has at most 12 digits
    bound = Decimal(repr(max(error, 1e-10 * abs(value), 1e-300)))
    last_digit = Decimal(1).scaleb(min(0, bound.adjusted() - 1))
    rounded = bound.quantize(last_digit, ROUND_CEILING)
    text = _plain_or_power(Decimal(repr(value)).quantize(last_digit), value, error)
    style = "f" if rounded >= PLAIN_ERROR else "e"
    return text, f"± {rounded:{style}} ({source})"


def _plain_or_power(rounded: Decimal, value: float, error: float) -> str:
    """Return `rounded`, which is `value` with as many digits as its `error` allows."""
    # for example the tangential impulse without friction
    if max(abs(value), error) < MAX_ROUNDING:
        return "0"
    if value and abs(value) < 1e-4:
        return f"{rounded:e}"
    return f"{rounded:f}"
