"""Plot any result of a sweep against any of its axes: means over lattices, with
bars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from taichi_disk.errors import InputError
from taichi_disk.figures import axes as drawing
from taichi_disk.figures.axes import FONT, SYMBOLS
from taichi_disk.figures.curves import Row, grouped
from taichi_disk.output.inline import Plot
from taichi_disk.output.plot import STYLE, matplotlib_style
from taichi_disk.scenes import Scene
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.impact import ImpactScenario
from taichi_disk.scenes.sweep_axes import target_of

LABELS = Compression.labels | ImpactScenario.labels  # name and unit of each result


def result_figure(
    base: Scene, axes: Sequence[str], rows: Sequence[Row], x: str, y: str
) -> Plot:
    """Return the figure of column `y` of points.csv against the axis `x`, with a curve
    for each value of other axes.

    `base`: a scene of the sweep; `axes`: the swept keys; `rows`: rows of points.csv, of
    which those without a number in `y` are left out. Raises InputError if `x` is not
    swept, or `y` is no column of numbers.
    """
    names = {target_of(base, name): name for name in axes}
    axis = names.get(target_of(base, x))
    if axis is None:
        raise InputError(f"x: {x} is not swept; there are {', '.join(axes)}")
    done = [row for row in rows if row["status"] == "done" and _is_number(row.get(y))]
    if not done:
        raise InputError(
            f"y: no row has a number {y}; there are {', '.join(_numeric(rows))}"
        )
    seed = names.get(("lattice", "seed"))
    others = [name for name in axes if name not in (axis, seed)]
    with matplotlib_style({**STYLE, **FONT}):
        return _figure(base, axis, others, done, y)


def _figure(
    base: Scene, axis: str, others: Sequence[str], rows: Sequence[Row], y: str
) -> Plot:
    """Draw column `y` of `rows` against `axis`, a curve for each value of `others`."""
    curves = grouped(rows, others)
    figure, ax = drawing.one_plot(2.6 + 0.09 * len(curves))
    counts: set[int] = set()
    styles = drawing.curve_styles(len(curves))
    for style, (values, members) in zip(styles, curves.items(), strict=True):
        places, means, deviations, lattices = _means(members, axis, y)
        counts.update(lattices)
        label = None
        if others:
            label = drawing.curve_label(dict(zip(others, values, strict=True)))
        ax.errorbar(
            places,
            means,
            deviations,
            linestyle="-",
            markersize=3.5,
            label=label,
            **style,
        )
    drawing.explain_bars(ax, counts)
    if isinstance(rows[0][axis], float):
        drawing.log_if_wide(ax, np.array([row[axis] for row in rows]))
    _set_labels(ax, base, axis, y)
    _, labels = ax.get_legend_handles_labels()
    if labels:
        figure.legend(loc="outside upper center", ncols=2)
    return drawing.to_change(figure)


def _means(
    rows: Sequence[Row], axis: str, y: str
) -> tuple[list[Any], list[float], list[float], list[int]]:
    """Return the places on `axis`, sorted if they are numbers, and at each of them the
    mean of column `y` over lattices, its standard deviation (NaN for a single lattice),
    and the number of lattices."""
    at = {}
    for (place,), group in grouped(rows, [axis]).items():
        at[place] = [row[y] for row in group]
    places = list(at)
    if all(_is_number(place) for place in places):
        places.sort()
    means = [float(np.mean(at[place])) for place in places]
    lattices = [len(at[place]) for place in places]
    deviations = []
    for place in places:
        deviation = np.nan
        if len(at[place]) > 1:
            deviation = float(np.std(at[place], ddof=1))
        deviations.append(deviation)
    return places, means, deviations, lattices


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float))


def _numeric(rows: Sequence[Row]) -> list[str]:
    """Return the names of columns with numbers, in their order."""
    names: dict[str, None] = {}
    for row in rows:
        for name, value in row.items():
            if _is_number(value):
                names[name] = None
    return list(names)


def _set_labels(ax: Axes, base: Scene, axis: str, y: str) -> None:
    section, key = target_of(base, axis) or ("", "")
    unit = base.sections()[section].schema()[key].unit
    symbol = SYMBOLS.get(key) or key.replace("_", " ")
    ax.set_xlabel(_label(symbol, unit))
    name, unit = LABELS.get(y, (y.replace("_", " "), ""))
    ax.set_ylabel(_label(name, unit))


def _label(name: str, unit: str) -> str:
    if unit:
        return f"{name}  [{unit}]"
    return name
