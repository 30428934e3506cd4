"""Draw the curves beside a film with Matplotlib: as they will be, and as they were."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.pictures.curves import MOTION
from taichi_disk.pictures.plot import (
    PANEL_HEIGHTS,
    RAISED,
    STYLE,
    TimeCurve,
    matplotlib_style,
)

if TYPE_CHECKING:
    from taichi_disk.mechanics.lattice import Array

Picture = NDArray[np.uint8]
Box = tuple[int, int, int, int]

# Distances are in units of the size of the titles' letters.
_LEFT = 2.9
_RIGHT = 1.0
_ABOVE = (2.3, 2.5, 2.5)  # space above the axes
_BOTTOM = 3.7
_NAMES_ROW = 1.15  # height of a row of names above the energies
_TITLE_ABOVE = 0.6  # baseline of a title above its axes
_TICK_LETTERS = 0.9
_LINE = 0.15  # width of a curve
_NAME = 4.0  # width of a short name with its line
_POWERS = (-1, 2)  # powers of ten from -1 to 2 are not factored out


@dataclass(frozen=True)
class PanelScene:
    """What the panel shows.

    Attributes:
        t: (k,) times [R/c], evenly over the panel's width.
        curves: values (k,) in units of their axes.
        labels: of the axes, from top to bottom.
        size: of the picture (width, height) [px].
        letter: size of the titles' letters [px].
        ground: 0 if it is light, 1 if it is dark.
        colours: of ground, ink, faint words, rules and coming curves, by name.
    """

    t: Array
    curves: list[TimeCurve]
    labels: list[str]
    time_label: str
    size: tuple[int, int]
    letter: float
    ground: int
    colours: dict[str, Any]


@dataclass(frozen=True)
class PanelPictures:
    """The drawn panel.

    Attributes:
        coming, past: pictures (height, width, 4) with grey and with coloured curves.
        boxes: left, right, top and bottom of each pair of axes [px].
    """

    coming: Picture
    past: Picture
    boxes: list[Box]


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
        boxes = _boxes(scene)
        axes = [_axes(figure, scene, panel, box) for panel, box in enumerate(boxes)]
        lines = []
        for curve in scene.curves:
            lines += axes[curve.look.panel].plot(
                scene.t,
                curve.values,
                color=curve.look.colours[scene.ground],
                linestyle=curve.look.style,
                label=curve.name,
            )
        _add_names(axes[-1], scene)
        for line in lines:
            line.set_color(scene.colours["coming"])
        canvas.draw()
        image = np.asarray(canvas.buffer_rgba())
        coming = image.copy()
        # draws only the curves again, which takes a tenth of the time
        for curve, line in zip(scene.curves, lines, strict=True):
            line.set_color(curve.look.colours[scene.ground])
            line.axes.draw_artist(line)
        return PanelPictures(coming, image.copy(), boxes)


def _rows_of_names(scene: PanelScene) -> int:
    names = [curve.name for curve in scene.curves if curve.name]
    width, _ = scene.size
    room = width / scene.letter - _LEFT - _RIGHT
    # each row leaves the room of one name, because some names are longer
    return math.ceil(len(names) / max(int(room / _NAME) - 1, 1))


def _boxes(scene: PanelScene) -> list[Box]:
    """Return where the axes stand, from top to bottom."""
    letter = scene.letter
    width, height = scene.size
    above = np.array(_ABOVE)
    above[-1] += _NAMES_ROW * _rows_of_names(scene)
    room = height - letter * (above.sum() + _BOTTOM)
    high = room * np.array(PANEL_HEIGHTS) / sum(PANEL_HEIGHTS)
    bottoms = np.rint(np.cumsum(letter * above + high)).astype(int)
    tops = np.rint(bottoms - high).astype(int)
    left = round(_LEFT * letter)
    right = round(width - _RIGHT * letter)
    return [(left, right, *rows) for rows in np.stack([tops, bottoms], axis=1).tolist()]


def _axes(figure: Any, scene: PanelScene, panel: int, box: Box) -> Any:
    """Return axes without their curves."""
    from matplotlib.ticker import FuncFormatter, MaxNLocator

    left, right, top, bottom = box
    width, height = scene.size
    wide = (right - left) / width
    high = (bottom - top) / height
    ax = figure.add_axes((left / width, 1.0 - bottom / height, wide, high))
    ax.set_xlim(scene.t[0], scene.t[-1])
    plain = FuncFormatter(lambda value, _: f"{value:.6g}".replace("-", "−"))
    ax.xaxis.set_major_formatter(plain)
    ax.yaxis.set_major_formatter(plain)
    ax.xaxis.set_major_locator(MaxNLocator(6, steps=[1, 2, 5, 10], prune="both"))
    ax.yaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 3, 5, 10]))
    title = ax.set_title(scene.labels[panel].replace("  ", " "))
    texts = [title]
    if panel == 0:
        title.set_color(MOTION.colours[scene.ground])
    if panel < len(PANEL_HEIGHTS) - 1:
        ax.tick_params(labelbottom=False)
    else:
        texts.append(ax.set_xlabel(scene.time_label.replace("  ", " ")))
    for text in texts:
        wide = text.get_window_extent().width
        text.set_fontsize(text.get_fontsize() * min((right - left) / wide, 1.0))
    return ax


def _add_names(ax: Any, scene: PanelScene) -> None:
    """Write the names of the energies below the title, with their lines."""
    rows = _rows_of_names(scene)
    pad = (_TITLE_ABOVE + _NAMES_ROW * rows) * scene.letter
    ax.set_title(ax.get_title("left"), pad=pad)
    ax.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=math.ceil(len(ax.lines) / rows),
        labelcolor="linecolor",
        handlelength=1.2,
        handletextpad=0.3,
        columnspacing=0.6,
        borderpad=0.0,
        borderaxespad=0.3,
        labelspacing=0.2,
        fontsize="medium",
    )


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
        "text.color": colours["ink"],
        "axes.labelcolor": colours["ink"],
        "xtick.color": colours["ink"],
        "ytick.color": colours["ink"],
        "axes.edgecolor": colours["faint"],
        "grid.color": colours["rule"],
        "figure.facecolor": colours["ground"],
        "axes.facecolor": colours["ground"],
    }
