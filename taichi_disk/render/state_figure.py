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
from taichi_disk.render.film import States
from taichi_disk.render.geometry import wall_body
from taichi_disk.render.moments import Run, Span, still_cue
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES

_SPRING_WIDTH = 0.04  # in units of the median rest length
_MAX_SPRING_WIDTH, _OUTLINE_WIDTH = 0.6, 0.9  # [points]
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
    states = States(run, video, [cue])
    _, x, v = next(states.moments())
    with matplotlib_style(STYLE):
        if ax is None:
            figure = Plot(figsize=(5.2, 4.2), dpi=160, layout="constrained")
            FigureCanvasAgg(figure)
            ax = figure.subplots()
        name, _, unit = run.scenario.time_label.partition("  ")
        _draw(
            ax, states, video, x, v, f"{name} = {cue[0]:.4g} {unit.strip('[]')}".strip()
        )
        whole: Any = ax.figure
        whole.draw_without_rendering()
    return whole


def _draw(
    ax: Axes, states: States, video: VideoSection, x: Any, v: Any, title: str
) -> None:
    painter, theme, (xmin, xmax, ymin, ymax) = (
        states.painter,
        THEMES[video.theme],
        states.view,
    )
    painter.draw = "both"  # "springs" would leave the field without colours
    ax.set(xlim=(xmin, xmax), ylim=(ymin, ymax), aspect="equal", facecolor=theme.ground)
    ax.set(xlabel="x  [R]", ylabel="y  [R]", title=title)
    ax.grid(visible=False)
    surface = painter.lattice.wall_surface
    chain = x[surface] if len(surface) else np.array([(xmin, 0.0), (xmax, 0.0)])
    depth = 0.0 if len(surface) else -ymin
    haze, solid = wall_body(
        chain, depth, painter.edge, painter.wall.decay_length, theme
    )
    points, each, corners = painter.mesh(x, painter.normalised(painter.values(x, v)))
    ax.add_collection(_mesh(*haze, 1.0), autolim=False)
    ax.add_collection(_mesh(points, painter.colours(each), 2.0, corners), autolim=False)
    # points per R
    unit = 72.0 / ax.figure.dpi * ax.get_window_extent().width / (xmax - xmin)
    width = min(
        _MAX_SPRING_WIDTH,
        _SPRING_WIDTH * unit * float(np.median(painter.lattice.rest_lengths)),
    )
    if painter.colour != "fringes":
        ink: dict[str, Any] = {
            "colors": theme.ink,
            "linewidths": width,
            "alpha": _SPRING_OPACITY,
            "zorder": 3.0,
        }
        ax.add_collection(
            LineCollection(list(x[painter.lattice.bonds]), **ink), autolim=False
        )
    sides = np.concatenate([painter.triangles.outline, painter.triangles.interfaces])
    ax.add_collection(
        LineCollection(
            list(x[sides]), colors=theme.ink, linewidths=_OUTLINE_WIDTH, zorder=4.0
        ),
        autolim=False,
    )
    ax.add_collection(_mesh(*solid, 5.0), autolim=False)
    ax.figure.colorbar(_scale(painter), ax=ax, label=_label(painter), shrink=0.8)


def _mesh(points: Any, colours: Any, order: float, corners: Any = None) -> TriMesh:
    corners = np.arange(len(points)).reshape(-1, 3) if corners is None else corners
    mesh = TriMesh(Triangulation(points[:, 0], points[:, 1], corners), zorder=order)
    mesh.set_facecolor(list(map(tuple, colours.astype(float))))
    return mesh


def _scale(painter: Painter) -> ScalarMappable:
    if painter.colour == "fringes":
        places = np.linspace(0.0, 1.0, 256)
        return ScalarMappable(
            Normalize(0.0, 1.0), ListedColormap(painter.colours(places))
        )
    least = -painter.limit if painter.signed else 0.0
    return ScalarMappable(Normalize(least, painter.limit), ListedColormap(painter.map))


def _label(painter: Painter) -> str:
    kind = QUANTITIES[painter.colour]
    if painter.colour == "fringes":
        return f"fringe order; one fringe: {painter.limit:.3g} Mc²/R²"
    ends = f"  ({kind.low} − … + {kind.high})" if kind.low else ""
    return f"{kind.label}{ends}" + f"  [{kind.unit}]" * bool(kind.unit)
