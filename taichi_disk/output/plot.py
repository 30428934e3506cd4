"""Draw plot.png: the curves of a run over time or, for a quasi-static loading, over
compression.

Matplotlib takes 0.3 s to import, so it is imported only when something is drawn.
"""

from __future__ import annotations

import gc
import io
import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from textwrap import fill
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from taichi_disk.computation.contact import results_time, vibration_left
from taichi_disk.machine import cores, python_command
from taichi_disk.output.files import Array, atomic_write, origin
from taichi_disk.signals import ignored_by_children
from taichi_disk.simulation.observables import BLUE, BY_NAME, SKY, of_kind

if TYPE_CHECKING:
    from taichi_disk.computation.scenario import Scenario
    from taichi_disk.output.inline import Plot

Columns = dict[str, Array]
Begin = Callable[..., Callable[[], None]]

STYLE: dict[Any, Any] = {
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
LINE, MARK, SUM = BLUE, "0.45", "#222222"
# energies that stay below this fraction of the largest one are not drawn
VISIBLE_ENERGY = 2e-3
# relative heights of the panels for motion, force and energies
PANEL_HEIGHTS = (1.2, 1.0, 1.5)
# fractions of the figure
LAYOUT = {"left": 0.145, "right": 0.98, "bottom": 0.055, "top": 0.945, "hspace": 0.17}
_LOCK = threading.Lock()
_DRAW = "from taichi_disk.output.plot import _draw_received; _draw_received()"
# after this time the plot is drawn again in this process [s]; it takes 0.5 s, but a
# first import of Matplotlib looks at all fonts
_DRAWING_TIME = 60.0
_ENVIRONMENT = {"MPLBACKEND": "agg", "OPENBLAS_NUM_THREADS": "1"}


@contextmanager
def matplotlib_style(style: dict[Any, Any]) -> Iterator[None]:
    """Replace the user's matplotlibrc by `style` while the block runs, in one thread at
    a time: settings are global."""
    import matplotlib

    with _LOCK, matplotlib.rc_context():
        matplotlib.rcdefaults()
        matplotlib.rcParams.update(style)
        yield


def draw_curves(
    axes: list[Any], scenario: Scenario, columns: Columns, **line: Any
) -> list[Any]:
    """Draw motion, force of the wall and energies over time on three axes; return the
    lines.

    The potential of the load is drawn relative to its initial value, and omitted for
    quasi-static loading. A dot marks the energy of vibration, kinetic and elastic, that
    is left after an impact.
    """
    largest = max(columns["kinetic"].max(), columns["elastic"].max())
    motion, label = scenario.motion(columns)
    curves = [(axes[0], motion, LINE, ""), (axes[1], columns["wall_force"], LINE, "")]
    for name in of_kind("part", "energy", "loss"):
        column = BY_NAME[name]
        if (
            column.label
            and name in columns
            and not (scenario.static and name == "load")
        ):
            values = columns[name] - (columns["load"][0] if name == "load" else 0.0)
            if np.abs(values).max() > VISIBLE_ENERGY * largest:
                curves.append((axes[2], values, column.colour, column.label))
    for ax, name in zip(
        axes,
        (label, "wall's force on\nthe disk  [Mc²/R]", "energy  [Mc²]"),
        strict=False,
    ):
        ax.set_ylabel(name)
    axes[-1].set_xlabel(scenario.time_label)
    t, flight = (
        columns["t"],
        columns["translation"][0] if "translation" in columns else 0.0,
    )
    lines = [
        ax.plot(t, curve, color=colour, label=name, **line)[0]
        for ax, curve, colour, name in curves
    ]
    if flight:
        left = vibration_left(columns)
        dot: dict[str, Any] = {
            "color": SKY,
            "marker": "o",
            "markersize": 4,
            "clip_on": False,
        }
        name = (
            f"vibration left {100.0 * left:.2g} %"
            if abs(left) >= 1e-4
            else "vibration left < 0.01 %"
        )
        lines += axes[2].plot(
            [results_time(columns)], [left * flight], label=name, **dot, **line
        )
    return lines


def plot_run(
    path: Path, scenario: Scenario, columns: Columns, headline: str = ""
) -> None:
    """Draw the time series of a run (columns as in timeseries.csv) into a bitwise
    reproducible PNG, under a headline.

    Raises SimulationError if the file cannot be written.
    """
    with matplotlib_style(STYLE):
        figure = _drawn(scenario, columns, headline)
        metadata = {"Software": None, "Description": origin(scenario.scene)}
        atomic_write(
            path,
            lambda new: figure.savefig(
                new, metadata=metadata, pil_kwargs={"compress_level": 3}
            ),
        )


def run_figure(scenario: Scenario, columns: Columns, headline: str = "") -> Plot:
    with matplotlib_style(STYLE):
        figure = _drawn(scenario, columns, headline)
        figure.draw_without_rendering()  # fixes the style of ticks and grid
    return figure


def _drawn(scenario: Scenario, columns: Columns, headline: str) -> Plot:
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from taichi_disk.output.inline import Plot

    figure = Plot(figsize=(7.6, 9.2), dpi=120)
    FigureCanvasAgg(figure)
    title = fill("    ".join([*scenario.title()[1:], headline]).strip(), 95)
    figure.suptitle(title, y=0.99, fontsize=9.5, fontweight="bold")
    (_draw_loading if scenario.static else _draw_run)(figure, scenario, columns)
    for ax in figure.axes:
        ax.yaxis.set_label_coords(-0.11, 0.5)
    return figure


@contextmanager
def plotting_beside(film: bool) -> Iterator[Begin]:
    """Import Matplotlib and draw in a second process while the block runs; a thread
    would wait for Python's lock.

    Yields a function that starts `plot_run` with its arguments and returns a function
    that waits for the plot. This process draws if the second one fails, or if it has
    already imported Matplotlib and no `film` is made.
    """
    child = None
    if film or "matplotlib" not in sys.modules:
        with suppress(OSError), ignored_by_children():
            child = subprocess.Popen(
                python_command(_DRAW),
                stdin=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, **_ENVIRONMENT},
            )

    def begin(
        path: Path, scenario: Scenario, columns: Columns, headline: str = ""
    ) -> Callable[[], None]:
        drawing = None
        if child:
            answers = _plot_answers(scenario, columns)
            job = pickle.dumps((path, answers, columns, headline))
            # in a thread, because a process that hangs does not empty the pipe
            drawing = thread.submit(child.communicate, job, _DRAWING_TIME)

        def end() -> None:
            if drawing:
                with suppress(subprocess.TimeoutExpired):
                    drawing.result()
            if not path.exists():
                plot_run(path, scenario, columns, headline)

        return end

    with ThreadPoolExecutor(1) as thread:
        try:
            yield begin
        finally:
            if child:
                child.kill()
                child.wait()


