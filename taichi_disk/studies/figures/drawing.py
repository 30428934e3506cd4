"""Draw the curves of a sweep, with the laws that they do not refute, as wide as a
column of a journal."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from pathlib import Path
from textwrap import fill
from typing import Any, NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.ticker import LogLocator, NullFormatter

from taichi_disk.base.files import atomic_write
from taichi_disk.experiments.scenes import compression, impact
from taichi_disk.mechanics.lattice import Array
from taichi_disk.pictures.inline import Plot
from taichi_disk.pictures.plot import STYLE, SUM, matplotlib_style, powers
from taichi_disk.studies.figures.curves import LAWS, Curve, Diagram, Line, Row, eq5
from taichi_disk.studies.figures.texts import as_text

Styled = tuple[Line, str, str]  # a line with its style and name
LABELS = compression.LABELS | impact.LABELS  # name and unit of each result
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
    "outline": "",
}
FONT = {
    "font.size": 9,
    "legend.fontsize": 8,
    "legend.handlelength": 1.6,
    "legend.columnspacing": 1.0,
    "lines.linewidth": 1.0,
    "errorbar.capsize": 1.5,
    "savefig.dpi": 300,
}
NAME_HEIGHT = 9.0  # of a name at the end of a curve [pt]
MAX_LABEL = 26  # number of letters up to which two columns of a legend fit
MAX_LINE = 56  # number of letters in a line of the caption
MAX_SPAN = 100.0  # of an axis with room for three labels to a decade
MAX_SHIFT = 14.0  # by which it may stand higher than the end [pt]
METADATA = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}


def draw(diagram: Diagram, out: Path) -> None:
    """Write figure.png, figure.svg and figure.pdf of a sweep. The same values give the
    same bytes."""
    # A fixed salt makes the ids in the SVG reproducible.
    with matplotlib_style({**STYLE, **FONT, "svg.hashsalt": "taichi-disk"}):
        figure = _drawn(diagram)
        figure.set_layout_engine("none")  # keeps the layout the same in all formats
        for kind, metadata in METADATA.items():
            atomic_write(
                out / f"figure.{kind}", partial(figure.savefig, metadata=metadata)
            )


def figure_to_change(diagram: Diagram) -> Plot:
    """Return a figure whose layout is computed whenever it is drawn, and whose new
    ticks get its style."""
    with matplotlib_style({**STYLE, **FONT}):
        figure = _drawn(diagram)
        for ax in figure.axes:
            ax.tick_params(
                which="both",
                labelsize=FONT["font.size"],
                grid_color=STYLE["grid.color"],
                grid_linewidth=STYLE["grid.linewidth"],
            )
        figure.set_dpi(200)
        return figure


class Layout(NamedTuple):
    """How a diagram is drawn: labels of its axes, what returns the places of a curve's
    x and results in them, along which axis the results are, and what returns lines to
    compare with."""

    x_label: str
    y_label: str
    place: Callable[[Curve, Array, Array], Line] = lambda curve, x, y: (x, y)
    bars: str = "yerr"
    references: Callable[[Curve], list[Styled]] = lambda curve: []


def _layout(diagram: Diagram) -> Layout:
    if diagram.is_of_laws:
        kind = diagram.base.scene
        has_moduli = all(np.isfinite(curve.young) for curve in diagram.curves)
        if kind != "compression" or has_moduli:
            return LAYOUTS[kind]
    section, key = diagram.x
    unit = diagram.base.sections()[section].schema()[key].unit
    symbol = SYMBOLS.get(key) or key.replace("_", " ")
    without_unit = (diagram.y.replace("_", " "), "")
    return Layout(_label(symbol, unit), _label(*LABELS.get(diagram.y, without_unit)))


def _label(name: str, unit: str) -> str:
    if unit:
        return f"{name}  [{unit}]"
    return name


def _force(curve: Curve, pressure: Array, xi: Array) -> Line:
    """Return compressions and forces as figure 2 has them: xi/R and P/(pi R E)."""
    return xi, pressure / (np.pi * curve.young)


def _compression_laws(curve: Curve) -> list[Styled]:
    P = np.linspace(curve.x.min(), curve.x.max(), 60)
    moduli = (curve.young, curve.poisson)
    paper = compression.paper_compression(P, *moduli, 1.55)
    exact = compression.exact_compression(P, *moduli)
    return [
        (_force(curve, P, paper), ":", "eq. (2), b = 1.55 (paper)"),
        (_force(curve, P, exact), "--", "exact law, rigid wall"),
    ]


SPEED = "impact speed  v/c"
RESTITUTION = "coefficient of restitution  e"
# by the kind of scene
LAYOUTS = {
    "compression": Layout(
        "compression  ξ/R", "force  P/(π R E)", _force, "xerr", _compression_laws
    ),
    "exponential_wall": Layout(SPEED, RESTITUTION),
    "absorbing_wall": Layout(
        SPEED,
        RESTITUTION,
        references=lambda curve: [
            (eq5(curve, 0.973, 0.119), "-.", "paper: d₁ = 0.973, d₂ = 0.119")
        ],
    ),
}


def _drawn(diagram: Diagram) -> Plot:
    layout = _layout(diagram)
    curves = diagram.curves
    figure = Plot(figsize=(3.4, 2.9), layout="constrained")
    FigureCanvasAgg(figure)
    ax = figure.subplots()
    ax.set_xlabel(layout.x_label)
    ax.set_ylabel(layout.y_label)
    ax.yaxis.set_major_formatter(powers())
    if layout.bars == "yerr":
        log_if_wide(ax, np.concatenate([curve.x for curve in curves]))
    if curves[0].is_of_words:
        figure.autofmt_xdate()  # turns the words
    styles = curve_styles(len(curves))
    drawn = []
    for curve, style in zip(curves, styles, strict=True):
        drawn.append(_draw_curve(ax, layout, curve, style))
    longest = max(curves, key=lambda curve: len(curve.x))
    for line, dashes, name in layout.references(longest):
        ax.plot(*line, dashes, color=SUM, label=name)
    figure.supxlabel(_caption(curves), fontsize=FONT["legend.fontsize"], color=GREY)
    figure.draw_without_rendering()
    # beside a law's line there is no room
    if len(curves) == 1 or layout.bars == "xerr" or not _name_ends(ax, drawn, curves):
        for container, curve in zip(drawn, curves, strict=True):
            container.set_label(curve_label(curve.label))
    labels = ax.get_legend_handles_labels()[1]
    if labels and labels != [curve_label({})]:
        columns = 1 + (max(map(len, labels)) <= MAX_LABEL)
        figure.set_figheight(2.9 + 0.14 * len(labels) / columns)
        figure.legend(loc="outside upper center", ncols=columns)
    figure.draw_without_rendering()
    return figure


def curve_styles(count: int) -> list[Row]:
    """Return colour and marker of each curve. The order of the curves is that of
    lightness."""
    colours = COLOURS(np.linspace(0.0, LIGHTEST, count))
    return [
        {"color": colour, "marker": MARKERS[k % len(MARKERS)]}
        for k, colour in enumerate(colours)
    ]


def _draw_curve(ax: Axes, layout: Layout, curve: Curve, style: Row) -> Any:
    """Draw the points of a curve with their bars, and the lines of its laws, or else a
    thin line through the points, unless words name them."""
    laws = _law_lines(curve)
    width = 0.5
    if laws or curve.is_of_words:
        width = 0.0
    options = dict(style)
    if curve.lattices > 1:
        options[layout.bars] = curve.half_widths
    points = ax.errorbar(
        *layout.place(curve, curve.x, curve.mean),
        linewidth=width,
        elinewidth=0.8,
        markersize=3.0,
        barsabove=True,
        **options,
    )
    for line, dashes, label in laws:
        if label in ax.get_legend_handles_labels()[1]:
            label = ""
        place = layout.place(curve, *line)
        ax.plot(*place, dashes, color=style["color"], label=label)
    return points


def _law_lines(curve: Curve) -> list[Styled]:
    """Return the lines of the laws that can be fitted to several points and are not
    refuted."""
    lines = []
    for name, fit in curve.fits.items():
        law = LAWS[name]
        is_fitted = np.isfinite(list(fit.values.values())).all()
        if law.line and len(curve.x) > 1 and is_fitted and not fit.is_refuted:
            lines.append((law.line(curve, fit), law.style, law.legend))
    return lines


def _caption(curves: Sequence[Curve]) -> str:
    """Say what the bars are, and which laws are refuted."""
    lines = []
    counts = set()
    for curve in curves:
        counts.update(np.isfinite(curve.y).sum(axis=0).tolist())
    counts.discard(1)
    if counts:
        lattices = " or ".join(map(str, sorted(counts)))
        lines.append(f"Bars: 95 % interval of the mean, {lattices} lattices.")
    if any(curve.folded for curve in curves):
        lines.append("Points where lattices fold are in no fit.")
    refuted = []
    for name, law in LAWS.items():
        tried = [curve for curve in curves if law.line and name in curve.fits]
        refuting = [curve for curve in tried if curve.fits[name].is_refuted]
        if refuting:
            where = ""
            if len(refuting) < len(tried):
                labels = [curve_label(curve.label) for curve in refuting]
                where = f" for {'; '.join(labels)}"
            title = law.title[0].upper() + law.title[1:]
            refuted.append(f"{title} is refuted{where}.")
    if refuted:
        lines.append(fill(" ".join(refuted), MAX_LINE))
    return "\n".join(lines)


def curve_label(label: Row) -> str:
    parts = []
    for name, value in label.items():
        symbol = SYMBOLS.get(name.split(".")[-1], name)
        text = as_text(value)
        if symbol:
            text = f"{symbol} = {text}"
        parts.append(text)
    return ", ".join(parts) or "simulated"


def _name_ends(ax: Axes, drawn: Sequence[Any], curves: Sequence[Curve]) -> bool:
    """Write the name of each curve at its right end, and return True, unless there is
    too little room for them."""
    lines = [container.lines[0] for container in drawn]
    ends = np.array([line.get_xydata()[-1] for line in lines])
    heights = ax.transData.transform(ends)[:, 1] * 72.0 / ax.figure.dpi  # [pt]
    order = np.argsort(heights, kind="stable")
    places = heights.copy()
    for below, above in pairwise(order):
        places[above] = max(places[above], places[below] + NAME_HEIGHT)
    shifts = places - heights
    if shifts.max() > MAX_SHIFT:
        return False
    for k in order:
        ax.annotate(
            curve_label(curves[k].label),
            ends[k],
            (5.0, shifts[k]),
            textcoords="offset points",
            va="center",
            color=lines[k].get_color(),
            fontsize=FONT["legend.fontsize"],
        )
    return True


def log_if_wide(ax: Axes, x: Array) -> None:
    """Make the axis of positive `x` logarithmic if they span a factor of 4; on a
    shorter axis labels would overlap. A linear axis has few labels, too."""
    ax.locator_params(axis="x", nbins=4, min_n_ticks=3)
    if x.dtype.kind == "f" and x.max() >= 4.0 * x.min() > 0.0:
        ax.set_xscale("log")
        labels = [1.0, 2.0, 5.0]  # of a decade
        if x.max() > MAX_SPAN * x.min():
            labels = [1.0]
        ax.xaxis.set_major_locator(LogLocator(subs=labels))
        ax.xaxis.set_major_formatter("{x:g}")
        ax.xaxis.set_minor_formatter(NullFormatter())
