"""The curves at a film's right: velocity or compression, the wall's force and the energies, as in plot.png."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D
from matplotlib.text import Text
from numpy.typing import NDArray

from taichi_disk.outcome import Outcome
from taichi_disk.plot import LINE, STYLE, energies, last_motion, motion
from taichi_disk.render.colours import GROUND
from taichi_disk.render.panel import Curve, Panel
from taichi_disk.scenes.setup import Setup

_SIDES = ("left", "right")
_LINES: tuple[Any, ...] = ("solid", (0, (3, 1.5)))  # a single run has the first


def side_panel(runs: Sequence[tuple[Setup, Outcome]], size: int) -> Panel:
    """The panel of one run, or of two in the same axes, `size` pixels high; with one disk the film is 16 : 9."""
    width, dpi = 2 * round(size * 7 / 18), size / 7.2
    with matplotlib.rc_context(STYLE | {"figure.facecolor": GROUND, "axes.facecolor": GROUND}):
        layout = ConstrainedLayoutEngine(w_pad=0.18, h_pad=0.14, hspace=0.02)
        # A hair larger, as matplotlib rounds down.
        figure = Figure(figsize=((width + 0.1) / dpi, (size + 0.1) / dpi), dpi=dpi, layout=layout)
        canvas = FigureCanvasAgg(figure)
        axes = list(figure.subplots(3, 1, sharex=True, height_ratios=(1.2, 1.0, 1.5)))
        lines = [line for run, style in zip(runs, _LINES, strict=False) for line in _draw(axes, *run, style)]
        for ax in axes:
            ax.margins(y=0.06)
            ax.axhline(0.0, color="0.75", linewidth=0.8, zorder=0.5)
            ax.set_ylim(ax.get_ylim())
        end = max(last_motion(setup.scene.scene, outcome.columns) for setup, outcome in runs)
        axes[-1].set_xlim(0.0, end)
        moving = any(outcome.columns["kinetic"].any() for _, outcome in runs)
        axes[-1].set_xlabel("time  [R/c]" if moving else "from the unloaded disk (0) to the equilibrium (1)")
        results = _results(axes[0], runs)
        axes[2].legend(loc="lower right", bbox_to_anchor=(1.0, 1.08), ncols=2, borderaxespad=0.2, columnspacing=1.2)
        if len(runs) > 1:
            handles = [Line2D([], [], color=LINE, linestyle=style) for style in _LINES]
            axes[0].legend(handles, _SIDES, loc="upper left", borderaxespad=0.2)
        figure.align_ylabels(axes)
        full = _pixels(canvas)
        figure.set_layout_engine("none")  # hiding the curves moves nothing
        box = results.get_window_extent()
        result = slice(size - int(box.y1) - 2, size - int(box.y0) + 2), slice(int(box.x0) - 2, int(box.x1) + 2)
        for artist in (*lines, results):
            artist.set_visible(False)
        empty = _pixels(canvas)
        left, right = (float(axes[0].transData.transform((t, 0.0))[0]) for t in (0.0, end))
        return Panel(empty, full, (0.0, end), (left, right), result, tuple(_curve(line, size) for line in lines))


def _draw(axes: list[Axes], setup: Setup, outcome: Outcome, style: Any) -> Iterator[Line2D]:
    columns = outcome.columns
    values, label = motion(setup.scene.scene, columns, setup.headline(columns).values)
    force = columns["wall_force"], "wall's force on\nthe disk  [Mc²/R]"
    for ax, (curve, name) in zip(axes, ((values, label), force), strict=False):
        ax.set_ylabel(name)
        yield from ax.plot(columns["t"], curve, color=LINE, linestyle=style)
    axes[2].set_ylabel("energy  [Mc²]")
    for name, curve, colour in energies(columns):
        there = axes[2].get_legend_handles_labels()[1]
        yield from axes[2].plot(
            columns["t"], curve, color=colour, linestyle=style, label=None if name in there else name
        )


def _results(ax: Axes, runs: Sequence[tuple[Setup, Outcome]]) -> Text:
    lines = []
    for side, (setup, outcome) in zip(_SIDES, runs, strict=False):
        values = setup.headline(outcome.columns).values
        result = f"e = {values['restitution']:.4f}" if "restitution" in values else f"ξ = {values['xi']:.6f} R"
        lines.append(f"{side}: {result}" if len(runs) > 1 else result)
    return ax.text(0.985, 0.05, "\n".join(lines), transform=ax.transAxes, ha="right", va="bottom", color="0.2")


def _pixels(canvas: FigureCanvasAgg) -> NDArray[np.uint8]:
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def _curve(line: Line2D, size: int) -> Curve:
    assert line.axes is not None
    at = line.axes.transData.transform(np.asarray(line.get_xydata()))
    red, green, blue = (round(255 * part) for part in to_rgb(line.get_color()))
    return Curve(at[:, 0], size - at[:, 1], (red, green, blue))
