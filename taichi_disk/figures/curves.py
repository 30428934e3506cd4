"""From the table of a sweep to curves, the fits that its kind of scene asks for, and the paper's figures 2, 3 and 6."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from taichi_disk.config.conflicts import dashpots
from taichi_disk.figures import theory
from taichi_disk.figures.theory import Fit
from taichi_disk.lattice import Array
from taichi_disk.output.files import atomic_write
from taichi_disk.output.inline import Plot
from taichi_disk.output.plot import STYLE, SUM, matplotlib_style
from taichi_disk.scenes import Scene
from taichi_disk.scenes.sweep_axes import Sweep, target_of

Row = dict[str, Any]
OF_CURVE = ("lattices", "young", "poisson", "x", "mean", "standard_deviation", "fits")  # in a summary, beside the label
# What the moduli depend on.
MATERIAL = {("material", "k_a"), ("lattice", "points"), ("lattice", "min_spacing"), ("lattice", "file")}

MARKS = "osD^vPX"
NAMES = {"eta_star": "η*", "viscosity": "η", "points": "N", "boundary": "", "method": ""}
FONT: dict[Any, Any] = {
    "font.size": 9,
    "legend.fontsize": 8,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.0,
    "lines.linewidth": 1.0,
    "errorbar.capsize": 1.5,
    "savefig.dpi": 300,
}
METADATA: dict[str, dict[str, Any]] = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}


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
    alike, curves = grouped([row for row in rows if row["status"] == "done"], of_material), []
    for values, members in grouped(rows, others).items():
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
        swept = {to[1]: label[name] for to, name in names.items() if to and to[0] == "material" and name in label}
        damped = bool(dashpots(replace(base.material, **swept)))
        curve = Curve(label, np.array(x, float), y, float(young), float(poisson), damped)
        wanted = {name: FITS[name] for name in figure.fits}
        curve.fits.update({name: rule.fit(curve) for name, rule in wanted.items() if rule.applies(curve)})
        curves.append(curve)
    return curves


def grouped(rows: Sequence[Row], names: Sequence[str]) -> dict[tuple[Any, ...], list[Row]]:
    """Return the rows by their values of `names`."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def print_curves(curves: Sequence[dict[str, Any]]) -> None:
    """Print the fits of curves, given as their `summary`, with 95 % intervals."""
    for label, fits in curve_rows(curves):
        print(label)
        for title, shown in fits:
            print(f"  {title:<24}{shown}")


def curve_rows(curves: Sequence[dict[str, Any]]) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """What a curve is, and the law and parameters of each of its fits, in words."""
    for curve in curves:
        swept = {name: value for name, value in curve.items() if name not in OF_CURVE}
        given = [
            f"{name}: {value:g}" if isinstance(value, float) else f"{name}: {value}" for name, value in swept.items()
        ]
        label = ", ".join([*given, f"{curve['lattices']} lattice{'s' if curve['lattices'] > 1 else ''}"])
        found = {
            name: [f"{key} = {_parameter(fit, key)}" for key in fit["values"]] for name, fit in curve["fits"].items()
        }
        yield label, [(FITS[name].title, "   ".join(parts)) for name, parts in found.items()]


def _parameter(fit: dict[str, Any], name: str) -> str:
    """A fitted parameter with its interval; "none" where the law does not fit."""
    value, pair = fit["values"][name], fit["intervals_95"].get(name)
    if value is None:
        return "none"
    return f"{value:.4g}" + (f" [{pair[0]:.4g}, {pair[1]:.4g}]" if pair and None not in pair else "")


# ---- drawing: as wide as a column of a journal


def figure_of(sweep: Sweep, rows: Sequence[Row], out: Path) -> list[dict[str, Any]]:
    """Draw the rows of points.csv, where their kind of scene has a figure; the curves, as in summary.json."""
    curves = analyse(sweep.scenes[0], sweep.axes, rows)
    if curves:
        draw(sweep.scenes[0], curves, out)
    return [curve.summary() for curve in curves]


def draw(scene: Scene, curves: list[Curve], out: Path) -> None:
    """Write figure.png, figure.svg and figure.pdf into `out`; the same values give the same bytes.

    `scene` is one of the sweep.
    """
    # The salt makes the ids in the SVG the same every time.
    with matplotlib_style({**STYLE, **FONT, "svg.hashsalt": "taichi-disk"}):
        figure = _drawn(scene, curves)
        for kind, metadata in METADATA.items():
            atomic_write(out / f"figure.{kind}", partial(figure.savefig, metadata=metadata))


def curves_figure(scene: Scene, curves: list[Curve]) -> Plot:
    """The same as a figure to look at, or to change."""
    with matplotlib_style({**STYLE, **FONT}):
        return to_change(_drawn(scene, curves))


def to_change(figure: Plot) -> Plot:
    """Give ticks that are made later the style, too, and lay the figure out whenever it is drawn."""
    figure.set_layout_engine("constrained")
    for ax in figure.axes:
        look = {"grid_color": STYLE["grid.color"], "grid_linewidth": STYLE["grid.linewidth"]}
        ax.tick_params(which="both", labelsize=FONT["font.size"], **look)
    figure.draw_without_rendering()
    figure.set_dpi(200)
    return figure


