"""Curves of a sweep, fits of the laws for its kind of scene, and the paper's figures 2,
3 and 6."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes

from taichi_disk.figures import theory
from taichi_disk.figures.axes import (
    FONT,
    GREY,
    curve_label,
    curve_styles,
    explain_bars,
    log_if_wide,
    one_plot,
    to_change,
)
from taichi_disk.figures.theory import Fit
from taichi_disk.lattice import Array
from taichi_disk.output.files import atomic_write
from taichi_disk.output.inline import Plot
from taichi_disk.output.plot import STYLE, SUM, matplotlib_style
from taichi_disk.scenes import Scene
from taichi_disk.scenes.compression import exact_compression, paper_compression
from taichi_disk.scenes.sweep_axes import target_of

Row = dict[str, Any]
# Keys in the summary of a curve that follow its label.
CURVE_KEYS = ("lattices", "young", "poisson", "x", "mean", "standard_deviation", "fits")
# The moduli depend on these keys.
MATERIAL = {
    ("material", "k_a"),
    ("lattice", "points"),
    ("lattice", "min_spacing"),
    ("lattice", "file"),
}
# Line styles of laws that do not hold: long dashes instead of a solid line, short ones
# instead of a dotted line.
LONG_DASHES: Any = (0.0, (7.0, 2.5))
SHORT_DASHES: Any = (0.0, (2.5, 2.0))
METADATA: dict[str, dict[str, Any]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}


@dataclass(frozen=True)
class Curve:
    """A curve of a figure: results against speed or pressure for several lattices, all
    other keys being equal."""

    label: dict[str, Any]  # values of the other axes
    x: Array  # (points,) speeds [c] or pressures [M c^2/R]
    # (lattices, points) of each result, without lattices with failed points
    results: dict[str, Array]
    # E [M c^2/R^2], mean over samples with the seeds of the sweep; NaN for lattices
    # from a file
    young: float
    poisson: float  # nu, as for E
    is_damped: bool  # whether there are dashpots
    fits: dict[str, Fit] = field(default_factory=dict)

    @property
    def y(self) -> Array:
        return next(iter(self.results.values()))

    @property
    def mean(self) -> Array:
        return np.asarray(self.y.mean(0))

    @property
    def deviation(self) -> Array | None:
        """Standard deviation over lattices (points,), or None for a single lattice."""
        if self.lattices == 1:
            return None
        return np.asarray(self.y.std(0, ddof=1))

    @property
    def lattices(self) -> int:
        return len(self.y)

    def summary(self) -> dict[str, Any]:
        deviation = None
        if self.deviation is not None:
            deviation = self.deviation.tolist()
        return {
            **self.label,
            "lattices": self.lattices,
            "young": _number(self.young),
            "poisson": _number(self.poisson),
            "x": self.x.tolist(),
            "mean": self.mean.tolist(),
            "standard_deviation": deviation,
            "fits": {name: _fit_summary(fit) for name, fit in self.fits.items()},
        }


def _fit_summary(fit: Fit) -> dict[str, Any]:
    intervals = {}
    for name, (low, high) in fit.intervals.items():
        intervals[name] = [_number(low), _number(high)]
    return {
        "values": {name: _number(value) for name, value in fit.values.items()},
        "intervals_95": intervals,
        "rms_residual": _number(fit.rms),
        "rms_over_scatter": _number(fit.misfit),
        "holds": fit.holds,
        "residuals": [_number(value) for value in fit.residuals],
    }


def _number(value: float) -> float | None:
    if np.isfinite(value):
        return float(value)
    return None  # the law cannot be fitted, or there is only one lattice


class FitRule(NamedTuple):
    """A law and the curves to which it can be fitted."""

    title: str
    fit: Callable[[Curve], Fit]
    min_points: int = 1  # number of points that a curve needs
    needs_moduli: bool = False  # whether the moduli must be known
    needs_damping: bool = False  # whether there must be dashpots
    # up to which the law is valid [c], or [sqrt(E/M) R] if it needs moduli
    max_speed: float = np.inf

    def applies(self, curve: Curve) -> bool:
        unit = 1.0
        if self.needs_moduli:
            unit = curve.young**0.5
        if not np.isfinite(unit) or curve.x.max() > self.max_speed * unit:
            return False
        if self.needs_damping and not curve.is_damped:
            return False
        return len(curve.x) >= self.min_points


FITS = {
    "eq2": FitRule(
        "eq. (2)",
        lambda c: theory.fit_b(c.x, c.y, c.young, c.poisson),
        needs_moduli=True,
    ),
    "eq2_nominal": FitRule(
        "eq. (2), xi = |R - R'|",
        lambda c: theory.fit_b(c.x, c.results["xi_nominal"], c.young, c.poisson),
        needs_moduli=True,
    ),
    "eq5": FitRule(
        "eq. (5)",
        lambda c: theory.fit_restitution(c.x, c.y),
        min_points=3,
        max_speed=3.9,
    ),
    "eq5_d1_is_1": FitRule(
        "eq. (5), d1 = 1",
        lambda c: theory.fit_restitution(c.x, c.y, d1_is_1=True),
        min_points=3,
        max_speed=3.9,
    ),
    "curvature": FitRule(
        "curvature of e(v)", lambda c: theory.fit_curvature(c.x, c.y), min_points=8
    ),
    "eq4": FitRule(
        "eq. (4) integrated",
        lambda c: theory.fit_tau0(c.x, c.y, c.young),
        min_points=3,
        needs_moduli=True,
        needs_damping=True,
        max_speed=2.2,
    ),
}


def analyse(base: Scene, axes: Sequence[str], rows: Sequence[Row]) -> list[Curve]:
    """Return the curves with their fits from `rows` of points.csv, or an empty list if
    the sweep has no figure.

    `base`: a scene of the sweep, for the keys that are not swept; `axes`: the swept
        keys.
    """
    figure = FIGURES.get(base.scene)
    if figure is None:
        return []
    names = {target_of(base, name): name for name in axes}
    abscissa = names.get(base.abscissa)
    if abscissa is None:
        return []
    seed = names.get(("lattice", "seed"), "")  # no column if it is not swept
    others = [name for name in axes if name not in (abscissa, seed)]
    of_material = [name for name in others if target_of(base, name) in MATERIAL]
    done = [row for row in rows if row["status"] == "done"]
    by_material = grouped(done, of_material)
    curves = []
    for values, members in grouped(rows, others).items():
        label = dict(zip(others, values, strict=True))
        x, results = _measured(members, abscissa, seed, base.results)
        if results is None:
            continue
        same_material = by_material[tuple(label[name] for name in of_material)]
        young, poisson = _mean_moduli(same_material, seed)
        curve = Curve(
            label=label,
            x=x,
            results=results,
            young=young,
            poisson=poisson,
            is_damped=_is_damped(base, label),
        )
        fits = {}
        for name in figure.fits:
            rule = FITS[name]
            if rule.applies(curve):
                fits[name] = rule.fit(curve)
        curves.append(replace(curve, fits=fits))
    return curves


def _measured(
    rows: Sequence[Row], abscissa: str, seed: str, names: Sequence[str]
) -> tuple[Array, dict[str, Array] | None]:
    """Return the places x (points,) of a curve, and each result (lattices, points) of
    the lattices without a failed point; None if there is no such lattice."""
    places = sorted({row[abscissa] for row in rows})
    by_lattice: dict[Any, dict[Any, Row]] = {}
    for row in rows:
        if row["status"] == "done":
            by_lattice.setdefault(row.get(seed, 0), {})[row[abscissa]] = row
    complete = []
    for lattice in sorted(by_lattice):
        if len(by_lattice[lattice]) == len(places):
            complete.append(by_lattice[lattice])
    x = np.array(places, float)
    if not complete:
        return x, None
    results = {}
    for name in names:
        table = [_values(row_at, places, name) for row_at in complete]
        results[name] = np.array(table, float)
    return x, results


def _values(row_at: Mapping[Any, Row], places: Iterable[Any], name: str) -> list[Any]:
    return [row_at[place][name] for place in places]


def _mean_moduli(rows: Sequence[Row], seed: str) -> tuple[float, float]:
    """Return E and nu, means over lattices; a lattice counts once even if it has
    several rows. NaN if they are unknown."""
    moduli = {}
    for row in rows:
        moduli[row.get(seed, 0)] = (row["young"], row["poisson"])
    young, poisson = np.array(list(moduli.values()), float).mean(axis=0)
    return float(young), float(poisson)


def _is_damped(base: Scene, label: dict[str, Any]) -> bool:
    swept = {}
    for name, value in label.items():
        target = target_of(base, name)
        if target is not None and target[0] == "material":
            swept[target[1]] = value
    _key, viscosity = replace(base.material, **swept).dashpots
    return viscosity != 0.0


def grouped(
    rows: Sequence[Row], names: Sequence[str]
) -> dict[tuple[Any, ...], list[Row]]:
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


# ---- drawing, as wide as a column of a journal


def draw(scene: Scene, curves: list[Curve], out: Path) -> None:
    """Write figure.png, figure.svg and figure.pdf of a sweep with `scene`. The same
    values give the same bytes."""
    # A fixed salt makes the ids in the SVG reproducible.
    with matplotlib_style({**STYLE, **FONT, "svg.hashsalt": "taichi-disk"}):
        figure = _drawn(scene, curves)
        for kind, metadata in METADATA.items():
            atomic_write(
                out / f"figure.{kind}", partial(figure.savefig, metadata=metadata)
            )


def curves_figure(scene: Scene, curves: list[Curve]) -> Plot:
    with matplotlib_style({**STYLE, **FONT}):
        return to_change(_drawn(scene, curves))


def _drawn(scene: Scene, curves: list[Curve]) -> Plot:
    layout = FIGURES[scene.scene]
    figure, ax = one_plot(2.9 + 0.09 * len(curves))
    layout.draw(ax, layout.paper, curves)
    if ax.containers:  # E is known, unlike that of lattices from a file
        figure.legend(loc="outside upper center", ncols=2)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # keeps the layout the same in all formats
    return figure


def _points(
    ax: Axes,
    curves: list[Curve],
    place: Callable[[Curve], tuple[Array, Array]],
    bars: str = "yerr",
) -> list[Any]:
    """Draw the points of each curve with error bars, the scatter over lattices, and
    return the colours. `place`: returns x and y of a curve."""
    styles = curve_styles(len(curves))
    for curve, style in zip(curves, styles, strict=True):
        x, y = place(curve)
        label = curve_label(curve.label)
        options = {**style, bars: curve.deviation}
        ax.errorbar(x, y, label=label, markersize=3.5, linestyle="none", **options)
    explain_bars(ax, [curve.lattices for curve in curves])
    return [style["color"] for style in styles]


def _force(pressure: Array, curve: Curve) -> Array:
    return pressure / (np.pi * curve.young)


def _compression(ax: Axes, paper: dict[str, float], curves: list[Curve]) -> None:
    """Draw figure 2: P/(pi R E) against xi/R, with the laws for the first curve that
    has several pressures."""
    ax.set_xlabel("compression  ξ/R")
    ax.set_ylabel("force  P/(π R E)")
    curves = [curve for curve in curves if np.isfinite(curve.young)]
    _points(ax, curves, lambda c: (c.mean, _force(c.x, c)), bars="xerr")
    with_law = [curve for curve in curves if len(curve.x) > 1]
    if not with_law:
        return
    first = with_law[0]
    E = first.young
    nu = first.poisson
    P = np.linspace(first.x.min(), first.x.max(), 60)
    force = _force(P, first)
    fit = first.fits["eq2"]
    b = fit.values["b"]
    printed = paper["b"]
    fitted_style = "-"
    fitted = f"eq. (2), b = {b:.3f} fitted"
    if not fit.holds:
        fitted_style = LONG_DASHES
        fitted = "eq. (2), which fails"
    lines = [
        (paper_compression(P, E, nu, b), fitted_style, fitted),
        (paper_compression(P, E, nu, printed), ":", f"eq. (2), b = {printed} (paper)"),
        (exact_compression(P, E, nu), "--", "exact law, rigid wall"),
    ]
    for xi, style, text in lines:
        ax.plot(xi, force, linestyle=style, color=SUM, label=text)


def _impact(ax: Axes, paper: dict[str, float], curves: list[Curve]) -> None:
    """Draw figures 3 and 6: restitution against speed, with the laws of each curve."""
    ax.set_xlabel("impact speed  v/c")
    ax.set_ylabel("coefficient of restitution  e")
    colours = _points(ax, curves, lambda c: (c.x, c.mean))
    for law in LAWS:
        _draw_law(ax, law, curves, colours)
    x = np.concatenate([curve.x for curve in curves])
    if paper:
        v = np.geomspace(x.min(), x.max(), 80)
        e = theory.paper_restitution(v, paper["d1"], paper["d2"])
        text = f"paper: d₁ = {paper['d1']}, d₂ = {paper['d2']}"
        ax.plot(v, e, "-.", color=SUM, label=text)
    log_if_wide(ax, x)


def _eq5(curve: Curve, fit: Fit) -> tuple[Array, Array]:
    """Return speeds and e of eq. (5)."""
    v = np.geomspace(curve.x.min(), curve.x.max(), 80)
    return v, theory.paper_restitution(v, fit.values["d1"], fit.values["d2"])


def _eq4(curve: Curve, fit: Fit) -> tuple[Array, Array]:
    """Return speeds and e of eq. (4)."""
    predict = theory.quasistatic_curves(tuple(curve.x.tolist()), curve.young)
    return curve.x, predict(np.array([fit.values["tau0"]]))[0]


class DrawnLaw(NamedTuple):
    """A law of figures 3 and 6 and the styles of its lines."""

    fit: str
    title: str
    fitted: str  # title where the law holds
    line: Callable[[Curve, Fit], tuple[Array, Array]]
    style: str
    misfit_style: Any


LAWS = (
    DrawnLaw("eq5", "eq. (5)", "eq. (5), d₁ and d₂ fitted", _eq5, "-", LONG_DASHES),
    DrawnLaw("eq4", "eq. (4)", "eq. (4), τ₀ fitted", _eq4, ":", SHORT_DASHES),
)


def _draw_law(
    ax: Axes, law: DrawnLaw, curves: Sequence[Curve], colours: Sequence[Any]
) -> None:
    """Draw the line of a law for each curve, and add both styles to the legend."""
    labels = {}
    for curve, colour in zip(curves, colours, strict=True):
        fit = curve.fits.get(law.fit)
        if fit is None or not np.isfinite(list(fit.values.values())).all():
            continue
        style = law.style
        label = law.fitted
        if not fit.holds:
            style = law.misfit_style
            label = f"{law.title} where it fails"
        labels[label] = style
        ax.plot(*law.line(curve, fit), linestyle=style, color=colour)
    for label, style in labels.items():
        ax.plot([], [], linestyle=style, color=GREY, label=label)


class PaperFigure(NamedTuple):
    """Layout of the figure for one kind of scene: fits, parameters in the paper, and
    the drawing function."""

    fits: tuple[str, ...]
    paper: dict[str, float]
    draw: Callable[[Axes, dict[str, float], list[Curve]], None]


FIGURES = {
    "compression": PaperFigure(("eq2", "eq2_nominal"), {"b": 1.55}, _compression),
    "exponential_wall": PaperFigure(
        ("eq5", "eq5_d1_is_1", "curvature", "eq4"), {}, _impact
    ),
    "absorbing_wall": PaperFigure(
        ("eq5", "eq5_d1_is_1", "curvature"), {"d1": 0.973, "d2": 0.119}, _impact
    ),
}  # figures by the kind of scene