def _draw_received() -> None:
    """Draw the plot whose arguments arrive at standard input, and end this process."""
    gc.disable()  # this process ends before collecting would pay
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    # draw a first figure during the run: it loads fonts and fills caches, which takes
    # 0.1 s
    if cores() > 1:
        figure = Figure()
        FigureCanvasAgg(figure)
        ax = figure.subplots()
        ax.plot([0.0, 1.0], label="$x$")
        ax.legend()
        figure.savefig(io.BytesIO())
    plot_run(*pickle.load(sys.stdin.buffer))
    os._exit(0)  # saves 0.1 s of unloading the libraries


def _plot_answers(scenario: Scenario, columns: Columns) -> Any:
    """Return a picklable stand-in for `scenario` with ready answers, so that the second
    process needs no Taichi."""
    questions = (
        ("motion", "marks", "continuum")
        if scenario.static
        else ("motion", "marks", "quality", "last_motion")
    )
    answers = {name: getattr(scenario, name)(columns) for name in questions} | {
        "title": scenario.title()
    }
    answer_functions = {
        name: partial(_answer, answer) for name, answer in answers.items()
    }
    scene = SimpleNamespace(to_yaml=partial(_answer, scenario.scene.to_yaml()))
    return SimpleNamespace(
        scene=scene,
        static=scenario.static,
        time_label=scenario.time_label,
        **answer_functions,
    )


