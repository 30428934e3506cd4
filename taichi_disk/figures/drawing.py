"""The figure of a sweep, on the axes of the paper's figures 2, 3 and 6, as wide as a column of a journal."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from taichi_disk.config.sweep_axes import Sweep
from taichi_disk.figures import theory
from taichi_disk.figures.curves import FIGURES, Curve, Row, analyse
from taichi_disk.output.files import atomic_write
from taichi_disk.output.plot import STYLE, SUM, matplotlib_style
from taichi_disk.scenes import Scene

WIDTH = 3.4  # inches: a column
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


def figure_of(sweep: Sweep, rows: Sequence[Row], out: Path) -> list[dict[str, Any]]:
    """Draw the rows of points.csv, where their kind of scene has a figure; the curves, as in summary.json."""
    curves = analyse(sweep.scenes[0], sweep.axes, rows)
    if curves:
        draw(sweep.scenes[0], curves, out)
    return [curve.summary() for curve in curves]


def draw(scene: Scene, curves: list[Curve], out: Path) -> None:
    """Write figure.png, figure.svg and figure.pdf into `out`; the same values give the same bytes.

    `scene` is one of the sweep: the first fit of its kind says on which axes.
    """
    # The salt makes the ids in the SVG the same every time.
    with matplotlib_style({**STYLE, **FONT, "svg.hashsalt": "taichi-disk"}):
        figure = Figure(figsize=(WIDTH, 2.9 + 0.09 * len(curves)), layout="constrained")
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        known = FIGURES[scene.scene]
        (_compression if known.fits[0] == "eq2" else _impact)(ax, known.paper, curves)
        # Points before lines: their curves in order, then the laws.
        named = sorted(zip(*ax.get_legend_handles_labels(), strict=True), key=lambda one: isinstance(one[0], Line2D))
        if named:  # no force over E without an E, as of a lattice from a file
            figure.legend(*zip(*named, strict=True), loc="outside upper center", ncols=2)
        figure.draw_without_rendering()
        figure.set_layout_engine("none")  # laid out once for all formats
        for kind, metadata in METADATA.items():
            atomic_write(out / f"figure.{kind}", partial(figure.savefig, metadata=metadata))


def _colours(curves: list[Curve]) -> list[Any]:
    """Along a scale, in the order of the curves."""
    return list(matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, len(curves))))


def _named(curve: Curve) -> str:
    parts = []
    for name, value in curve.label.items():
        short = NAMES.get(name.split(".")[-1], name)
        shown = f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)
        parts.append(f"{short} = {shown}" if short else shown)
    return ", ".join(parts) or "simulated"


def _points(ax: Axes, curves: list[Curve], colours: list[Any], upright: bool) -> None:
    """The mean of each curve with the scatter of its lattices; `upright`: against x, else x against it."""
    for k, (curve, colour) in enumerate(zip(curves, colours, strict=True)):
        force = curve.x / (np.pi * curve.young)
        place = (curve.x, curve.mean, curve.deviation) if upright else (curve.mean, force, None, curve.deviation)
        style = {"color": colour, "marker": MARKS[k % len(MARKS)], "markersize": 3.5 if upright else 4.0}
        ax.errorbar(*place, **style, linestyle="none", elinewidth=0.8, label=_named(curve))
    if counts := sorted({len(curve.y) for curve in curves if len(curve.y) > 1}):
        text = f"bars: {' or '.join(map(str, counts))} lattices"
        ax.errorbar([], [], [], color="0.45", linestyle="none", elinewidth=0.8, label=text)


def _compression(ax: Axes, paper: dict[str, float], curves: list[Curve]) -> None:
    """Figure 2: P/(pi R E) against xi/R, with the laws for the first curve of several pressures."""
    curves = [curve for curve in curves if np.isfinite(curve.young)]
    _points(ax, curves, _colours(curves), upright=False)
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
    colours = _colours(curves)
    _points(ax, curves, colours, upright=True)
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
    if x.max() >= 4.0 * x.min():  # slow points would crowd; on a shorter axis labels would
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(FuncFormatter(lambda v, _: f"{v:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("impact speed  v/c")
    ax.set_ylabel("coefficient of restitution  e")
