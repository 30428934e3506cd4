"""The curves at a film's right: velocity or compression, the wall's force and the energies. They grow with time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.output.plot import HEIGHTS, LINE, STYLE, draw_curves, styled
from taichi_disk.render.palette import Theme

if TYPE_CHECKING:
    from taichi_disk.simulation.outcome import Outcome
    from taichi_disk.simulation.scenario import Scenario

Picture = NDArray[np.uint8]

_LEAST = 11.0  # pixels of the smallest letters
_SIDES = ("left", "right")
_LINES: tuple[Any, ...] = ("solid", (0, (3, 1.5)))  # a single run has the first


@dataclass(frozen=True)
class Panel:
    """Drawn twice beforehand; a frame takes what is past from the one and what is to come from the other.

    Attributes:
        empty, full: (rows, columns, 3) without curves and with them whole.
        end: the last time on the axis, whose first is 0 [R/c].
        left, right: the columns of those.
        spans: the first and the last row of each pair of axes, along which a line marks the time.
        ink: of that line.
    """

    empty: Picture
    full: Picture
    end: float
    left: float
    right: float
    spans: tuple[tuple[int, int], ...]
    ink: tuple[int, ...]

    def draw(self, picture: Picture, t: float) -> None:
        """Show the curves until `t` [R/c] in `picture` (rows, columns, 3)."""
        now = round(float(np.interp(t, (0.0, self.end), (self.left, self.right))))
        picture[:, :now] = self.full[:, :now]
        picture[:, now:] = self.empty[:, now:]
        for top, bottom in self.spans:
            picture[top:bottom, now] = self.ink


def side_panel(runs: Sequence[tuple[Scenario, Outcome]], size: int, theme: Theme) -> Panel:
    """The panel of one run, or of two in the same axes, `size` pixels high; with one disk the film is 16 : 9."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine
    from matplotlib.lines import Line2D

    width, dpi = 2 * round(size * 7 / 18), size / 7.2
    with styled(_style(theme, dpi)):
        layout = ConstrainedLayoutEngine(w_pad=0.18, h_pad=0.1, hspace=0.02)
        # A hair larger, as matplotlib rounds down.
        figure = Figure(figsize=((width + 0.1) / dpi, (size + 0.1) / dpi), dpi=dpi, layout=layout)
        canvas = FigureCanvasAgg(figure)
        axes = list(figure.subplots(3, 1, sharex=True, height_ratios=HEIGHTS))
        lines = []
        for (scenario, outcome), style in zip(runs, _LINES, strict=False):
            lines += draw_curves(axes, scenario, outcome.columns, linestyle=style)
        end = max(scenario.last_motion(outcome.columns) for scenario, outcome in runs)
        axes[-1].set_xlim(0.0, end)
        named = {line.get_label(): line for line in reversed(axes[2].lines)}  # the first run's
        place = {"loc": "lower right", "bbox_to_anchor": (1.0, 1.02), "borderaxespad": 0.2}
        axes[2].legend(handles=list(named.values())[::-1], ncols=2, **place)
        if len(runs) > 1:
            sides = [Line2D([], [], color=LINE, linestyle=style) for style in _LINES]
            axes[0].legend(sides, _SIDES, loc="upper left", borderaxespad=0.2)
        for ax in axes:
            ax.margins(y=0.06)
            ax.axhline(0.0, color=theme.faint, linewidth=0.8, zorder=0.5)
            ax.set_ylim(ax.get_ylim())
            # There is no room above an axis for its power of ten, nor beside a low one for its name.
            ax.yaxis.get_offset_text().set_visible(False)
            numbers = ax.yaxis.get_major_formatter()
            numbers.format_ticks(ax.get_yticks())
            name = f"{ax.get_ylabel()} {numbers.get_offset()}".strip().replace("\n", " ").replace("  ", " ")
            ax.set_ylabel(name if ax is axes[2] else "")
            ax.set_title("" if ax is axes[2] else name, loc="left", pad=4.0)
        full = _pixels(canvas)
        figure.set_layout_engine("none")  # hiding the curves moves nothing
        for line in lines:
            line.set_visible(False)
        empty = _pixels(canvas)
    left, right = (float(axes[0].transData.transform((t, 0.0))[0]) for t in (0.0, end))
    boxes = [ax.get_window_extent() for ax in axes]
    spans = tuple((round(size - box.y1), round(size - box.y0)) for box in boxes)
    return Panel(empty, full, end, left, right, spans, tuple(round(255 * part) for part in theme.faint))


def _style(theme: Theme, dpi: float) -> dict[Any, Any]:
    """matplotlib's settings: letters of 9.5 points, or as many as are readable."""
    points, least = max(9.5, _LEAST * 72.0 / dpi), max(8.5, _LEAST * 72.0 / dpi)
    sizes = ("font.size", "axes.labelsize", "axes.titlesize", "xtick.labelsize", "ytick.labelsize")
    inks = ("text.color", "axes.labelcolor", "xtick.color", "ytick.color", "legend.labelcolor")
    grounds = {"figure.facecolor": theme.ground, "axes.facecolor": theme.ground}
    rules = {"axes.edgecolor": theme.faint, "grid.color": theme.rule}
    settings = STYLE | dict.fromkeys(sizes, points) | dict.fromkeys(inks, theme.ink) | grounds | rules
    return settings | {"legend.fontsize": least, "legend.columnspacing": 1.2}


def _pixels(canvas: Any) -> Picture:
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()
