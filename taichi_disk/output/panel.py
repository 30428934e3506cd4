"""Draw the curves beside a film with Matplotlib: as they will be, and as they were."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.output.files import Array
from taichi_disk.output.plot import PANEL_HEIGHTS, STYLE, Curve, matplotlib_style

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
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_STEP = 3  # distance of places that are tried for a name [px]
_CLEAR = 0.2  # least distance of a name to a curve
_FAR = 2.0  # a larger distance to other curves is no better


@dataclass(frozen=True)
class PanelScene:
    """What the panel shows: curves over the times `t` (rows,), axis labels from top to
    bottom, the shown `span` of times, and the result, which is known at a time."""

    t: Array
    curves: list[Curve]
    labels: tuple[str, str, str]
    time_label: str
    span: tuple[float, float]
    result: str
    result_time: float


@dataclass(frozen=True)
class PanelLook:
    """Size of the picture (width, height) and of letters [px], and colours."""

    size: tuple[int, int]
    letter: float
    ground: Any
    ink: Any
    faint: Any
    rule: Any
    coming: Any
    is_dark: bool


@dataclass(frozen=True)
class PanelPictures:
    """The drawn panel.

    Attributes:
        coming, past, ended: pictures (height, width, 3) with grey curves, with coloured
            curves, and with the result.
        boxes: left, right, top and bottom of each pair of axes [px].
        rows: of each curve, its row [px] at each column of `boxes[0]`.
        inks: colours of the curves, from 0 to 255.
        names: left, right, top and bottom of the names of curves [px].
    """

    coming: Picture
    past: Picture
    ended: Picture
    boxes: list[Box]
    rows: list[Array]
    inks: list[tuple[int, ...]]
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
    """Return the label of an axis with the power of ten of its `largest` value in its
    unit, and that power."""
    power = math.floor(math.log10(largest)) if largest > 0.0 else 0
    if _POWERS[0] <= power <= _POWERS[1] or "[" not in label:
        return label, 1.0
    raised = str(power).translate(_RAISED)
    return label.replace("[", f"[10{raised} "), 10.0**power


def draw_panel(scene: PanelScene, look: PanelLook) -> PanelPictures:
    """Draw the panel of `scene`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    width, height = look.size
    # Slightly larger, because Matplotlib rounds down; a point is a pixel.
    size = (width + 0.1) / 72.0, (height + 0.1) / 72.0
    with matplotlib_style(_style(look)):
        figure = Figure(figsize=size, dpi=72.0)
        canvas = FigureCanvasAgg(figure)
        boxes = _boxes(look)
        axes = [_axes(figure, scene, look, panel) for panel in range(len(boxes))]
        lines = [_line(axes[curve.panel], scene, curve, look) for curve in scene.curves]
        for ax in axes:
            ax.margins(y=0.07)
            ax.set_xlim(*scene.span)
        rows = [
            _rows(axes[curve.panel], scene, line, boxes[curve.panel])
            for curve, line in zip(scene.curves, lines, strict=True)
        ]
        names = _write_names(figure, scene, look, boxes, rows)
        result = _write_result(figure, scene, look, boxes[0], rows[0])

        def picture() -> Picture:
            canvas.draw()
            return np.asarray(canvas.buffer_rgba())[..., :3].copy()

        result.set_visible(False)
        past = picture()
        result.set_visible(True)
        ended = picture()
        result.set_visible(False)
        for line in lines:
            line.set_color(look.coming)
        coming = picture()
    inks = [_ink(colour_of(curve, look)) for curve in scene.curves]
    return PanelPictures(coming, past, ended, boxes, rows, inks, names)


def _ink(colour: str) -> tuple[int, ...]:
    """Return red, green and blue of a colour of Matplotlib's, from 0 to 255."""
    from matplotlib.colors import to_rgb

    return tuple(round(255 * part) for part in to_rgb(colour))


def colour_of(curve: Curve, look: PanelLook) -> str:
    if look.is_dark:
        return ON_DARK.get(curve.colour, curve.colour)
    return curve.colour


def _boxes(look: PanelLook) -> list[Box]:
    width, height = look.size
    letter = look.letter
    left = round(_LEFT * letter)
    right = round(width - _RIGHT * letter)
    room = height - (_TOP + 2 * _BETWEEN + _BOTTOM) * letter
    boxes = []
    top = _TOP * letter
    for part in PANEL_HEIGHTS:
        bottom = top + room * part / sum(PANEL_HEIGHTS)
        boxes.append((left, right, round(top), round(bottom)))
        top = bottom + _BETWEEN * letter
    return boxes


