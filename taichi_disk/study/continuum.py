"""What is left of the difference to the continuum's laws as the lattice grows finer and the wall harder.

From the rows of the sweeps docs/experiments/continuum_*.yaml, in Markdown. Errors are standard errors over lattices.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from math import hypot, pi, sqrt

import numpy as np
from numpy.typing import NDArray

from taichi_disk import theory
from taichi_disk.study.viscosity import contact_viscosity

Row = dict[str, str]  # of points.csv
Numbers = dict[str, NDArray[np.float64]]  # one value for each lattice
SEEDS = 2  # lattices on which a viscosity is measured


def compression(rows: Sequence[Row]) -> list[str]:
    """xi of the pressed disk against the exact law, with each lattice size's own moduli."""
    lines = [
        "The exact law of compression, with E and ν of lattices of the same N. Both means have a standard error; the "
        "last column combines them.",
        "",
        "| N | a [1/R] | lattices | P | mean ξ | exact law | ξ/law − 1 |",
        "|---|---|---|---|---|---|---|",
    ]
    for (points, a, P), one in _groups(rows, ("points", "a", "pressure"), ("xi", "young", "poisson")):
        E, nu = one["young"].mean(), one["poisson"].mean()
        law = float(theory.exact_compression(P, E, nu))
        softer = float(theory.exact_compression(P, E * 1.001, nu))
        # d ln(law)/d ln(E), which is a little less than -1.
        slope = (softer / law - 1.0) / 0.001
        error = hypot(_error(one["xi"]) / law, slope * _error(one["young"]) / E)
        lines.append(
            f"| {points:.0f} | {a:g} | {len(one['xi'])} | {P:g} | {one['xi'].mean():.6f} | {law:.6f} "
            f"| {one['xi'].mean() / law - 1:+.2%} ± {error:.2%} |"
        )
    return lines


def impact(rows: Sequence[Row]) -> list[str]:
    """e and contact time of the impact against eq. (4), integrated with the viscosity of the pressed contact."""
    lines = [
        "Impacts against equation (4), integrated, with E of the lattices and τ₀ of their pressed contact; η, not "
        "η\\*, is the same for all N.",
        "",
        "| N | a [1/R] | η\\* | τ₀ [R/c] | v [c] | e | eq. (4) | e − eq. (4) "
        "| contact time [R/c] | eq. (4) | Hertz's | contact time/eq. (4) − 1 |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    tau: dict[float, float] = {}  # of unit eta*, by N
    names = ("restitution", "contact_time", "young", "poisson")
    for (points, a, eta, v), one in _groups(rows, ("points", "a", "eta_star", "velocity"), names):
        E = float(one["young"].mean())
        if points not in tau:
            tau[points] = float(np.mean([contact_viscosity(seed, points=round(points), a=a) for seed in range(SEEDS)]))
        law = theory.quasistatic_impact(v, tau[points] * eta, E)
        hertz = float(theory.hertz_contact_time(v, sqrt(pi * E)))
        e, time = one["restitution"], one["contact_time"]
        lines.append(
            f"| {points:.0f} | {a:g} | {eta:g} | {tau[points] * eta:.4f} | {v:g} | {e.mean():.4f} | "
            f"{law.restitution:.4f} | {e.mean() - law.restitution:+.4f} ± {_error(e):.4f} | {time.mean():.3f} "
            f"| {law.contact_time:.3f} | {hertz:.3f} | {time.mean() / law.contact_time - 1:+.1%} |"
        )
    return lines


def _groups(
    rows: Sequence[Row], keys: tuple[str, ...], names: tuple[str, ...]
) -> Iterator[tuple[tuple[float, ...], Numbers]]:
    """The finished rows that agree in `keys`: those keys' values, and each of `names` over lattices."""
    found: dict[tuple[float, ...], list[Row]] = defaultdict(list)
    for row in rows:
        if row["status"] == "done":
            found[tuple(float(row[key]) for key in keys)].append(row)
    for values in sorted(found):
        yield values, {name: np.array([float(row[name]) for row in found[values]]) for name in names}


def _error(values: NDArray[np.float64]) -> float:
    """Standard error of the mean, 0 for a single lattice."""
    return float(values.std(ddof=1) / sqrt(len(values))) if len(values) > 1 else 0.0
