"""Draw a state on Matplotlib axes, in the colours of films, for publications."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary, WeakSet, ref

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.tri import (
    LinearTriInterpolator,
    Triangulation,
    UniformTriRefiner,
)

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.config.sections import VideoSection
from taichi_disk.mechanics.fields import QUANTITIES, Triangles, at_points
from taichi_disk.pictures.inline import Plot
from taichi_disk.pictures.plot import STYLE, matplotlib_style
from taichi_disk.pictures.render.moments import Run, time_of
from taichi_disk.pictures.render.palette import THEMES, colour_map, map_kind
from taichi_disk.pictures.render.recording import Flight, Recording

# widths of lines [points]
_SPRINGS: dict[str, Any] = {"linewidth": 0.3, "alpha": 0.25}
_OUTLINE = 0.9
# approximate number of triangles of fringes
_FRINGE_PARTS = 30_000
# what has the colour of the axes' letters
_INKED = (
    "text.color",
    "axes.labelcolor",
    "axes.edgecolor",
    "xtick.color",
    "ytick.color",
)
# What was drawn, and a weak reference to the colour bar of axes. Each of them holds its
# whole figure, which a strong reference would keep for ever.
_ARTISTS: WeakSet[Artist] = WeakSet()
_BARS: WeakKeyDictionary[Axes, Any] = WeakKeyDictionary()


def draw_state(
    run: Run, video: VideoSection, t: float | str, ax: Axes | None = None
) -> Figure:
    """Draw the state of `run` at the moment `t` on `ax`, or on the axes of a new
    figure; return the figure.

    Colours and their scale are those of a picture of that moment. A state that was
    drawn on `ax` before is replaced. Raises InputError for a moment outside the run, or
    if `ax` is something else.
    """
    if not (ax is None or isinstance(ax, Axes)):
        raise InputError(
            f"ax: must be axes of Matplotlib, as plt.subplots() returns, not {ax!r:.60}"
        )
    moment = time_of(t, run)
    states = Recording(Flight.of(run, 0.0), [moment], [video.colour])
    style = STYLE
    if ax is not None:
        style = STYLE | dict.fromkeys(_INKED, ax.xaxis.label.get_color())
    with matplotlib_style(style):
        if ax is None:
            figure = Plot(figsize=(5.2, 4.2), dpi=160, layout="compressed")
            FigureCanvasAgg(figure)
            ax = figure.subplots()
        for artist in _ARTISTS.intersection(ax.get_children()):
            artist.remove()
        others = ax.get_children()
        _draw(ax, states, video)
        _ARTISTS.update(set(ax.get_children()).difference(others))
        name, _, unit = run.scenario.words.time.partition("  ")
        title = f"{name} = {moment:.4g} {unit.strip('[]')}".strip()
        ax.set(xlabel="x  [R]", ylabel="y  [R]", title=title)
        whole: Any = ax.figure.figure  # `ax` may be in a subfigure
        whole.draw_without_rendering()
    return whole


def _draw(axes: Any, states: Recording, video: VideoSection) -> None:
    """Draw coloured triangles, springs, outlines, and a rigid wall up to its drawn
    edge."""
    _, x, v = next(states.states())
    scenario = states.run.scenario
    triangles = Triangles(scenario.lattice)
    theme = THEMES[video.theme]
    limit = states.limits[video.colour]
    values = at_points(video.colour, triangles, scenario.model.springs, x, v)
    mesh = Triangulation(x[:, 0], x[:, 1], triangles.triangles)
    colours = ListedColormap(list(colour_map(video.theme, map_kind(video.colour))))
    low = 0.0
    high = limit
    if QUANTITIES[video.colour].signed:
        low = -limit
    if video.colour == "fringes":
        mesh, values = _refined(mesh, values / limit)
        high = max(np.ceil(values.max()), 1.0)
        brightness = np.sin(np.pi * np.linspace(0.0, high, 1000)) ** 2
        colours = ListedColormap(colours(brightness))
    xmin, xmax, ymin, ymax = states.view(1.0)
    axes.set(xlim=(xmin, xmax), ylim=(ymin, ymax), aspect="equal")
    axes.set_facecolor(theme.ground)
    field = axes.tripcolor(
        mesh, values, shading="gouraud", cmap=colours, vmin=low, vmax=high
    )
    if video.colour != "fringes":
        axes.triplot(*x.T, triangles.triangles, color=theme.ink, **_SPRINGS)
    sides = np.concatenate([triangles.outline, triangles.interfaces])
    axes.plot(*x[sides].transpose(2, 1, 0), color=theme.ink, linewidth=_OUTLINE)
    if not len(scenario.lattice.wall_surface):
        axes.axhspan(ymin, states.edge, color=theme.wall, zorder=3.0)
    _add_bar(axes, field, _label(video, limit))


def _refined(mesh: Triangulation, values: Any) -> tuple[Triangulation, Any]:
    """Divide triangles, in which colours vary linearly, where there are few."""
    divisions = 0.5 * np.log2(_FRINGE_PARTS / len(mesh.triangles))
    linear = LinearTriInterpolator(mesh, values)
    return UniformTriRefiner(mesh).refine_field(
        values, linear, subdiv=max(round(divisions), 0)
    )


def _add_bar(axes: Any, field: Any, label: str) -> None:
    """Draw the colour bar in the place of an older one, which would else make the axes
    smaller each time."""
    place: Any = None
    if axes in _BARS:
        place = _BARS[axes]()
    if place in axes.figure.axes:
        place.clear()
    else:  # a cleared figure has none
        place = None
    bar = axes.figure.colorbar(field, place, axes, label=label, shrink=0.8)
    _BARS[axes] = ref(bar.ax)


def _label(video: VideoSection, limit: float) -> str:
    kind = QUANTITIES[video.colour]
    if video.colour == "fringes":
        return f"fringe order; one fringe: {limit:.3g} Mc²/R²"
    label = kind.label
    if kind.unit:
        label += f"  [{kind.unit}]"
    if kind.low:  # a second line, for small axes
        label += f"\n{kind.low} − … + {kind.high}"
    return label
