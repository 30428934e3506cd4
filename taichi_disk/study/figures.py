"""The figure of a sweep, on the axes of the paper's figures 2, 3 and 6."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from taichi_disk import theory
from taichi_disk.output import atomic_write
from taichi_disk.plot import STYLE
from taichi_disk.study.analysis import Analysis, Curve
from taichi_disk.study.comparison import PAPER_B, PAPER_D1, PAPER_D2

# Okabe and Ito's colours, which the colour-blind can tell apart.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#222222")
MARKS = "osD^vPX"
NAMES = {"eta_star": "η*", "a": "a", "points": "N", "boundary": "", "method": ""}


def draw(analysis: Analysis, out: Path) -> None:
    """Write figure.png and figure.svg into `out`; the same values give the same bytes."""
    # The salt makes the ids in the SVG the same every time.
    with matplotlib.rc_context({**STYLE, "svg.hashsalt": "taichi-disk"}):
        figure = Figure(figsize=(7.2, 5.2), dpi=140, layout="constrained")
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        (_compression if analysis.kind == "compression" else _impact)(ax, analysis.curves)
        if analysis.kind == "absorbing_wall" and analysis.curves:
            _paper_fit(ax, analysis.curves)
        if analysis.curves:
            ax.legend(loc="best")
        atomic_write(out / "figure.png", lambda path: figure.savefig(path, metadata={"Software": None}))
        atomic_write(out / "figure.svg", lambda path: figure.savefig(path, metadata={"Date": None}))


def _label(curve: Curve) -> str:
    parts = []
    for name, value in curve.label.items():
        short = NAMES.get(name.split(".")[-1], name)
        shown = f"{value:g}" if isinstance(value, (int, float)) and not isinstance(value, bool) else str(value)
        parts.append(f"{short} = {shown}" if short else shown)
    return ", ".join(parts) or f"{len(curve.y)} lattices"


def _points(ax: Axes, x: Any, curve: Curve, colour: str, mark: str) -> None:
    """Means with the standard deviation over lattices."""
    ax.errorbar(
        x, curve.mean, curve.deviation, color=colour, marker=mark, markersize=4, linestyle="none", elinewidth=0.8,
        capsize=2, label=_label(curve),
    )  # fmt: skip


def _compression(ax: Axes, curves: list[Curve]) -> None:
    """Figure 2: P/(pi R E) against xi/R."""
    for k, curve in enumerate(curves):
        colour, mark = COLOURS[k % len(COLOURS)], MARKS[k % len(MARKS)]
        scale = np.pi * curve.young
        for one in curve.y:
            ax.plot(one, curve.x / scale, ".", color=colour, markersize=3, alpha=0.3)
        ax.errorbar(
            curve.mean, curve.x / scale, xerr=curve.deviation, color=colour, marker=mark, markersize=4.5,
            linestyle="none", elinewidth=0.9, capsize=2, label=_label(curve),
        )  # fmt: skip
        if k == 0 and len(curve.x) > 1:
            P = np.linspace(curve.x.min(), curve.x.max(), 60)
            b = curve.fits["eq2"].values["b"]
            paper = theory.paper_compression(P, curve.young, curve.poisson, PAPER_B)
            for law, style, text in (
                (theory.paper_compression(P, curve.young, curve.poisson, b), "-", f"eq. (2), fitted b = {b:.3f}"),
                (paper, ":", f"eq. (2), the paper's b = {PAPER_B}"),
                (theory.exact_compression(P, curve.young, curve.poisson), "--", "exact law, rigid wall"),
            ):
                ax.plot(law, P / scale, style, color="#222222", linewidth=1.1, label=text)
    ax.set_xlabel("compression  ξ/R")
    ax.set_ylabel("force  P/(π R E)")


def _impact(ax: Axes, curves: list[Curve]) -> None:
    """Figures 3 and 6: v/c against e, with eq. (5) as fitted (lines) and eq. (4) with its tau0 fitted (dots)."""
    for k, curve in enumerate(curves):
        colour = COLOURS[k % len(COLOURS)]
        _points(ax, curve.x, curve, colour, MARKS[k % len(MARKS)])
        v = np.linspace(curve.x.min(), curve.x.max(), 80)
        fit = curve.fits.get("eq5")
        if fit is not None and np.isfinite(fit.values["d1"]):
            ax.plot(v, theory.paper_restitution(v, fit.values["d1"], fit.values["d2"]), color=colour, linewidth=1.0)
        if "eq4" in curve.fits:
            e = theory.quasistatic_restitution(v[::8], curve.fits["eq4"].values["tau0"], curve.young)
            ax.plot(v[::8], e, ":", color=colour, linewidth=1.0)
    ax.set_xlabel("impact speed  v/c")
    ax.set_ylabel("coefficient of restitution  e")


def _paper_fit(ax: Axes, curves: list[Curve]) -> None:
    """The line of the paper's figure 6."""
    v = np.linspace(min(curve.x.min() for curve in curves), max(curve.x.max() for curve in curves), 80)
    text = f"eq. (5), the paper's d1 = {PAPER_D1}, d2 = {PAPER_D2}"
    ax.plot(v, theory.paper_restitution(v, PAPER_D1, PAPER_D2), ":", color="#222222", linewidth=1.1, label=text)
