"""From the table of a sweep to curves, their scatter over lattices, and the fits that its kind of scene asks for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from taichi_disk.config.sweep_axes import target_of
from taichi_disk.figures import theory
from taichi_disk.figures.theory import Fit
from taichi_disk.lattice import Array
from taichi_disk.scenes import Scene

Row = dict[str, Any]
OF_CURVE = ("lattices", "young", "poisson", "x", "mean", "standard_deviation", "fits")  # in a summary, beside the label

# What the moduli depend on.
MATERIAL = {("material", "k_a"), ("lattice", "points"), ("lattice", "min_spacing"), ("lattice", "file")}


@dataclass(frozen=True)
class Curve:
    """One line of a figure: everything but speed (or pressure) and seed is the same along it.

    Attributes:
        label: the values of the other axes.
        x: (points,) speed [c], or pressure [M c^2/R].
        results: (lattices, points) of each result; lattices of which a point failed are left out.
        young, poisson: of the material [M c^2/R^2], mean over its lattices in the sweep: each lattice's are those of a
            sample of its own, not of its disk. NaN for lattices from a file.
        damped: whether there are dashpots.
    """

    label: dict[str, Any]
    x: Array
    results: dict[str, Array]
    young: float
    poisson: float
    damped: bool
    fits: dict[str, Fit] = field(default_factory=dict)

    @property
    def y(self) -> Array:
        """(lattices, points) the primary result."""
        return next(iter(self.results.values()))

    @property
    def mean(self) -> Array:
        return np.asarray(self.y.mean(0))

    @property
    def deviation(self) -> Array | None:
        """(points,) standard deviation over lattices; one alone has none."""
        return np.asarray(self.y.std(0, ddof=1)) if len(self.y) > 1 else None

    def summary(self) -> dict[str, Any]:
        """For summary.json: fits with intervals and residuals, and the moduli."""
        return {
            **self.label,
            "lattices": len(self.y),
            "young": _number(self.young),
            "poisson": _number(self.poisson),
            "x": self.x.tolist(),
            "mean": self.mean.tolist(),
            "standard_deviation": None if self.deviation is None else self.deviation.tolist(),
            "fits": {
                name: {
                    "values": {key: _number(value) for key, value in fit.values.items()},
                    "intervals_95": {key: [_number(edge) for edge in pair] for key, pair in fit.intervals.items()},
                    "rms_residual": _number(fit.rms),
                    "residuals": [_number(value) for value in fit.residuals],
                }
                for name, fit in self.fits.items()
            },
        }


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None  # a law that does not fit at all


class FitRule(NamedTuple):
    """What is fitted to curves of so many `points`, only to those with moduli, or with dashpots, if that is needed.

    `fastest`: speed up to which the law has a meaning [c], with moduli [sqrt(E/M) R].
    """

    title: str
    fit: Callable[[Curve], Fit]
    points: int = 1
    moduli: bool = False
    damped: bool = False
    fastest: float = np.inf

    def applies(self, curve: Curve) -> bool:
        unit = curve.young**0.5 if self.moduli else 1.0
        known = bool(np.isfinite(unit)) and bool(curve.x.max() <= self.fastest * unit)
        return known and len(curve.x) >= self.points and (curve.damped or not self.damped)


FITS = {
    "eq2": FitRule("eq. (2)", lambda c: theory.fit_b(c.x, c.y, c.young, c.poisson), moduli=True),
    "eq2_nominal": FitRule(
        "eq. (2), xi = |R - R'|", lambda c: theory.fit_b(c.x, c.results["xi_nominal"], c.young, c.poisson), moduli=True
    ),
    "eq5": FitRule("eq. (5)", lambda c: theory.fit_restitution(c.x, c.y), points=3, fastest=3.9),
    "eq5_d1_is_1": FitRule(
        "eq. (5), d1 = 1", lambda c: theory.fit_restitution(c.x, c.y, d1_is_1=True), points=3, fastest=3.9
    ),
    "curvature": FitRule("curvature of e(v)", lambda c: theory.fit_curvature(c.x, c.y), points=8),
    "eq4": FitRule(
        "eq. (4) integrated", lambda c: theory.fit_tau0(c.x, c.y, c.young), 3, moduli=True, damped=True, fastest=2.2
    ),
}


class PaperFigure(NamedTuple):
    """What is known of the figure of one kind of scene: names of fits, and what the paper found by them."""

    fits: tuple[str, ...]
    paper: dict[str, float]


FIGURES = {
    "compression": PaperFigure(("eq2", "eq2_nominal"), {"b": 1.55}),
    "exponential_wall": PaperFigure(("eq5", "eq5_d1_is_1", "curvature", "eq4"), {}),
    "absorbing_wall": PaperFigure(("eq5", "eq5_d1_is_1", "curvature"), {"d1": 0.973, "d2": 0.119}),
}  # by the kind of scene


def analyse(base: Scene, axes: Sequence[str], rows: Sequence[Row]) -> list[Curve]:
    """Curves and fits of the rows of points.csv; none where neither speed nor pressure is swept, or without a figure.

    Args:
        base: a scene of the sweep, for what is not swept.
        axes: the swept keys.
    """
    figure, names = FIGURES.get(base.scene), {target_of(base, name): name for name in axes}
    abscissa, seed = names.get(base.abscissa) if figure else None, names.get(("lattice", "seed"))
    if figure is None or abscissa is None:
        return []
    others = [name for name in axes if name not in (abscissa, seed)]
    of_material = [name for name in others if target_of(base, name) in MATERIAL]
    alike, curves = _grouped([row for row in rows if row["status"] == "done"], of_material), []
    for values, members in _grouped(rows, others).items():
        label = dict(zip(others, values, strict=True))
        done = {(row[seed] if seed else 0, row[abscissa]): row for row in members if row["status"] == "done"}
        x = sorted({row[abscissa] for row in members})
        lattices = [one for one in sorted({one for one, _ in done}) if all((one, at) in done for at in x)]
        if not lattices:
            continue
        y = {name: np.array([[done[one, at][name] for at in x] for one in lattices], float) for name in base.results}
        # Of each lattice once: they need not have the same number of rows. None becomes NaN.
        same = alike[tuple(label[name] for name in of_material)]
        moduli = {row[seed] if seed else 0: (row["young"], row["poisson"]) for row in same}
        young, poisson = np.array(list(moduli.values()), float).mean(axis=0)
        damped = bool(label.get(names.get(("material", "eta_star"), ""), base.material.eta_star))
        curve = Curve(label, np.array(x, float), y, float(young), float(poisson), damped)
        wanted = {name: FITS[name] for name in figure.fits}
        curve.fits.update({name: rule.fit(curve) for name, rule in wanted.items() if rule.applies(curve)})
        curves.append(curve)
    return curves


def _grouped(rows: Sequence[Row], names: Sequence[str]) -> dict[tuple[Any, ...], list[Row]]:
    """The rows by their values of `names`."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def print_curves(curves: Sequence[dict[str, Any]]) -> None:
    """Print the fits of curves, given as their `summary`, with 95 % intervals."""
    for curve in curves:
        label = {name: value for name, value in curve.items() if name not in OF_CURVE}
        given = [
            f"{name}: {value:g}" if isinstance(value, float) else f"{name}: {value}" for name, value in label.items()
        ]
        print(", ".join([*given, f"{curve['lattices']} lattice{'s' if curve['lattices'] > 1 else ''}"]))
        for name, fit in curve["fits"].items():
            shown = "   ".join(f"{key} = {_parameter(fit, key)}" for key in fit["values"])
            print(f"  {FITS[name].title:<24}{shown}")


def _parameter(fit: dict[str, Any], name: str) -> str:
    """A fitted parameter with its interval; "none" where the law does not fit."""
    value, pair = fit["values"][name], fit["intervals_95"].get(name)
    if value is None:
        return "none"
    return f"{value:.4g}" + (f" [{pair[0]:.4g}, {pair[1]:.4g}]" if pair and None not in pair else "")