def _answer(answer: Any, *_: Any) -> Any:
    return answer


def _draw_run(figure: Any, scenario: Scenario, columns: Columns) -> None:
    t, quality, (result, note) = (
        columns["t"],
        scenario.quality(columns),
        scenario.marks(columns),
    )
    ratios = (*PANEL_HEIGHTS[:2], 0.12, *PANEL_HEIGHTS[2:], *([0.8] if quality else []))
    # layout="constrained" would draw everything twice and so double the time of a plot.
    axes = list(
        figure.subplots(
            len(ratios), 1, sharex=True, height_ratios=ratios, gridspec_kw=LAYOUT
        )
    )
    axes.pop(2).remove()  # the legend of the energies takes the place of these axes
    axes[-1].set_xlim(t[0], scenario.last_motion(columns))
    motion = draw_curves(axes, scenario, columns)[0]
    _mark(axes[0], t, motion.get_ydata(), result)
    axes[1].annotate(
        note, (0.988, 0.92), xycoords="axes fraction", ha="right", va="top", color="0.2"
    )
    axes[2].plot(
        t,
        columns["total"] - columns["load"][0],
        color=SUM,
        linestyle=(0, (4, 2)),
        label="sum of all",
    )
    axes[2].legend(
        loc="lower center",
        bbox_to_anchor=(0.54, 1.0),
        ncols=4,
        borderaxespad=0.2,
        columnspacing=1.4,
    )
    if quality:
        values, label, scale = quality
        axes[3].plot(t, values, color=LINE)
        axes[3].set(ylabel=label, yscale=scale)


def _draw_loading(figure: Any, scenario: Scenario, columns: Columns) -> None:
    (xi, label), load = scenario.motion(columns), columns["wall_force"]
    force, energy = figure.subplots(
        2, 1, sharex=True, height_ratios=(2.0, 1.0), gridspec_kw=LAYOUT
    )
    force.plot(xi, load, "o-", color=LINE, markersize=4, label="equilibria")
    for (name, law), style in zip(
        scenario.continuum(columns).items(), ("--", ":"), strict=False
    ):
        force.plot(law, load, style, color=SUM, label=name)
    _mark(force, xi, load, scenario.marks(columns)[0])
    stored = {name: columns[name] for name in ("elastic", "wall")}
    for name, values in stored.items():
        energy.plot(xi, values, label=BY_NAME[name].label, color=BY_NAME[name].colour)
    energy.plot(
        xi,
        sum(stored.values()),
        color=SUM,
        linestyle=(0, (4, 2)),
        label="sum: work of the load",
    )
    force.set_ylabel("load P  [Mc²/R]")
    energy.set(xlabel=label, ylabel="energy  [Mc²]")
    force.legend(loc="lower right")
    energy.legend(loc="upper left")


def _mark(ax: Any, t: Array, values: Array, text: str) -> None:
    level, (start, end) = values[-1], ax.get_xlim()
    before = np.abs(values[t <= start + 0.3 * (end - start)] - level)
    x = 0.02 if before.min() > 0.3 * np.ptp(values) else 0.7
    ax.axhline(level, color=MARK, linewidth=1.0, linestyle=(0, (5, 4)))
    ax.annotate(
        text,
        (x, level),
        (0, -3),
        ax.get_yaxis_transform(),
        "offset points",
        va="top",
        color="0.2",
    )
