"""The headline of a finished run, as a small table for the screen. Plain text: a path must not be wrapped."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taichi_disk.runner import RunResult

# Headline numbers as a person calls them: name, unit.
NAMES = {
    "restitution": ("restitution e", ""),
    "contact_time": ("contact time", "R/c"),
    "xi": ("compression xi", "R"),
    "xi_nominal": ("compression xi, from nominal radius", "R"),
}


def print_result(result: RunResult) -> None:
    """Print the result, how it was computed, how long that took, where the files are; warnings on stderr."""
    for name, value, unit in _rows(result):
        print(f"{name:<36}{value:>16} {unit}".rstrip())
    print(f"files in {result.out}")
    for text in result.summary.get("warnings", ()):
        print(f"warning: {text}", file=sys.stderr)


def _rows(result: RunResult) -> Iterator[tuple[str, str, str]]:
    summary = result.summary
    for key, value in result.headline.items():
        name, unit = NAMES.get(key, (key, ""))
        error = summary.get("error_estimate", {}).get(key)
        yield name, f"{value:.8g}", f"{unit} ± {error:.1g} (time step)".strip() if error is not None else unit
    if "dt" in summary:
        yield "time step", f"{summary['dt']:.6g}", "R/c"
        yield "steps", f"{summary['steps']:,}", f"({summary['integrator']})"
        yield "energy imbalance at the end", f"{summary['energy']['closing_imbalance']:.2e}", ""
    else:
        yield "iterations", str(summary["steps"]), f"({summary['integrator']})"
    split = summary["wall_clock"]
    stages = ", ".join(f"{name} {seconds:.1f}" for name, seconds in split.items())
    yield "wall clock", f"{sum(split.values()):.1f}", f"s ({stages})"
