"""Curves of a sweep, fits of the laws for its kind of scene, and the paper's figures 2,
3 and 6."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
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

from taichi_disk.figures import theory
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

MARKERS = "osD^vPX"
SYMBOLS = {
    "eta_star": "η*",
    "viscosity": "η",
    "points": "N",
    "boundary": "",
    "method": "",
}
FONT: dict[Any, Any] = {
    "font.size": 9,
    "legend.fontsize": 8,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.0,
    "lines.linewidth": 1.0,
    "errorbar.capsize": 1.5,
    "savefig.dpi": 300,
}
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
        return np.asarray(self.y.std(0, ddof=1)) if len(self.y) > 1 else None

    def summary(self) -> dict[str, Any]:
        return {
            **self.label,
            "lattices": len(self.y),
            "young": _number(self.young),
            "poisson": _number(self.poisson),
            "x": self.x.tolist(),
            "mean": self.mean.tolist(),
            "standard_deviation": (
                None if self.deviation is None else self.deviation.tolist()
            ),
            "fits": {
                name: {
                    "values": {
                        key: _number(value) for key, value in fit.values.items()
                    },
                    "intervals_95": {
                        key: [_number(edge) for edge in pair]
                        for key, pair in fit.intervals.items()
                    },
                    "rms_residual": _number(fit.rms),
                    "residuals": [_number(value) for value in fit.residuals],
                }
                for name, fit in self.fits.items()
            },
        }


def _number(value: float) -> float | None:
    # None if the law cannot be fitted
    return float(value) if np.isfinite(value) else None


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
        unit = curve.young**0.5 if self.needs_moduli else 1.0
        is_valid = bool(np.isfinite(unit)) and bool(
            curve.x.max() <= self.max_speed * unit
        )
        return (
            is_valid
            and len(curve.x) >= self.min_points
            and (curve.is_damped or not self.needs_damping)
        )


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
    figure, names = (
        FIGURES.get(base.scene),
        {target_of(base, name): name for name in axes},
    )
    abscissa, seed = (
        names.get(base.abscissa) if figure else None,
        names.get(("lattice", "seed")),
    )
    if figure is None or abscissa is None:
        return []
    others = [name for name in axes if name not in (abscissa, seed)]
    of_material = [name for name in others if target_of(base, name) in MATERIAL]
    by_material, curves = (
        grouped([row for row in rows if row["status"] == "done"], of_material),
        [],
    )
    for values, members in grouped(rows, others).items():
        label = dict(zip(others, values, strict=True))
        done = {
            (row[seed] if seed else 0, row[abscissa]): row
            for row in members
            if row["status"] == "done"
        }
        x = sorted({row[abscissa] for row in members})
        lattices = [
            k
            for k in sorted({k for k, _ in done})
            if all((k, value) in done for value in x)
        ]
        if not lattices:
            continue
        y = {
            name: np.array(
                [[done[k, value][name] for value in x] for k in lattices], float
            )
            for name in base.results
        }
        # A lattice counts once even if it has several rows. None becomes NaN.
        same_material = by_material[tuple(label[name] for name in of_material)]
        moduli = {
            row[seed] if seed else 0: (row["young"], row["poisson"])
            for row in same_material
        }
        young, poisson = np.array(list(moduli.values()), float).mean(axis=0)
        swept = {
            to[1]: label[name]
            for to, name in names.items()
            if to and to[0] == "material" and name in label
        }
        is_damped = bool(replace(base.material, **swept).dashpots[1])
        curve = Curve(
            label, np.array(x, float), y, float(young), float(poisson), is_damped
        )
        curve.fits.update(
            {
                name: FITS[name].fit(curve)
                for name in figure.fits
                if FITS[name].applies(curve)
            }
        )
        curves.append(curve)
    return curves


def grouped(
    rows: Sequence[Row], names: Sequence[str]
) -> dict[tuple[Any, ...], list[Row]]:
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        groups.setdefault(tuple(row[name] for name in names), []).append(row)
    return groups


def curve_rows(
    curves: Sequence[dict[str, Any]],
) -> Iterator[tuple[str, list[tuple[str, str]]]]:
    """Yield for each of `curves`, results of `Curve.summary`, its label and a list of
    (law, parameters), as text."""
    for curve in curves:
        swept = {name: value for name, value in curve.items() if name not in CURVE_KEYS}
        keys = [
            f"{name}: {f'{value:g}' if isinstance(value, float) else value}"
            for name, value in swept.items()
        ]
        label = ", ".join(
            [
                *keys,
                f"{curve['lattices']} lattice{'s' if curve['lattices'] > 1 else ''}",
            ]
        )
        yield (
            label,
            [
                (FITS[name].title, _parameters(fit))
                for name, fit in curve["fits"].items()
            ],
        )


def _parameters(fit: dict[str, Any]) -> str:
    """Return the fitted parameters with their 95 % intervals, "none" if the law does
    not fit."""
    parts = []
    for name, value in fit["values"].items():
        pair = fit["intervals_95"].get(name) or [None]
        interval = "" if None in pair else f" [{pair[0]:.4g}, {pair[1]:.4g}]"
        parts.append(
            f"{name} = none" if value is None else f"{name} = {value:.4g}{interval}"
        )
    return "   ".join(parts)


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


def to_change(figure: Plot) -> Plot:
    """Prepare a figure for changes: new ticks get its style, and its layout is computed
    whenever it is drawn."""
    figure.set_layout_engine("constrained")
    for ax in figure.axes:
        grid_style = {
            "grid_color": STYLE["grid.color"],
            "grid_linewidth": STYLE["grid.linewidth"],
        }
        ax.tick_params(which="both", labelsize=FONT["font.size"], **grid_style)
    figure.draw_without_rendering()
    figure.set_dpi(200)
    return figure


def one_plot(height: float) -> tuple[Plot, Axes]:
    """Return a figure as wide as a column of a journal, `height` [inch] high, and its
    axes."""
    figure = Plot(figsize=(3.4, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots()


def _drawn(scene: Scene, curves: list[Curve]) -> Plot:
    figure, ax = one_plot(2.9 + 0.09 * len(curves))
    layout = FIGURES[scene.scene]
    layout.draw(ax, layout.paper, curves)
    # The legend lists the simulated points first, then the lines of the laws.
    entries = sorted(
        zip(*ax.get_legend_handles_labels(), strict=True),
        key=lambda entry: isinstance(entry[0], Line2D),
    )
    if entries:  # there are none if E is unknown, as for lattices from a file
        figure.legend(*zip(*entries, strict=True), loc="outside upper center", ncols=2)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # keeps the layout the same in all formats
    return figure


def curve_label(label: dict[str, Any]) -> str:
    parts = []
    for name, value in label.items():
        symbol = SYMBOLS.get(name.split(".")[-1], name)
        text = f"{value:.4g}" if isinstance(value, float) else str(value)
        parts.append(f"{symbol} = {text}" if symbol else text)
    return ", ".join(parts) or "simulated"


def curve_styles(count: int) -> list[dict[str, Any]]:
    colours = matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, count))
    return [
        {"color": rgba, "marker": MARKERS[k % len(MARKERS)], "elinewidth": 0.8}
        for k, rgba in enumerate(colours)
    ]


def explain_bars(ax: Axes, lattices: Iterable[int]) -> None:
    """Add the meaning of the bars to the legend. `lattices`: numbers of lattices in the
    means."""
    if several := sorted({count for count in lattices if count > 1}):
        text = f"bars: {' or '.join(map(str, several))} lattices"
        ax.errorbar(
            [], [], [], color="0.45", linestyle="none", elinewidth=0.8, label=text
        )


def _points(ax: Axes, curves: list[Curve], upright: bool) -> list[Any]:
    """Draw the mean and scatter over lattices of each curve; return the colours.
    `upright`: results on the y axis."""
    styles = curve_styles(len(curves))
    for curve, style in zip(curves, styles, strict=True):
        force = curve.x / (np.pi * curve.young)
        values = (
            (curve.x, curve.mean, curve.deviation)
            if upright
            else (curve.mean, force, None, curve.deviation)
        )
        size, label = 3.5 if upright else 4.0, curve_label(curve.label)
        ax.errorbar(*values, **style, markersize=size, linestyle="none", label=label)
    explain_bars(ax, (len(curve.y) for curve in curves))
    return [style["color"] for style in styles]


def _compression(ax: Axes, paper: dict[str, float], curves: list[Curve]) -> None:
    """Draw figure 2: P/(pi R E) against xi/R, with the laws for the first curve that
    has several pressures."""
    curves = [curve for curve in curves if np.isfinite(curve.young)]
    _points(ax, curves, upright=False)
    first = next((curve for curve in curves if len(curve.x) > 1), None)
    if first is not None:
        P = np.linspace(first.x.min(), first.x.max(), 60)
        b, printed = first.fits["eq2"].values["b"], paper["b"]
        for law, style, text in (
            (
                paper_compression(P, first.young, first.poisson, b),
                "-",
                f"eq. (2), b = {b:.3f} fitted",
            ),
            (
                paper_compression(P, first.young, first.poisson, printed),
                ":",
                f"eq. (2), b = {printed} (paper)",
            ),
            (
                exact_compression(P, first.young, first.poisson),
                "--",
                "exact law, rigid wall",
            ),
        ):
            ax.plot(law, P / (np.pi * first.young), style, color=SUM, label=text)
    ax.set_xlabel("compression  ξ/R")
    ax.set_ylabel("force  P/(π R E)")


def _impact(ax: Axes, paper: dict[str, float], curves: list[Curve]) -> None:
    colours = _points(ax, curves, upright=True)
    for curve, colour in zip(curves, colours, strict=True):
        fit = curve.fits.get("eq5")
        if fit is not None and np.isfinite(fit.values["d1"]):
            v = np.geomspace(curve.x.min(), curve.x.max(), 80)
            ax.plot(
                v,
                theory.paper_restitution(v, fit.values["d1"], fit.values["d2"]),
                color=colour,
            )
        if "eq4" in curve.fits:
            predict = theory.quasistatic_curves(tuple(curve.x.tolist()), curve.young)
            e = predict(np.array([curve.fits["eq4"].values["tau0"]]))[0]
            ax.plot(curve.x, e, ":", color=colour)
    for name, style, text in (
        ("eq5", "-", "eq. (5), d₁ and d₂ fitted"),
        ("eq4", ":", "eq. (4), τ₀ fitted"),
    ):
        if any(name in curve.fits for curve in curves):
            ax.plot([], [], style, color="0.45", label=text)
    x = np.concatenate([curve.x for curve in curves])
    if paper:
        v = np.geomspace(x.min(), x.max(), 80)
        text = f"eq. (5), paper: d₁ = {paper['d1']}, d₂ = {paper['d2']}"
        ax.plot(
            v,
            theory.paper_restitution(v, paper["d1"], paper["d2"]),
            "--",
            color=SUM,
            label=text,
        )
    log_if_wide(ax, x)
    ax.set_xlabel("impact speed  v/c")
    ax.set_ylabel("coefficient of restitution  e")


def log_if_wide(ax: Axes, x: Array) -> None:
    """Make the axis of positive `x` logarithmic if they span a factor of 4; on a
    shorter axis labels would overlap."""
    if x.max() >= 4.0 * x.min() > 0.0:
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())


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
