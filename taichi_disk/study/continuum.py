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
from taichi_disk.lattice import disk_lattice
from taichi_disk.study.hyperelastic import POISSON, finite_compression
from taichi_disk.study.small_strain import hard_compression
from taichi_disk.study.viscosity import contact_viscosity

Array = NDArray[np.float64]
Row = dict[str, str]  # of points.csv
Numbers = dict[str, Array]  # one value for each lattice
SEEDS = 2  # lattices on which a viscosity is measured, or the rim's springs are weakened
RIM_POINTS = 20_000  # largest lattice of which that is
POINTS, MOST_LATTICES = 300_000, 32  # points in all, and lattices at most, of a size that are pressed at small strains


def compression(rows: Sequence[Row]) -> list[str]:
    """xi of the pressed disk against the exact law, with the moduli of lattices of that size."""
    lines = [
        "The exact law of compression is one of small strains. *Small strains*: the lattice with linear springs on a "
        "perfectly hard wall; what is left there is its grain. *As simulated*: the disk of the scene, strained by some "
        "2 sqrt(P/(πE)) in the contact (5 % at P = 0.01), on a wall of the hardness a. E and ν are measured on as many "
        "lattices as were simulated; ± is the standard error of ξ and E together.",
        "",
        "*Finite strain* is what a continuum lies above the law for that strain alone: springs of all directions, all "
        "stretched as the whole is, by finite elements on a hard wall (`taichi_disk/study/hyperelastic.py`; neither "
        "lattice nor exponential wall has a part in it). *Left*: as simulated, less that.",
        "",
        "| N | a [1/R] | P | exact law | ξ/law − 1, small strains | lattices | ξ/law − 1, as simulated | lattices "
        "| finite strain | left |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    groups = list(_groups(rows, ("points", "a", "pressure"), ("xi", "young", "poisson")))
    for points in sorted({values[0] for values, _ in groups}):
        here = [(values, one) for values, one in groups if values[0] == points]
        pressures = [values[2] for values, _ in here]
        seeds = range(min(MOST_LATTICES, POINTS // round(points)))
        small = np.array([hard_compression(disk_lattice(round(points), seed), 1.0, pressures) for seed in seeds])
        for k, ((_, a, P), one) in enumerate(here):
            young = one["young"].mean()
            law = float(theory.exact_compression(P, young, one["poisson"].mean()))
            cells = " | ".join(f"{_against(xi, law, one['young'])} | {len(xi)}" for xi in (small[:, k], one["xi"]))
            strain = finite_compression(P, young) / float(theory.exact_compression(P, young, POISSON)) - 1.0
            left = one["xi"] - strain * law
            lines.append(
                f"| {points:.0f} | {a:g} | {P:g} | {law:.6f} | {cells} | {strain:+.2%} "
                f"| {_against(left, law, one['young'])} |"
            )
    return [*lines, "", *_rim(sorted({(round(values[0]), values[2]) for values, _ in groups}))]


def _rim(cases: Sequence[tuple[int, float]]) -> Iterator[str]:
    """What the rim's springs do to xi at small strains, at each (points, pressure)."""
    found = []
    for points in sorted({points for points, _ in cases if points <= RIM_POINTS}):
        pressures = [P for N, P in cases if points == N]
        disks = [disk_lattice(points, seed) for seed in range(SEEDS)]
        whole, half = (
            np.mean([hard_compression(disk, 1.0, pressures, share) for disk in disks], axis=0) for share in (1.0, 0.5)
        )
        changes = ", ".join(f"{change:+.2%}" for change in half / whole - 1.0)
        found.append(f"N = {points}: {changes}")
    if found:
        yield (
            "Some of the grain is the rim: a spring inside the disk belongs to two triangles, one along the rim to "
            "one, so that rim springs of the same k_a are a hoop that the continuum has not. With k_a/2 along the rim, "
            f"ξ at small strains is larger by (for each P above; {SEEDS} lattices) {'; '.join(found)}."
        )


def _against(xi: Array, law: float, young: Array) -> str:
    """The mean's distance to the law; the errors of both add up, xi going as 1/E or a little less."""
    return f"{xi.mean() / law - 1:+.2%} ± {hypot(_error(xi) / law, _error(young) / young.mean()):.2%}"


def impact(rows: Sequence[Row]) -> list[str]:
    """e and contact time of the impact against eq. (4), integrated with the viscosity of the pressed contact."""
    lines = [
        "Impacts against equation (4), integrated, with E of the lattices and τ₀ of their pressed contact; η, not "
        "η\\*, is the same for all N. Equation (4) is quasi-static: it knows of no energy left in vibrations. Without "
        "dashpots, single points still knock on the hard wall at the end, and contact lasts longer for it.",
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


def _error(values: Array) -> float:
    """Standard error of the mean, 0 for a single lattice."""
    return float(values.std(ddof=1) / sqrt(len(values))) if len(values) > 1 else 0.0
