"""What a person reads at the end of a sweep."""

from __future__ import annotations

from typing import Any

from taichi_disk.sweep.analysis import LAWS
from taichi_disk.sweep.sweep import SweepResult

MOST_FAILURES = 10
CURVE = ("lattices", "young", "poisson", "x", "mean", "standard_deviation", "fits")  # of a curve, besides its label


def print_sweep(result: SweepResult) -> None:
    """Print fits with their 95 % intervals, what failed, and where the files are."""
    summary, failed = result.summary, result.failed
    for curve in summary.get("curves", ()):
        given = [f"{name}: {_short(value)}" for name, value in curve.items() if name not in CURVE]
        print(", ".join([*given, f"{curve['lattices']} lattice{'s' if curve['lattices'] > 1 else ''}"]))
        for name, fit in curve["fits"].items():
            shown = "   ".join(f"{key} = {_parameter(fit, key)}" for key in fit["values"])
            print(f"  {LAWS[name].title:<24}{shown}")
    for row in failed[:MOST_FAILURES]:
        print(f"failed at {', '.join(f'{name}: {row[name]}' for name in summary['axes'])}: {row['reason']}")
    if len(failed) > MOST_FAILURES:
        print(f"... and {len(failed) - MOST_FAILURES} more" + ("" if "part" in summary else ", see points.csv"))
    if warned := sum(bool(row["warnings"]) for row in result.rows):
        print(f"{warned} points with warnings, see points.csv")
    counted = f"{summary['points']} points, {summary['computed_now']} of them computed now, {len(failed)} failed"
    share = f"part {summary['part']}: " if "part" in summary else ""
    print(f"{share}{counted}; {summary['wall_clock']:.1f} s")
    print(f"files in {result.out}")
    if share:
        print("the same command without --part, once all parts are there, writes table, fits and figure")


def _short(value: Any) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)


def _parameter(fit: dict[str, Any], name: str) -> str:
    """A fitted parameter with its interval; "none" where the law does not fit."""
    value, pair = fit["values"][name], fit["intervals_95"].get(name)
    if value is None:
        return "none"
    return f"{value:.4g}" + (f" [{pair[0]:.4g}, {pair[1]:.4g}]" if pair and None not in pair else "")
