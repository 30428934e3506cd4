"""Plot any result of a sweep against any of its axes: means over lattices, with
bars."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from taichi_disk.errors import InputError
from taichi_disk.figures import curves as drawing
from taichi_disk.figures.curves import FONT, SYMBOLS, Row, grouped
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
    if (axis := names.get(target_of(base, x))) is None:
        raise InputError(f"x: {x} is not swept; there are {', '.join(axes)}")
    done = [
        row
        for row in rows
        if row["status"] == "done" and isinstance(row.get(y), (int, float))
    ]
    if not done:
        raise InputError(
            f"y: no row has a number {y}; there are {', '.join(_numeric(rows))}"
        )
    seed = names.get(("lattice", "seed"))
    curves = grouped(
        done, others := [name for name in axes if name not in (axis, seed)]
    )
    with matplotlib_style({**STYLE, **FONT}):
        figure, ax = drawing.one_plot(2.6 + 0.09 * len(curves))
        counts = set[int]()
        for style, (values, members) in zip(
            drawing.curve_styles(len(curves)), curves.items(), strict=True
        ):
            at = {
                place: [row[y] for row in group]
                for (place,), group in grouped(members, [axis]).items()
            }
            places = (
                sorted(at)
                if all(isinstance(place, (int, float)) for place in at)
                else list(at)
            )
            counts |= {len(at[place]) for place in places}
            means = [np.mean(at[place]) for place in places]
            bars = [
                np.std(at[place], ddof=1) if len(at[place]) > 1 else np.nan
                for place in places
            ]
            label = (
                drawing.curve_label(dict(zip(others, values, strict=True)))
                if others
                else None
            )
            ax.errorbar(
                places, means, bars, **style, linestyle="-", markersize=3.5, label=label
            )
        drawing.explain_bars(ax, counts)
        if isinstance(done[0][axis], float):
            drawing.log_if_wide(ax, np.array([row[axis] for row in done]))
        section, key = target_of(base, axis) or ("", "")
        unit = base.sections()[section].schema()[key].unit
        ax.set_xlabel(_label(SYMBOLS.get(key) or key.replace("_", " "), unit))
        ax.set_ylabel(_label(*LABELS.get(y, (y.replace("_", " "), ""))))
        if ax.get_legend_handles_labels()[1]:
            figure.legend(loc="outside upper center", ncols=2)
        return drawing.to_change(figure)


def _numeric(rows: Sequence[Row]) -> list[str]:
    return list(
        dict.fromkeys(
            name
            for row in rows
            for name, value in row.items()
            if isinstance(value, (int, float))
        )
    )


def _label(name: str, unit: str) -> str:
    return f"{name}  [{unit}]" if unit else name
