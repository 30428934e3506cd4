"""Plot any result of a sweep against any of its axes: means over lattices, with
bars."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes

from taichi_disk.errors import InputError
from taichi_disk.figures.axes import (
    FONT,
    SYMBOLS,
    curve_label,
    curve_styles,
    explain_bars,
    log_if_wide,
    one_plot,
    to_change,
)
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
    in_order = sorted(with_number, key=lambda row: (not _is_number(row[x]), row[x]))
    with matplotlib_style({**STYLE, **FONT}):
        curves = grouped(in_order, others)
        figure, ax = one_plot(2.6 + 0.09 * len(curves))
        _draw_curves(ax, curves, others, x, y)
        if isinstance(in_order[0][x], float):
            log_if_wide(ax, np.array([row[x] for row in in_order]))
        _set_labels(ax, base, x, y)
        figure.legend(loc="outside upper center", ncols=2)
        return to_change(figure)


def _draw_curves(
    ax: Axes,
    curves: dict[tuple[Any, ...], list[Row]],
    names: Sequence[str],
    x: str,
    y: str,
) -> None:
    """Draw the mean of column `y` at each value of the axis `x`. `curves`: rows by the
    values of the other axes, `names`."""
    lattices: set[int] = set()
    styles = curve_styles(len(curves))
    for style, (values, rows) in zip(styles, curves.items(), strict=True):
        numbers = {}
        for (place,), members in grouped(rows, [x]).items():
            numbers[place] = [row[y] for row in members]
            lattices.add(len(members))
        ax.errorbar(
            list(numbers),
            [np.mean(several) for several in numbers.values()],
            [_deviation(several) for several in numbers.values()],
            linestyle="-",
            markersize=3.5,
            label=curve_label(dict(zip(names, values, strict=True))),
            **style,
        )
    explain_bars(ax, lattices)


def _deviation(numbers: Sequence[float]) -> float:
    """Return the standard deviation, 0 for a single lattice."""
    if len(numbers) == 1:
        return 0.0
    return float(np.std(numbers, ddof=1))


def _is_number(value: Any) -> bool:
    return isinstance(value, (int, float))


def _set_labels(ax: Axes, base: Scene, axis: str, y: str) -> None:
    target = target_of(base, axis)
    assert target is not None  # `axis` is swept
    section, key = target
    unit = base.sections()[section].schema()[key].unit
    symbol = SYMBOLS.get(key) or key.replace("_", " ")
    ax.set_xlabel(_label(symbol, unit))
    without_unit = (y.replace("_", " "), "")
    ax.set_ylabel(_label(*LABELS.get(y, without_unit)))


def _label(name: str, unit: str) -> str:
    if unit:
        return f"{name}  [{unit}]"
    return name
