"""Draw a state on Matplotlib axes, in the colours of films, for publications."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, TriMesh
from matplotlib.colors import ListedColormap
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
from taichi_disk.render.recording import Flight, Recording, Scales

_SPRING_WIDTH = 0.3  # [points]
_OUTLINE_WIDTH = 0.9  # [points]
_SPRING_OPACITY = 0.25
_LEVELS = 512  # colours of the bar


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
    _, x, v = next(states.states())
    with matplotlib_style(STYLE):
        if ax is None:
            figure = Plot(figsize=(5.2, 4.2), dpi=160, layout="constrained")
            FigureCanvasAgg(figure)
            ax = figure.subplots()
        name, _, unit = run.scenario.words.time.partition("  ")
        title = f"{name} = {cue.t:.4g} {unit.strip('[]')}".strip()
        common = Scales.of([states], 1.0)
        _draw(ax, common.view, painter_of(states, video, common), x, v)
        ax.set(xlabel="x  [R]", ylabel="y  [R]", title=title)
        whole: Any = ax.figure
        whole.draw_without_rendering()
    return whole


def _draw(ax: Axes, view: View, painter: Painter, x: Any, v: Any) -> None:
    painter.draw = "both"  # "springs" would leave the field without colours
    theme = THEMES[painter.theme]
    xmin, xmax, ymin, ymax = view
    ax.set(xlim=(xmin, xmax), ylim=(ymin, ymax), aspect="equal", facecolor=theme.ground)
    ax.grid(visible=False)
    haze, solid = _wall(painter, x, view)
    _add_mesh(ax, *haze, order=1.0)
    _draw_field(ax, painter, x, v)
    if painter.colour != "fringes":
        springs = x[painter.lattice.bonds]
        _add_lines(ax, springs, theme.ink, _SPRING_WIDTH, 3.0, alpha=_SPRING_OPACITY)
    sides = np.concatenate([painter.triangles.outline, painter.triangles.interfaces])
    _add_lines(ax, x[sides], theme.ink, _OUTLINE_WIDTH, 4.0)
    _add_mesh(ax, *solid, order=5.0)
    if not painter.has_elastic_wall:
        _name_wall(ax, painter, xmin)


def _draw_field(ax: Axes, painter: Painter, x: Any, v: Any) -> None:
    """Draw the coloured quantity with its colour bar."""
    values = painter.normalised(painter.values(x, v))
    points, parts, corners = painter.mesh(x, values)
    last_part = 1.0
    if painter.colour == "fringes":
        last_part = max(np.ceil(parts.max()), 1.0)
        low = 0.0
        high = last_part  # the order of the last fringe
        extend = "neither"
    elif painter.signed:
        low = -painter.limit
        high = painter.limit
        extend = "both"
    else:
        low = 0.0
        high = painter.limit
        extend = "max"
    colours: Any = painter.colours(np.linspace(0.0, last_part, _LEVELS))
    axes: Any = ax
    field = axes.tripcolor(
        Triangulation(points[:, 0], points[:, 1], corners),
        low + (high - low) * parts / last_part,
        shading="gouraud",
        cmap=ListedColormap(colours),
        vmin=low,
        vmax=high,
        zorder=2.0,
    )
    figure: Any = ax.figure
    figure.colorbar(field, ax=ax, label=_label(painter), shrink=0.8, extend=extend)


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
    ax.annotate(
        f"wall, a = {1.0 / painter.wall.decay_length:.4g}/R",
        (left, painter.edge),
        (4, -3),
        textcoords="offset points",
        va="top",
        fontsize="small",
        color=THEMES[painter.theme].ink,
        zorder=6.0,
    )


def _add_lines(
    ax: Axes, ends: Any, colour: Any, width: float, order: float, alpha: float = 1.0
) -> None:
    lines = LineCollection(
        list(ends), colors=colour, linewidths=width, alpha=alpha, zorder=order
    )
    ax.add_collection(lines, autolim=False)


def _add_mesh(ax: Axes, points: Any, colours: Any, order: float) -> None:
    corners = np.arange(len(points)).reshape(-1, 3)
    mesh = TriMesh(Triangulation(points[:, 0], points[:, 1], corners), zorder=order)
    mesh.set_facecolor(list(map(tuple, colours)))
    ax.add_collection(mesh, autolim=False)


def _label(painter: Painter) -> str:
    kind = QUANTITIES[painter.colour]
    if painter.colour == "fringes":
        return f"fringe order; one fringe: {painter.limit:.3g} Mc²/R²"
    label = kind.label
    if kind.low:
        label += f"  ({kind.low} − … + {kind.high})"
    if kind.on != "points":
        label += ",\naveraged at points"  # in one line it would be cut
    if kind.unit:
        label += f"  [{kind.unit}]"
    return label
