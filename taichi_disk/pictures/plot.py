"""Draw plot.png: the curves of a run over time or, for a quasi-static loading, over
compression.

Matplotlib takes 0.3 s to import, so it is imported only when something is drawn.
"""

from __future__ import annotations

import re
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from taichi_disk.base.files import atomic_write
from taichi_disk.base.processes.early import picture_of
from taichi_disk.experiments.computation.contact import Contact
from taichi_disk.experiments.computation.words import Numbers, Words
from taichi_disk.experiments.scenes.scene import origin
from taichi_disk.mechanics.simulation.observables import Columns
from taichi_disk.pictures.curves import ENERGIES, FORCE, LOOKS, MOTION, Look

if TYPE_CHECKING:
    from taichi_disk.experiments.computation.scenario import Scenario
    from taichi_disk.mechanics.lattice import Array
    from taichi_disk.pictures.inline import Plot

STYLE = {
    "font.size": 9.5,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": "0.35",
    "axes.grid": True,
    "grid.color": "0.91",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "axes.formatter.limits": (-3, 4),
    "lines.linewidth": 1.4,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}
LINE, _ = MOTION.colours
MARK = "0.45"
SUM = "#222222"
_SUM_LINE: dict[str, Any] = {"color": SUM, "linestyle": (0, (8, 2))}
# Curves and films end when the kinetic energy falls below this fraction of its maximum:
# a hundredth of the speed, which nobody sees.
AT_REST = 1e-4
# energies that stay below this fraction of the largest one are not drawn
VISIBLE_ENERGY = 2e-3
# relative heights of the panels for motion, force and energies
PANEL_HEIGHTS = (1.2, 1.0, 1.5)
# fractions of the figure
LAYOUT = {"left": 0.145, "right": 0.98, "bottom": 0.055, "top": 0.945, "hspace": 0.17}
TITLE_WIDTH = 95  # [letters]
TITLE_HEIGHT = 21.0  # of all lines above the axes [pt]
FORCE_LABEL = "wall force  [Mc²/R]"
ENERGY_LABEL = "energy  [Mc²]"
RAISED = str.maketrans("-−0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_LOCK = threading.Lock()


@contextmanager
def matplotlib_style(style: dict[Any, Any]) -> Iterator[None]:
    """Replace the user's matplotlibrc by `style` while the block runs, in one thread at
    a time: settings are global."""
    import matplotlib

    with _LOCK, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(style)
        yield


def powers() -> Any:
    """Return Matplotlib's formatter of numbers with ×10⁻⁴ in the place of 1e-4. Its
    own way to such a power doubles the time of a plot."""
    from matplotlib.ticker import ScalarFormatter

    class Powers(ScalarFormatter):
        def get_offset(self) -> str:
            offset = super().get_offset()
            if not offset.startswith("1e"):
                return offset
            return f"×10{offset[2:].translate(RAISED)}"

    return Powers()


@dataclass(frozen=True)
class TimeCurve:
    """A curve over time: its look, values (rows,) and name."""

    look: Look
    values: Array
    name: str = ""


def curves(scenario: Scenario, columns: Columns) -> list[TimeCurve]:
    """Return motion, force of the wall, and the energies that can be seen.

    The potential of the load is relative to its initial value, and omitted for
    quasi-static loading.
    """
    found = [
        TimeCurve(MOTION, scenario.motion(columns)),
        TimeCurve(FORCE, columns["wall_force"]),
    ]
    largest = max(columns["kinetic"].max(), columns["elastic"].max())
    for look in ENERGIES:
        if look.column not in columns:
            continue
        values = columns[look.column]
        name = look.name
        if look.column == "translation" and not scenario.is_thrown:
            name = "motion"
        if look.column == "load":
            if scenario.static:
                continue
            if scenario.is_thrown:
                name = "height"
            values = values - values[0]
        if np.abs(values).max() > VISIBLE_ENERGY * largest:
            found.append(TimeCurve(look, values, name))
    return found


def axis_labels(words: Words) -> tuple[str, str, str]:
    return words.motion, FORCE_LABEL, ENERGY_LABEL


def last_motion(columns: Columns) -> float:
    """Return the time at which the curves over time end [R/c]: that of the last motion
    that can be seen."""
    t = columns["t"]
    kinetic = columns["kinetic"]
    moving = np.flatnonzero(kinetic > AT_REST * kinetic.max())
    if moving.size:
        return float(t[moving[-1]])
    return float(t[-1])


@dataclass(frozen=True)
class PlotScene:
    """What a plot shows, which can be drawn in a process without Taichi.

    Attributes:
        words: names of the quantities.
        numbers: results by name.
        columns: time series, as in timeseries.csv.
        contact: the contact in it.
        curves: curves over time.
        quality: (rows,) accuracy of the run.
        laws: continuum laws for the compression, (rows,) [R], by name.
        static: whether the rows are equilibria of a loading.
        origin: metadata of the file.
    """

    words: Words
    numbers: Numbers
    columns: Columns
    contact: Contact
    curves: list[TimeCurve]
    quality: Array
    laws: Columns
    static: bool
    origin: str


def plot_scene(scenario: Scenario, columns: Columns) -> PlotScene:
    """Return what the plot of a run shows."""
    return PlotScene(
        words=scenario.words,
        numbers=scenario.result(columns),
        columns=columns,
        contact=Contact(columns),
        curves=curves(scenario, columns),
        quality=scenario.quality(columns),
        laws=scenario.continuum(columns),
        static=scenario.static,
        origin=origin(scenario.stored_scene),
    )


def plot_run(path: Path, scene: PlotScene, headline: str = "") -> None:
    """Draw the time series of a run into a bitwise reproducible PNG. Raises
    SimulationError if the file cannot be written."""
    from matplotlib.image import imsave

    figure: Any = run_figure(scene, headline)
    metadata: Any = {"Software": None, "Description": scene.origin}
    write = partial(
        imsave,
        arr=figure.canvas.buffer_rgba(),
        dpi=figure.dpi,
        metadata=metadata,
        pil_kwargs={"compress_level": 3},
    )
    atomic_write(path, write)


def run_figure(scene: PlotScene, headline: str) -> Plot:
    """Return the plot of a run under the result to quote."""
    figure = picture_of(draw_plot, scene)
    parameters = "    ".join(scene.words.title[1:])
    # breaks between the parts only
    unbroken = re.sub(r"(?<! ) (?! )", "\u00a0", parameters)
    lines = [fill(unbroken, TITLE_WIDTH), fill(headline, TITLE_WIDTH)]
    title = "\n".join(lines).replace("\u00a0", " ").strip()
    size = min(9.5, TITLE_HEIGHT / len(title.splitlines()))
    with matplotlib_style(STYLE):
        # The plot is drawn already. A title on top of it gives the same pixels, because
        # a figure draws its title last.
        figure.draw_artist(
            figure.suptitle(title, y=0.992, fontsize=size, fontweight="bold")
        )
    return figure


def draw_plot(scene: PlotScene) -> Plot:
    """Return the plot of a run without the title, which needs all lattices."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from taichi_disk.pictures.inline import Plot

    with matplotlib_style(STYLE):
        figure = Plot(figsize=(7.6, 9.2), dpi=120)
        canvas = FigureCanvasAgg(figure)
        if scene.static:
            _draw_loading(figure, scene)
        else:
            _draw_run(figure, scene)
        for ax in figure.axes:
            ax.yaxis.set_label_coords(-0.11, 0.5)
            if ax.get_yscale() == "linear":
                ax.yaxis.set_major_formatter(powers())
        canvas.draw()  # also fixes the style of ticks and grid
    return figure


def _draw_run(figure: Any, scene: PlotScene) -> None:
    words = scene.words
    columns = scene.columns
    t = columns["t"]
    ratios = [*PANEL_HEIGHTS[:2], 0.12, *PANEL_HEIGHTS[2:], 0.8]
    # layout="constrained" would draw everything twice and so double the time of a plot.
    axes = list(
        figure.subplots(
            len(ratios),
            1,
            sharex=True,
            height_ratios=ratios,
            gridspec_kw=LAYOUT,
        )
    )
    axes.pop(2).remove()  # the legend of the energies takes the place of these axes
    motion, force, energies, quality = axes
    quality.set_xlim(t[0], last_motion(columns))
    quality.set_xlabel(words.time)
    for ax, label in zip(axes, axis_labels(words), strict=False):
        ax.set_ylabel(label)
    for curve in scene.curves:
        axes[curve.look.panel].plot(
            t,
            curve.values,
            color=curve.look.colours[0],
            linestyle=curve.look.style,
            label=curve.name,
        )
    _mark_vibration(energies, scene)
    result_mark, force_mark = (mark.format(**scene.numbers) for mark in words.marks)
    _mark(motion, scene.curves[0].values, result_mark, side="right")
    force.annotate(
        force_mark,
        (0.988, 0.92),
        xycoords="axes fraction",
        ha="right",
        va="top",
        color="0.2",
    )
    everything = columns["total"] - columns["load"][0]
    energies.plot(t, everything, label="sum of all", **_SUM_LINE)
    energies.legend(
        loc="lower center",
        bbox_to_anchor=(0.54, 1.0),
        ncols=4,
        borderaxespad=0.2,
        columnspacing=1.4,
    )
    quality_label, scale = words.quality
    quality.plot(t, scene.quality, color=LINE)
    quality.set(ylabel=quality_label, yscale=scale)


def _mark_vibration(ax: Any, scene: PlotScene) -> None:
    """Mark the energy of vibration, kinetic and elastic, that is left after an impact
    by a dot."""
    flight = scene.columns["translation"][0]
    if not flight:
        return
    left = scene.contact.vibration_left
    ax.plot(
        [scene.contact.results_time],
        [left * flight],
        color=LOOKS["vibration"].colours[0],
        linestyle="none",
        marker="o",
        markersize=4,
        clip_on=False,
        label=f"vibration left {100.0 * left:.2g} %",
    )


def _draw_loading(figure: Any, scene: PlotScene) -> None:
    words = scene.words
    columns = scene.columns
    xi = columns["xi"]
    load = columns["wall_force"]
    # room for half of the last number of the axis, such as 0.0175
    layout = LAYOUT | {"right": 0.965}
    force, energy = figure.subplots(
        2, 1, sharex=True, height_ratios=(2.0, 1.0), gridspec_kw=layout
    )
    force.plot(xi, load, "o-", color=LINE, markersize=4, label="equilibria")
    for (name, law), style in zip(scene.laws.items(), ("--", ":"), strict=False):
        force.plot(law, load, style, color=SUM, label=name)
    _mark(force, load, words.marks[0].format(**scene.numbers), side="left")
    for name in ("elastic", "wall"):
        look = LOOKS[name]
        energy.plot(
            xi,
            columns[name],
            label=look.name,
            color=look.colours[0],
            linestyle=look.style,
        )
    stored = columns["elastic"] + columns["wall"]
    energy.plot(xi, stored, label="sum: work of the load", **_SUM_LINE)
    force.set_ylabel("load P  [Mc²/R]")
    energy.set(xlabel=words.motion, ylabel=ENERGY_LABEL)
    force.legend(loc="lower right")
    energy.legend(loc="upper left")


def _mark(ax: Any, values: Array, text: str, side: str) -> None:
    """Draw a line at the last of `values`, and write `text` below its "left" or "right"
    end."""
    ax.axhline(values[-1], color=MARK, linewidth=1.0, linestyle=(0, (5, 4)))
    ax.annotate(
        text,
        xy=(0.02 if side == "left" else 0.98, values[-1]),
        xycoords=ax.get_yaxis_transform(),
        xytext=(0, -3),
        textcoords="offset points",
        ha=side,
        va="top",
        color="0.2",
    )
