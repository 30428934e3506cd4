"""Draw the curves beside a film with Matplotlib: as they will be, and as they were."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.output.files import Array
from taichi_disk.output.plot import PANEL_HEIGHTS, STYLE, TimeCurve, matplotlib_style

Picture = NDArray[np.uint8]
Box = tuple[int, int, int, int]

# Distances are in units of the size of the titles' letters.
_TOP = 2.3
_BETWEEN = 2.5
_BOTTOM = 3.7
_LEFT = 2.9
_RIGHT = 1.0
_TITLE_ABOVE = 0.6  # baseline of a title above its axes
_TICK_LETTERS = 0.9
_LINE = 0.15  # width of a curve
_POWERS = (-1, 2)  # powers of ten from -1 to 2 are not factored out
RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_STEP = 3  # distance of places that are tried for a name [px]
_CLEAR = 0.2  # least distance of a name to a curve
_FAR = 2.0  # a larger distance to other curves is no better


@dataclass(frozen=True)
class PanelScene:
    """What the panel shows.

    Attributes:
        t: (k,) times [R/c], evenly over the panel's width.
        curves: values (k,) in units of their axes, and colours of the theme.
        labels: of the axes, from top to bottom.
        size: of the picture (width, height) [px].
        letter: size of the titles' letters [px].
        colours: of ground, ink, faint words, rules and coming curves, by name.
    """

    t: Array
    curves: list[TimeCurve]
    labels: list[str]
    time_label: str
    size: tuple[int, int]
    letter: float
    colours: dict[str, Any]


@dataclass(frozen=True)
class PanelPictures:
    """The drawn panel.

    Attributes:
        coming, past: pictures (height, width, 4) with grey and with coloured curves.
        boxes: left, right, top and bottom of each pair of axes [px].
        rows: of each curve, its row [px] at each column of the axes.
        names: left, right, top and bottom of the names of curves [px].
    """

    coming: Picture
    past: Picture
    boxes: list[Box]
    rows: list[Array]
    names: list[Box]


# Colours of curves on a dark ground.
ON_DARK = {
    "#00806A": "#2FC79B",
    "#1A1A1E": "#EDEDE8",
    "#C23F00": "#FF7F50",
    "#8F6500": "#E0B040",
    "#1F6FB5": "#4FB3F0",
    "#8E5BC0": "#C9A0F0",
    "#882255": "#E88AB4",
    "#B0478A": "#F0A0CF",
    "#6F7A00": "#C8D050",
    "#6B6B6B": "#ABABAB",
    "#8C5A2B": "#D9A066",
}


def factored(label: str, largest: float) -> tuple[str, float]:
    """Return an axis label with a power of ten in its unit, chosen by the `largest`
    value of the axis, and the power (1 if the label stays)."""
    power = math.floor(math.log10(largest)) if largest > 0.0 else 0
    if _POWERS[0] <= power <= _POWERS[1] or "[" not in label:
        return label, 1.0
    raised = str(power).translate(RAISED)
    return label.replace("[", f"[10{raised} "), 10.0**power


def draw_panel(scene: PanelScene) -> PanelPictures:
    """Draw the panel of `scene`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = scene.size
    # Slightly larger, because Matplotlib rounds down; a point is a pixel.
    size = (width + 0.1) / 72.0, (height + 0.1) / 72.0
    with matplotlib_style(_style(scene)):
        figure = Figure(figsize=size, dpi=72.0)
        canvas = FigureCanvasAgg(figure)
        axes = _axes(figure, scene)
        lines = []
        for curve in scene.curves:
            coming = scene.colours["coming"]
            lines += axes[curve.panel].plot(scene.t, curve.values, color=coming)
        rows = [_rows(line, height) for line in lines]
        boxes = [_box(ax, height) for ax in axes]
        names = _write_names(figure, scene, boxes[2], rows)
        canvas.draw()
        image = np.asarray(canvas.buffer_rgba())
        grey = image.copy()
        # draws only the curves again, which takes a tenth of the time
        for curve, line in zip(scene.curves, lines, strict=True):
            line.set_color(curve.colour)
            line.axes.draw_artist(line)
        return PanelPictures(grey, image.copy(), boxes, rows, names)