def _axes(figure: Any, scene: PanelScene, look: PanelLook, panel: int) -> Any:
    """Return one pair of axes, without its curves."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    width, height = look.size
    left, right, top, bottom = _boxes(look)[panel]
    is_lowest = panel == len(PANEL_HEIGHTS) - 1
    size = (right - left) / width, (bottom - top) / height
    ax = figure.add_axes((left / width, 1.0 - bottom / height, *size))
    ax.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], prune="both"))
    ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 3, 5, 10]))
    plain = FuncFormatter(lambda value, _: f"{value:.6g}".replace("-", "−"))
    ax.xaxis.set_major_formatter(plain)
    ax.yaxis.set_major_formatter(plain)
    ax.tick_params(length=0, labelbottom=is_lowest)
    if is_lowest:
        ax.set_xlabel(scene.time_label.replace("  ", " "))
    title, _ = factored(scene.labels[panel], _largest(scene, panel))
    row = top - _TITLE_ABOVE * look.letter
    colour = colour_of(scene.curves[0], look) if panel == 0 else look.ink
    figure.text(
        0.5 * look.letter / width,
        1.0 - row / height,
        title.replace("  ", " "),
        color=colour,
        fontsize=look.letter,
    )
    return ax


def _largest(scene: PanelScene, panel: int) -> float:
    return max(
        float(np.abs(curve.values).max())
        for curve in scene.curves
        if curve.panel == panel
    )


def _line(ax: Any, scene: PanelScene, curve: Curve, look: PanelLook) -> Any:
    """Draw a curve in units of its axis. Before t = 0 it is constant."""
    _, unit = factored(scene.labels[curve.panel], _largest(scene, curve.panel))
    t = np.concatenate([[min(scene.span[0], scene.t[0])], scene.t])
    values = np.concatenate([curve.values[:1], curve.values]) / unit
    (line,) = ax.plot(t, values, color=colour_of(curve, look))
    return line


def _rows(ax: Any, scene: PanelScene, line: Any, box: Box) -> Array:
    """Return the row of a curve at each column [px]."""
    left, right, top, bottom = box
    times = np.linspace(*scene.span, right - left)
    values = np.interp(times, line.get_xdata(), line.get_ydata())
    low, high = ax.get_ylim()
    return np.asarray(bottom - (bottom - top) * (values - low) / (high - low))


# ---- names of the energies


def _write_names(
    figure: Any,
    scene: PanelScene,
    look: PanelLook,
    boxes: Sequence[Box],
    rows: Sequence[Array],
) -> list[Box]:
    """Write each name beside its curve, where it is far from the others; if there is no
    such place, in the line of the title. Return the boxes of the names."""
    named = [k for k, curve in enumerate(scene.curves) if curve.name]
    named.sort(key=lambda k: -float(np.ptp(rows[k])))
    _, right, top, _ = boxes[2]
    letter = _TICK_LETTERS * look.letter
    width, height = look.size
    names: list[Box] = []
    beyond = float(right)
    for k in named:
        colour = colour_of(scene.curves[k], look)
        text = figure.text(0, 0, scene.curves[k].name, color=colour, fontsize=letter)
        wide = math.ceil(text.get_window_extent().width)
        others = [rows[other] for other in named if other != k]
        place = _place(rows[k], others, names, (wide, letter), boxes[2])
        if place is None:
            beyond -= wide
            x = beyond
            baseline = top - _TITLE_ABOVE * look.letter
            beyond -= letter
        else:
            x, baseline = place
        text.set_position((x / width, 1.0 - baseline / height))
        high = baseline - 0.85 * letter
        low = baseline + 0.25 * letter
        names.append((round(x), round(x) + wide, round(high), round(low)))
    return names


def _place(
    own: Array,
    others: Sequence[Array],
    names: Sequence[Box],
    size: tuple[int, float],
    box: Box,
) -> tuple[float, float] | None:
    """Return the best column and baseline [px] for a name of `size` (width, letter)
    beside the curve `own`; None if it would cross something everywhere."""
    wide, letter = size
    left, _, top, bottom = box
    best: tuple[float, float] | None = None
    best_cost = math.inf
    for first in range(round(0.3 * letter), len(own) - wide, _STEP):
        columns = slice(first, first + wide)
        mine = own[columns]
        above = float(mine.min()) - 0.45 * letter
        below = float(mine.max()) + 1.15 * letter
        for baseline in (above, below):
            high = baseline - 0.85 * letter
            low = baseline + 0.2 * letter
            if high < top - 0.5 * letter or low > bottom:
                continue
            distances = [_distance(rows[columns], high, low) for rows in others]
            for x0, x1, upper, lower in names:
                if x0 - letter < left + columns.stop and left + first < x1 + letter:
                    distances.append(max(upper - low, high - lower))
            room = min([_FAR * letter, *distances])
            lowness = (baseline - top) / (bottom - top)
            cost = float(np.ptp(mine)) - room + 0.5 * letter * lowness
            if room >= _CLEAR * letter and cost < best_cost:
                best = float(left + first), baseline
                best_cost = cost
    return best


def _distance(rows: Array, high: float, low: float) -> float:
    """Return the distance of a curve to the rows from `high` to `low`; below 0 if it
    crosses them."""
    return float(np.maximum(high - rows, rows - low).min())


def _write_result(
    figure: Any, scene: PanelScene, look: PanelLook, box: Box, rows: Array
) -> Any:
    """Write the result at the right end of the first curve, inside its axes."""
    width, height = look.size
    _, right, _, bottom = box
    letter = _TICK_LETTERS * look.letter
    colour = colour_of(scene.curves[0], look)
    text = figure.text(0, 0, scene.result, color=colour, fontsize=letter)
    wide = math.ceil(text.get_window_extent().width)
    row = rows[-wide:].max() + 1.3 * letter
    if row > bottom - 0.3 * letter:
        row = rows[-wide:].min() - 0.5 * letter
    text.set_position(((right - wide) / width, 1.0 - row / height))
    return text


def _style(look: PanelLook) -> dict[Any, Any]:
    return {
        **STYLE,
        "font.size": _TICK_LETTERS * look.letter,
        "axes.labelsize": "medium",
        "lines.linewidth": _LINE * look.letter,
        "axes.linewidth": 0.06 * look.letter,
        "grid.linewidth": 0.05 * look.letter,
        "axes.labelpad": 0.2 * look.letter,
        "text.color": look.ink,
        "axes.labelcolor": look.ink,
        "xtick.color": look.ink,
        "ytick.color": look.ink,
        "axes.edgecolor": look.faint,
        "grid.color": look.rule,
        "figure.facecolor": look.ground,
        "axes.facecolor": look.ground,
    }
