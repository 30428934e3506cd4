"""The curves that one wants to see first, in one PNG."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from textwrap import fill
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from taichi_disk.output import atomic_write

Columns = dict[str, NDArray[np.float64]]

STYLE: dict[Any, Any] = {
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "0.35",
    "axes.grid": True,
    "grid.color": "0.91",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "axes.formatter.use_mathtext": True,
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}
LINE, _MARK = "#0072B2", "0.45"
_AT_REST = 1e-8  # of the largest kinetic energy: its square root is the vibration's amplitude
# Okabe and Ito's colours, which the colour-blind can tell apart.
_ENERGIES = (
    ("kinetic", "kinetic", "#0072B2"),
    ("elastic", "elastic", "#D55E00"),
    ("wall", "wall potential", "#E69F00"),
    ("load", "potential of the load", "#56B4E9"),
    ("dissipated", "dissipated by dashpots", "#009E73"),
    ("absorbed", "absorbed at the boundary", "#CC79A7"),
    ("sliding", "lost from one wall spring to the next", "#999999"),
)


def plot_run(path: Path, kind: str, columns: Columns, headline: dict[str, float], title: str) -> None:
    """Draw a run's time series into a PNG; the same values give the same bytes.

    `kind`: compression, exponential_wall or absorbing_wall. `columns`: named as in timeseries.csv, and
    `residual` (largest force on a point) of a compression in time. `headline`: its xi, or an impact's
    restitution and contact_time. Units of M, R and c.
    """
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(7.6, 9.2), dpi=120, layout="constrained")
        FigureCanvasAgg(figure)
        ratios = (1.2, 1.0, 1.5, 0.8) if kind != "compression" or "residual" in columns else (1.2, 1.0, 1.5)
        axes = list(figure.subplots(len(ratios), 1, sharex=True, height_ratios=ratios))
        figure.suptitle(fill(title, 95), fontsize=9.5, fontweight="bold")
        (_compression if kind == "compression" else _impact)(axes, columns, headline)
        _curve(axes[1], columns["t"], columns["wall_force"], "wall's force on\nthe disk  [Mc²/R]")
        _energies(axes[2], columns)
        moving = bool(columns["kinetic"].any())
        axes[-1].set_xlabel("time  [R/c]" if moving else "from the unloaded disk (0) to the equilibrium (1)")
        axes[-1].set_xlim(columns["t"][0], last_motion(kind, columns))
        figure.align_ylabels(axes)
        atomic_write(path, lambda beside: figure.savefig(beside, metadata={"Software": None}))


def last_motion(kind: str, columns: Columns) -> float:
    """Where the time axis ends: a pressed disk at rest is not worth looking at."""
    t, kinetic = columns["t"], columns["kinetic"]
    if kind != "compression":
        return float(t[-1])
    moving = np.flatnonzero(kinetic > _AT_REST * kinetic.max())
    return float(t[moving[-1]] if moving.size else t[-1])


def _curve(ax: Axes, t: NDArray[np.float64], values: NDArray[np.float64], label: str) -> None:
    ax.plot(t, values, color=LINE)
    ax.set_ylabel(label)


def _mark(ax: Axes, level: float, text: str, x: float) -> None:
    """A dashed line across the panel, its meaning below it from the fraction `x` of the width on."""
    ax.axhline(level, color=_MARK, linewidth=1.0, linestyle=(0, (5, 4)))
    ax.annotate(text, (x, level), (0, -3), ax.get_yaxis_transform(), "offset points", va="top", color="0.2")


def motion(kind: str, columns: Columns, headline: dict[str, float]) -> tuple[NDArray[np.float64], str]:
    """What a run is about, (rows,), and its name: the velocity after an impact, or the compression."""
    if kind == "compression":
        height = columns["com_y"] - columns["lowest_y"]
        return headline["xi"] + height[-1] - height, "compression ξ  [R]"
    return columns["com_vy"] / -columns["com_vy"][0], "velocity of the centre\nof mass, $v_{cm}/v$"


def energies(columns: Columns) -> Iterator[tuple[str, NDArray[np.float64], str]]:
    """(name, (rows,) [M c^2], colour) of every kind of energy that this run knows; that of the load from its start."""
    for name, label, colour in _ENERGIES:
        values = columns.get(name)
        if values is not None and values.any():
            yield label, values - values[0] if name == "load" else values, colour


def _impact(axes: list[Axes], columns: Columns, headline: dict[str, float]) -> None:
    top, force, _, balance = axes
    t = columns["t"]
    _curve(top, t, *motion("impact", columns, headline))
    _mark(top, headline["restitution"], f"e = {headline['restitution']:.5f}", 0.02)
    contact = f"contact time {headline['contact_time']:.4g} R/c"
    force.annotate(contact, (0.988, 0.92), xycoords="axes fraction", ha="right", va="top", color="0.2")
    imbalance = (columns["total"] - columns["total"][0]) / columns["kinetic"][0]
    _curve(balance, t, imbalance, "energy imbalance\n/ initial kinetic")


def _compression(axes: list[Axes], columns: Columns, headline: dict[str, float]) -> None:
    _curve(axes[0], columns["t"], *motion("compression", columns, headline))
    _mark(axes[0], headline["xi"], f"ξ = {headline['xi']:.6g} R", 0.7)
    if "residual" in columns:
        _curve(axes[3], columns["t"], columns["residual"], "largest force on\na point  [Mc²/R]")
        axes[3].set_yscale("log")


def _energies(ax: Axes, columns: Columns) -> None:
    start = columns["load"][0] if "load" in columns else 0.0
    for label, values, colour in energies(columns):
        ax.plot(columns["t"], values, color=colour, label=label)
    ax.plot(columns["t"], columns["total"] - start, color="#222222", linestyle=(0, (4, 2)), label="sum of all")
    ax.set_ylabel("energy  [Mc²]")
    ax.legend(loc="lower center", bbox_to_anchor=(0.54, 1.0), ncols=4, borderaxespad=0.2, columnspacing=1.4)