def _axes(figure: Any, scene: PanelScene) -> Any:
    """Return the axes, without their curves."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    axes = figure.subplots(
        len(PANEL_HEIGHTS),
        sharex=True,
        height_ratios=PANEL_HEIGHTS,
        gridspec_kw=_margins(scene),
    )
    plain = FuncFormatter(lambda value, _: f"{value:.6g}".replace("-", "−"))
    inks = [scene.curves[0].colour, scene.colours["ink"], scene.colours["ink"]]
    for ax, label, ink in zip(axes, scene.labels, inks, strict=True):
        ax.xaxis.set_major_formatter(plain)
        ax.yaxis.set_major_formatter(plain)
        ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 3, 5, 10]))
        ax.set_title(label.replace("  ", " "), color=ink)
    axes[-1].xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], prune="both"))
    axes[-1].set_xlabel(scene.time_label.replace("  ", " "))
    return axes


def _margins(scene: PanelScene) -> dict[str, float]:
    """Return where the axes begin and end, and the space between them, as fractions of
    the figure and of the mean height of the axes."""
    letter = scene.letter
    width, height = scene.size
    room = height - (_TOP + 2 * _BETWEEN + _BOTTOM) * letter
    mean_height = room / len(PANEL_HEIGHTS)
    return {
        "left": _LEFT * letter / width,
        "right": 1.0 - _RIGHT * letter / width,
        "top": 1.0 - _TOP * letter / height,
        "bottom": _BOTTOM * letter / height,
        "hspace": _BETWEEN * letter / mean_height,
    }


def _rows(line: Any, height: int) -> Array:
    """Return the row of a curve at each column of its axes [px]."""
    line.axes.get_ylim()  # lets Matplotlib choose the limits
    columns, rows = line.axes.transData.transform(line.get_xydata()).T
    left, right, _, _ = _box(line.axes, height)
    return np.interp(np.arange(left, right), columns, height - rows)


def _box(ax: Any, height: int) -> Box:
    left, bottom, right, top = ax.get_window_extent().extents
    return round(left), round(right), round(height - top), round(height - bottom)


# ---- names of the energies


def _write_names(
    figure: Any, scene: PanelScene, box: Box, rows: list[Array]
) -> list[Box]:
    """Write each name beside its curve in the axes `box`, where it is far from the
    others; if there is no such place, in the line of the title. Return the boxes of the
    names."""
    named = [k for k, curve in enumerate(scene.curves) if curve.name]
    named.sort(key=lambda k: -float(np.ptp(rows[k])))
    left, beyond, top, _ = box
    _, height = scene.size
    letter = _TICK_LETTERS * scene.letter
    names: list[Box] = []
    edges: list[Array] = []  # of the names, like `rows`
    for k in named:
        curve = scene.curves[k]
        text = figure.text(0, 0, curve.name, color=curve.colour, transform=None)
        wide = math.ceil(text.get_window_extent().width)
        others = [rows[other] for other in named if other != k]
        place = _place(rows[k], [*others, *edges], (wide, letter), box)
        if place is None:
            x = beyond - wide
            baseline = top - _TITLE_ABOVE * scene.letter
            beyond = round(x - letter)
        else:
            x, baseline = place
        text.set_position((x, height - baseline))
        high = round(baseline - 0.85 * letter)
        low = round(baseline + 0.25 * letter)
        names.append((x, x + wide, high, low))
        first = max(round(x - left - letter), 0)
        for row in (high, low):
            edge = np.full(len(rows[k]), np.inf)
            edge[first : round(x - left + wide + letter)] = row
            edges.append(edge)
    return names


def _place(
    own: Array, others: list[Array], size: tuple[int, float], box: Box
) -> tuple[int, float] | None:
    """Return the best column and baseline [px] for a name of `size` (width, letter)
    beside the curve `own`; None if it would cross something everywhere."""
    wide, letter = size
    left, _, top, bottom = box
    first = np.arange(round(0.3 * letter), len(own) - wide, _STEP)
    if not len(first):
        return None
    columns = first[:, None] + np.arange(wide)
    mine = own[columns]
    above = mine.min(axis=1) - 0.45 * letter
    below = mine.max(axis=1) + 1.15 * letter
    baselines = np.stack([above, below])
    high = baselines - 0.85 * letter
    low = baselines + 0.2 * letter
    room = np.full(baselines.shape, _FAR * letter)
    for rows in others:
        near = rows[columns]
        apart = np.maximum(high[..., None] - near, near - low[..., None])
        room = np.minimum(room, apart.min(axis=-1))
    lowness = (baselines - top) / (bottom - top)
    cost = np.ptp(mine, axis=1) - room + 0.5 * letter * lowness
    is_outside = (high < top - 0.5 * letter) | (low > bottom)
    cost[is_outside | (room < _CLEAR * letter)] = np.inf
    side, best = np.unravel_index(cost.argmin(), cost.shape)
    if np.isinf(cost[side, best]):
        return None
    return left + int(first[best]), float(baselines[side, best])


def _style(scene: PanelScene) -> dict[Any, Any]:
    letter = scene.letter
    colours = scene.colours
    return {
        **STYLE,
        "font.size": _TICK_LETTERS * letter,
        "axes.labelsize": "medium",
        "axes.titlesize": letter,
        "axes.titlelocation": "left",
        "axes.titlepad": _TITLE_ABOVE * letter,
        "axes.xmargin": 0.0,
        "axes.ymargin": 0.07,
        "lines.linewidth": _LINE * letter,
        "axes.linewidth": 0.06 * letter,
        "grid.linewidth": 0.05 * letter,
        "axes.labelpad": 0.2 * letter,
        "xtick.major.size": 0.0,
        "ytick.major.size": 0.0,
        "axes.labelcolor": colours["ink"],
        "xtick.color": colours["ink"],
        "ytick.color": colours["ink"],
        "axes.edgecolor": colours["faint"],
        "grid.color": colours["rule"],
        "figure.facecolor": colours["ground"],
        "axes.facecolor": colours["ground"],
    }
