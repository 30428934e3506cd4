"""Draw a state on Matplotlib axes, in the colours of films, for publications."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.tri import Triangulation

from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import InputError
from taichi_disk.fields import QUANTITIES
from taichi_disk.output.inline import Plot
from taichi_disk.output.plot import STYLE, matplotlib_style
from taichi_disk.render.film import painter_of
from taichi_disk.render.geometry import Shape, View, wall_body
from taichi_disk.render.moments import Run, Span, still_cue
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES
from taichi_disk.render.recording import Flight, Recording

_SPRING_WIDTH = 0.04  # in units of the median rest length
_MAX_SPRING_WIDTH = 0.6  # [points]
_OUTLINE_WIDTH = 0.9  # [points]
_SPRING_OPACITY = 0.25


def draw_state(
    run: Run, video: VideoSection, t: float | str, ax: Axes | None = None
) -> Figure:
    """Draw the state of `run` at the moment `t` on `ax`, or on the axes of a new
    figure; return the figure.

    Colours and their scale are those of a picture of that moment. Raises InputError for
    a moment outside the run, or if `ax` is something else.
    """
    if not (ax is None or isinstance(ax, Axes)):
        raise InputError(
            f"ax: must be axes of Matplotlib, as plt.subplots() returns, not {ax!r:.60}"
        )
    cue = still_cue(run, Span(at=t))
    states = Recording(Flight.of(run, 0.0), [cue.t], [video.colour])
    _, x, v = next(states.moments())
    with matplotlib_style(STYLE):
        if ax is None:
            figure = Plot(figsize=(5.2, 4.2), dpi=160, layout="constrained")
            FigureCanvasAgg(figure)
            ax = figure.subplots()
        name, _, unit = run.scenario.time_label.partition("  ")
        title = f"{name} = {cue.t:.4g} {unit.strip('[]')}".strip()
        _draw(ax, states, painter_of(states, video, 1.0), x, v)
        ax.set(xlabel="x  [R]", ylabel="y  [R]", title=title)
        whole: Any = ax.figure
        whole.draw_without_rendering()
    return whole


def _draw(ax: Axes, states: Recording, painter: Painter, x: Any, v: Any) -> None:
    painter.draw = "both"  # "springs" would leave the field without colours
    theme = THEMES[painter.theme]
    xmin, xmax, ymin, ymax = states.view(1.0)
    ax.set(xlim=(xmin, xmax), ylim=(ymin, ymax), aspect="equal", facecolor=theme.ground)
    ax.grid(visible=False)
    haze, solid = _wall(painter, x, (xmin, xmax, ymin, ymax))
    values = painter.normalised(painter.values(x, v))
    points, each, corners = painter.mesh(x, values)
    ax.add_collection(_mesh(*haze, 1.0), autolim=False)
    ax.add_collection(_mesh(points, painter.colours(each), 2.0, corners), autolim=False)
    if painter.colour != "fringes":
        springs = x[painter.lattice.bonds]
        width = _spring_width(ax, painter, xmax - xmin)
        _add_lines(ax, springs, theme.ink, width, 3.0, alpha=_SPRING_OPACITY)
    sides = np.concatenate([painter.triangles.outline, painter.triangles.interfaces])
    _add_lines(ax, x[sides], theme.ink, _OUTLINE_WIDTH, 4.0)
    ax.add_collection(_mesh(*solid, 5.0), autolim=False)
    _name_wall(ax, painter, xmin)
    _add_scale(ax, painter)


def _wall(painter: Painter, x: Any, view: View) -> tuple[Shape, Shape]:
    xmin, xmax, ymin, _ = view
    theme = THEMES[painter.theme]
    chain = np.array([(xmin, 0.0), (xmax, 0.0)])
    depth = -ymin
    if painter.has_elastic_wall:
        chain = x[painter.lattice.wall_surface]
        depth = 0.0
    return wall_body(chain, depth, painter.edge, painter.wall.decay_length, theme)


def _name_wall(ax: Axes, painter: Painter, left: float) -> None:
    """Name the wall's drawn edge: its surface, y = 0, lies below."""
    text = f"wall, a = {1.0 / painter.wall.decay_length:.4g}/R"
    if painter.has_elastic_wall:
        return
    ax.annotate(
        text,
        (left, painter.edge),
        (4, -3),
        textcoords="offset points",
        va="top",
        fontsize="small",
        color=THEMES[painter.theme].ink,
        zorder=6.0,
    )


def _spring_width(ax: Axes, painter: Painter, across: float) -> float:
    """Return the width of springs [points]."""
    unit = 72.0 / ax.figure.dpi * ax.get_window_extent().width / across  # points per R
    spacing = float(np.median(painter.lattice.rest_lengths))
    return min(_MAX_SPRING_WIDTH, _SPRING_WIDTH * unit * spacing)


def _add_lines(
    ax: Axes, ends: Any, colour: Any, width: float, order: float, alpha: float = 1.0
) -> None:
    lines = LineCollection(
        list(ends), colors=colour, linewidths=width, alpha=alpha, zorder=order
    )
    ax.add_collection(lines, autolim=False)


def _add_scale(ax: Axes, painter: Painter) -> None:
    extend = "both" if painter.signed else "max"
    if painter.colour == "fringes":
        extend = "neither"
    figure: Any = ax.figure
    figure.colorbar(
        _scale(painter), ax=ax, label=_label(painter), shrink=0.8, extend=extend
    )


def _mesh(points: Any, colours: Any, order: float, corners: Any = None) -> TriMesh:
    if corners is None:
        corners = np.arange(len(points)).reshape(-1, 3)
    mesh = TriMesh(Triangulation(points[:, 0], points[:, 1], corners), zorder=order)
    mesh.set_facecolor(list(map(tuple, colours.astype(float))))
    return mesh


def _scale(painter: Painter) -> ScalarMappable:
    if painter.colour == "fringes":
        colours = painter.colours(np.linspace(0.0, 1.0, 256))
        return ScalarMappable(Normalize(0.0, 1.0), ListedColormap(colours))
    least = -painter.limit if painter.signed else 0.0
    return ScalarMappable(Normalize(least, painter.limit), ListedColormap(painter.map))


def _label(painter: Painter) -> str:
    kind = QUANTITIES[painter.colour]
    if painter.colour == "fringes":
        return f"fringe order; one fringe: {painter.limit:.3g} Mc²/R²"
    label = kind.label
    if kind.low:
        label += f"  ({kind.low} − … + {kind.high})"
    if kind.on != "points":
        label += ", averaged at points"
    if kind.unit:
        label += f"  [{kind.unit}]"
    return label
