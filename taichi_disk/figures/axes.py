"""Axes, colours and labels that all figures of sweeps share."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.ticker import LogLocator, NullFormatter

from taichi_disk.lattice import Array
from taichi_disk.output.inline import Plot
from taichi_disk.output.plot import STYLE

MARKERS = "osD^vPX"
COLOURS = matplotlib.colormaps["plasma"]
LIGHTEST = 0.62  # place in COLOURS whose contrast to white is 3.2
GREY = "0.45"
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


def to_change(figure: Plot) -> Plot:
    """Prepare a figure for changes: new ticks get its style, and its layout is computed
    whenever it is drawn."""
    figure.set_layout_engine("constrained")
    grid_style = {
        "grid_color": STYLE["grid.color"],
        "grid_linewidth": STYLE["grid.linewidth"],
    }
    for ax in figure.axes:
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


def curve_label(label: dict[str, Any]) -> str:
    parts = []
    for name, value in label.items():
        symbol = SYMBOLS.get(name.split(".")[-1], name)
        text = str(value)
        if isinstance(value, float):
            text = f"{value:.4g}"
        if symbol:
            text = f"{symbol} = {text}"
        parts.append(text)
    return ", ".join(parts) or "simulated"


def curve_styles(count: int) -> list[dict[str, Any]]:
    """Return colour and marker of each curve. The order of the curves is that of
    lightness."""
    colours = COLOURS(np.linspace(0.0, LIGHTEST, count))
    styles = []
    for k, colour in enumerate(colours):
        marker = MARKERS[k % len(MARKERS)]
        styles.append({"color": colour, "marker": marker, "elinewidth": 0.8})
    return styles


def explain_bars(ax: Axes, lattices: Iterable[int]) -> None:
    """Add the meaning of the bars to the legend. `lattices`: numbers of lattices in the
    means."""
    counts = sorted({count for count in lattices if count > 1})
    if counts:
        label = f"bars: {' or '.join(map(str, counts))} lattices"
        style: dict[str, Any] = {"color": GREY, "linestyle": "none", "elinewidth": 0.8}
        ax.errorbar([], [], [], label=label, **style)


def log_if_wide(ax: Axes, x: Array) -> None:
    """Make the axis of positive `x` logarithmic if they span a factor of 4; on a
    shorter axis labels would overlap."""
    if x.max() >= 4.0 * x.min() > 0.0:
        ax.set_xscale("log")
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
