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
from taichi_disk.scenes import Scene, compression, impact
from taichi_disk.scenes.sweep_axes import target_of

LABELS = compression.LABELS | impact.LABELS  # name and unit of each result


def result_figure(
    base: Scene, axes: Sequence[str], rows: Sequence[Row], x: str, y: str
) -> Plot:
    """Return the figure of column `y` of points.csv against the axis `x`, with a curve
    for each value of other axes.

    `base`: a scene of the sweep; `axes`: the swept keys; `rows`: rows of points.csv, of
    which those without a number in `y` are left out. Raises InputError if `x` is not
    swept, or `y` is no column of numbers.
    """
    if x not in axes:
        raise InputError(f"x: {x} is not swept; there are {', '.join(axes)}")
    with_number = [row for row in rows if _is_number(row.get(y))]
    if not with_number:
        columns = [name for name, value in rows[0].items() if _is_number(value)]
        raise InputError(f"y: no row has a number {y}; there are {', '.join(columns)}")
    others = [name for name in axes if name not in (x, "seed", "lattice.seed")]
    with matplotlib_style({**STYLE, **FONT}):
        return _figure(base, x, others, with_number, y)


def _figure(
    base: Scene, axis: str, others: Sequence[str], rows: Sequence[Row], y: str
) -> Plot:
    """Draw column `y` of `rows` against `axis`, a curve for each value of `others`."""
    rows = sorted(rows, key=lambda row: (not _is_number(row[axis]), row[axis]))
    curves = grouped(rows, others)
    figure, ax = drawing.one_plot(2.6 + 0.09 * len(curves))
    counts: set[int] = set()
    styles = drawing.curve_styles(len(curves))
    for style, (values, members) in zip(styles, curves.items(), strict=True):
        at_place: dict[Any, list[float]] = {}
        for row in members:
            at_place.setdefault(row[axis], []).append(row[y])
        counts.update(len(numbers) for numbers in at_place.values())
        ax.errorbar(
            list(at_place),
            [np.mean(numbers) for numbers in at_place.values()],
            # 0 for a single lattice
            [np.std(one, ddof=min(1, len(one) - 1)) for one in at_place.values()],
            linestyle="-",
            markersize=3.5,
            label=drawing.curve_label(dict(zip(others, values, strict=True))),
            **style,
        )
    drawing.explain_bars(ax, counts)
    if isinstance(rows[0][axis], float):
        drawing.log_if_wide(ax, np.array([row[axis] for row in rows]))
    _set_labels(ax, base, axis, y)
    figure.legend(loc="outside upper center", ncols=2)
    return drawing.to_change(figure)


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float))


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