def one_plot(height: float) -> tuple[Plot, Axes]:
    """Return a figure as wide as a column of a journal, `height` [inch] high, and its axes."""
    figure = Plot(figsize=(3.4, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots()


def _drawn(scene: Scene, curves: list[Curve]) -> Plot:
    figure, ax = one_plot(2.9 + 0.09 * len(curves))
    known = FIGURES[scene.scene]
    known.draw(ax, known.paper, curves)
    # Points before lines: their curves in order, then the laws.
    entries = sorted(zip(*ax.get_legend_handles_labels(), strict=True), key=lambda one: isinstance(one[0], Line2D))
    if entries:  # no force over E without an E, as of a lattice from a file
        figure.legend(*zip(*entries, strict=True), loc="outside upper center", ncols=2)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # laid out once for all formats
    return figure


def named(label: dict[str, Any]) -> str:
    """Return what a curve is called in a legend, from the values of its axes."""
    parts = []
    for name, value in label.items():
        short = NAMES.get(name.split(".")[-1], name)
        shown = f"{value:.4g}" if isinstance(value, float) else str(value)
        parts.append(f"{short} = {shown}" if short else shown)
    return ", ".join(parts) or "simulated"


def _points(ax: Axes, curves: list[Curve], upright: bool) -> list[Any]:
    """The mean of each curve with the scatter of its lattices; `upright`: against x, else x against it.

    Returns their colours, along a scale in the order of the curves.
    """
    colours = list(matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, len(curves))))
    for k, (curve, colour) in enumerate(zip(curves, colours, strict=True)):
        force = curve.x / (np.pi * curve.young)
        values = (curve.x, curve.mean, curve.deviation) if upright else (curve.mean, force, None, curve.deviation)
        style = {"color": colour, "marker": MARKS[k % len(MARKS)], "markersize": 3.5 if upright else 4.0}
        ax.errorbar(*values, **style, linestyle="none", elinewidth=0.8, label=named(curve.label))
    if counts := sorted({len(curve.y) for curve in curves if len(curve.y) > 1}):
        text = f"bars: {' or '.join(map(str, counts))} lattices"
        ax.errorbar([], [], [], color="0.45", linestyle="none", elinewidth=0.8, label=text)
    return colours


def _compression(ax: Axes, paper: dict[str, float], curves: list[Curve]) -> None:
    """Figure 2: P/(pi R E) against xi/R, with the laws for the first curve of several pressures."""
    curves = [curve for curve in curves if np.isfinite(curve.young)]
    _points(ax, curves, upright=False)
    first = next((curve for curve in curves if len(curve.x) > 1), None)
    if first is not None:
        P = np.linspace(first.x.min(), first.x.max(), 60)
        b, printed = first.fits["eq2"].values["b"], paper["b"]
        for law, style, text in (
            (theory.paper_compression(P, first.young, first.poisson, b), "-", f"eq. (2), b = {b:.3f} fitted"),
            (theory.paper_compression(P, first.young, first.poisson, printed), ":", f"eq. (2), b = {printed} (paper)"),
            (theory.exact_compression(P, first.young, first.poisson), "--", "exact law, rigid wall"),
        ):
            ax.plot(law, P / (np.pi * first.young), style, color=SUM, label=text)
    ax.set_xlabel("compression  ξ/R")
    ax.set_ylabel("force  P/(π R E)")


def _impact(ax: Axes, paper: dict[str, float], curves: list[Curve]) -> None:
    """Figures 3 and 6: e against v/c, with eq. (5) as fitted, and eq. (4) with its tau0 fitted."""
    colours = _points(ax, curves, upright=True)
    for curve, colour in zip(curves, colours, strict=True):
        fit = curve.fits.get("eq5")
        if fit is not None and np.isfinite(fit.values["d1"]):
            v = np.geomspace(curve.x.min(), curve.x.max(), 80)
            ax.plot(v, theory.paper_restitution(v, fit.values["d1"], fit.values["d2"]), color=colour)
        if "eq4" in curve.fits:
            predict = theory.quasistatic_curves(tuple(curve.x.tolist()), curve.young)
            e = predict(np.array([curve.fits["eq4"].values["tau0"]]))[0]
            ax.plot(curve.x, e, ":", color=colour)
    for name, style, text in (("eq5", "-", "eq. (5), d₁ and d₂ fitted"), ("eq4", ":", "eq. (4), τ₀ fitted")):
        if any(name in curve.fits for curve in curves):
            ax.plot([], [], style, color="0.45", label=text)
    x = np.concatenate([curve.x for curve in curves])
    if paper:
        v = np.geomspace(x.min(), x.max(), 80)
        text = f"eq. (5), paper: d₁ = {paper['d1']}, d₂ = {paper['d2']}"
        ax.plot(v, theory.paper_restitution(v, paper["d1"], paper["d2"]), "--", color=SUM, label=text)
    log_if_wide(ax, x)
    ax.set_xlabel("impact speed  v/c")
    ax.set_ylabel("coefficient of restitution  e")


def log_if_wide(ax: Axes, x: Array) -> None:
    """Make the axis of positive `x` logarithmic if they span a factor of 4; on a shorter axis labels would crowd."""
    if x.max() >= 4.0 * x.min() > 0.0:
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())


class PaperFigure(NamedTuple):
    """The figure of one kind of scene: names of fits, what the paper found by them, what draws its axes."""

    fits: tuple[str, ...]
    paper: dict[str, float]
    draw: Callable[[Axes, dict[str, float], list[Curve]], None]


FIGURES = {
    "compression": PaperFigure(("eq2", "eq2_nominal"), {"b": 1.55}, _compression),
    "exponential_wall": PaperFigure(("eq5", "eq5_d1_is_1", "curvature", "eq4"), {}, _impact),
    "absorbing_wall": PaperFigure(("eq5", "eq5_d1_is_1", "curvature"), {"d1": 0.973, "d2": 0.119}, _impact),
}  # by the kind of scene
