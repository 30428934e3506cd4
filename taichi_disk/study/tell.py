"""What a person reads at the end of a sweep."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from taichi_disk.study.sweep import SweepResult

SHOWN = {
    "eq2": "eq. (2)",
    "eq2_nominal": "eq. (2), xi = |R - R'|",
    "eq5": "eq. (5)",
    "eq5_d1_is_1": "eq. (5), d1 = 1",
    "eq4": "eq. (4) integrated",
    "curvature": "curvature of e(v)",
}
MOST_FAILURES = 10


def print_sweep(result: SweepResult) -> None:
    """Print fits with their 95 % intervals, what failed, and where the files are."""
    for curve in result.summary["curves"]:
        print(curve_title(curve))
        for name, fit in curve["fits"].items():
            print(f"  {SHOWN[name]:<24}{'   '.join(_parameters(fit))}")
    failed = result.failed
    for row in failed[:MOST_FAILURES]:
        given = ", ".join(f"{name}: {row[name]}" for name in result.summary["axes"] if row[name] is not None)
        print(f"failed at {given}: {row['reason']}")
    if len(failed) > MOST_FAILURES:
        print(f"... and {len(failed) - MOST_FAILURES} more, see points.csv")
    counted = f"{len(result.rows)} points, {result.summary['computed_now']} of them computed now"
    print(f"{counted}, {len(failed)} failed; {result.summary['wall_clock']:.1f} s")
    print(f"files in {result.out}")


def curve_title(curve: dict[str, Any]) -> str:
    """The curve's swept values and its number of lattices."""
    known = ("lattices", "young", "poisson", "x", "mean", "standard_deviation", "fits")
    given = {name: value for name, value in curve.items() if name not in known}
    shown = [f"{name}: {value:g}" if isinstance(value, float) else f"{name}: {value}" for name, value in given.items()]
    return ", ".join([*shown, f"{curve['lattices']} lattice{'s' if curve['lattices'] > 1 else ''}"])


def _parameters(fit: dict[str, Any]) -> Iterator[str]:
    for name, value in fit["values"].items():
        pair = fit["intervals_95"].get(name)
        shown = "none" if value is None else f"{value:.4g}"
        yield f"{name} = {shown}" + (f" [{pair[0]:.4g}, {pair[1]:.4g}]" if pair and None not in pair else "")
