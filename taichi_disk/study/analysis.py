"""From the table of a sweep to curves, their scatter over lattices, and fits of the paper's laws."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.study.fits import Fit, fit_b, fit_curvature, fit_restitution, fit_tau0
from taichi_disk.sweep_axes import target_of

Array = NDArray[np.float64]
ABSCISSA = {"compression": ("compression", "pressure")}  # of an impact: its velocity
MATERIAL = {("material", "k_a"), ("lattice", "points"), ("lattice", "min_spacing")}  # what the moduli depend on
ORDINATE = {"compression": "xi"}  # of an impact: the restitution


@dataclass(frozen=True)
class Curve:
    """One line of a figure: everything but speed (or pressure) and seed is the same along it.

    `x` (points,), `y` (lattices, points); lattices of which a point failed are left out.
    """

    label: dict[str, Any]
    x: Array
    y: Array
    young: float
    poisson: float
    fits: dict[str, Fit] = field(default_factory=dict)

    @property
    def mean(self) -> Array:
        return np.asarray(self.y.mean(0))

    @property
    def deviation(self) -> Array:
        """Standard deviation over lattices, 0 where there is one only."""
        return self.y.std(0, ddof=1) if len(self.y) > 1 else np.zeros(len(self.x))


@dataclass(frozen=True)
class Analysis:
    """A sweep as curves; `kind` is that of its scenes."""

    kind: str
    curves: list[Curve]

    def summary(self) -> dict[str, Any]:
        """For summary.json: every curve's fits with intervals and residuals, and the moduli."""
        return {"curves": [_summary(curve) for curve in self.curves]}


def analyse(kind: str, axes: Sequence[str], rows: Sequence[dict[str, Any]]) -> Analysis:
    """Curves and fits of the rows of points.csv; `axes` are the swept keys."""
    section, key = ABSCISSA.get(kind, ("impact", "velocity"))
    abscissa = [name for name in axes if target_of(kind, name) == (section, key)]
    seeds = [name for name in axes if target_of(kind, name) == ("lattice", "seed")]
    if not abscissa:
        return Analysis(kind, [])
    others = [name for name in axes if name not in abscissa + seeds]
    groups: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    for row in rows:
        groups.setdefault(tuple(row.get(name) for name in others), []).append(row)
    material = [name for name in others if target_of(kind, name) in MATERIAL]
    curves = []
    for values, members in groups.items():
        label = dict(zip(others, values, strict=True))
        alike = [row for row in rows if all(row.get(name) == label[name] for name in material)]
        curve = _curve(
            label, members, alike, abscissa[0], seeds[0] if seeds else None, ORDINATE.get(kind, "restitution")
        )
        if curve is not None:
            curve.fits.update(_fits(kind, label, curve))
            if kind == "compression":
                nominal = _curve(label, members, alike, abscissa[0], seeds[0] if seeds else None, "xi_nominal")
                assert nominal is not None
                curve.fits["eq2_nominal"] = fit_b(nominal.x, nominal.y, curve.young, curve.poisson)
            curves.append(curve)
    return Analysis(kind, curves)


def _curve(
    label: dict[str, Any], rows: list[dict[str, Any]], alike: list[dict[str, Any]], x: str, seed: str | None, y: str
) -> Curve | None:
    """The curve of `rows`; the moduli are the mean over the lattices of all rows `alike` in material."""
    found = {(row[seed] if seed else 0, row[x]): row[y] for row in rows if row["status"] == "done"}
    abscissae = sorted({row[x] for row in rows})
    lattices = sorted({row[seed] if seed else 0 for row in rows})
    table = [[found.get((one, at)) for at in abscissae] for one in lattices]
    whole = [line for line in table if None not in line]
    if not whole:
        return None
    # Each lattice once: they need not have the same number of rows.
    moduli = {row[seed] if seed else 0: (row["young"], row["poisson"]) for row in alike if row["status"] == "done"}
    young, poisson = (float(one) for one in np.mean(list(moduli.values()), axis=0))
    return Curve(label, np.array(abscissae, float), np.array(whole, float), young, poisson)


def _fits(kind: str, label: dict[str, Any], curve: Curve) -> dict[str, Fit]:
    if kind == "compression":
        return {"eq2": fit_b(curve.x, curve.y, curve.young, curve.poisson)}
    if len(curve.x) < 3:
        return {}
    fits = {
        "eq5": fit_restitution(curve.x, curve.y),
        "eq5_d1_is_1": fit_restitution(curve.x, curve.y, d1_is_1=True),
    }
    if len(curve.x) >= 8:
        fits["curvature"] = fit_curvature(curve.x, curve.y)
    eta = [value for name, value in label.items() if name.split(".")[-1] == "eta_star"]
    if kind == "exponential_wall" and eta and eta[0] > 0:
        fits["eq4"] = fit_tau0(curve.x, curve.y, curve.young)
    return fits


def _summary(curve: Curve) -> dict[str, Any]:
    def number(value: float) -> float | None:
        return float(value) if np.isfinite(value) else None  # a law that does not fit at all

    fits = {
        name: {
            "values": {key: number(value) for key, value in fit.values.items()},
            "intervals_95": {key: [number(edge) for edge in pair] for key, pair in fit.intervals.items()},
            "rms_residual": number(fit.rms),
            "residuals": [number(value) for value in fit.residuals],
        }
        for name, fit in curve.fits.items()
    }
    return {
        **curve.label,
        "lattices": len(curve.y),
        "young": curve.young,
        "poisson": curve.poisson,
        "x": curve.x.tolist(),
        "mean": curve.mean.tolist(),
        "standard_deviation": curve.deviation.tolist(),
        "fits": fits,
    }
