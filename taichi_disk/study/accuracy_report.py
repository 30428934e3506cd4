"""What `taichi-disk accuracy` leaves: tables, CSV files and the work-precision diagram."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Sequence
from dataclasses import asdict, fields
from pathlib import Path

import numpy as np

from taichi_disk.output import atomic_write, prepare_output
from taichi_disk.results import write_text
from taichi_disk.study.accuracy import Point
from taichi_disk.study.error_sources import Source

MARKS = {0.8: "o", 0.95: "|"}  # steps that a reader looks for, as fractions of the stability limit


def write(points: list[Point], sources: list[Source], out: Path, title: str) -> str:
    """Write accuracy.csv, error_sources.csv, accuracy.md and accuracy.png; returns the text of accuracy.md."""
    prepare_output(out)
    atomic_write(out / "accuracy.csv", lambda beside: _write_rows(points, beside))
    atomic_write(out / "error_sources.csv", lambda beside: _write_rows(sources, beside))
    text = "\n".join([*steps_table(points), "", *sources_table(sources)])
    write_text(out / "accuracy.md", text + "\n")
    draw(points, out / "accuracy.png", title)
    return text


def _write_rows(rows: Sequence[Point | Source], path: Path) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [field.name for field in fields(rows[0])], lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(row) for row in rows)


def steps_table(points: list[Point]) -> Iterator[str]:
    yield (
        "| integrator | precision | step / limit | steps | time [ms] | ns/spring/step "
        "| error | largest position error [R] | energy imbalance |"
    )
    yield "|---|---|---|---|---|---|---|---|---|"
    for p in points:
        yield (
            f"| {p.integrator} | {p.precision} | {p.fraction:g} | {p.steps:,} | {1e3 * p.seconds:.1f} "
            f"| {p.ns_per_spring_and_step:.1f} | {p.error:.1e} | {p.trajectory_error:.1e} "
            f"| {p.closing_imbalance:+.1e} |"
        )


def sources_table(sources: list[Source]) -> Iterator[str]:
    """The sources in Markdown; last, how far lattice samples scatter."""
    yield "| source of error | change | headline | difference |"
    yield "|---|---|---|---|"
    for s in sources:
        yield f"| {s.source} | {s.change} | {s.headline:.7g} | {s.difference:+.1e} |"
    samples = [s.headline for s in sources if s.source == "lattice sample"]
    base = next(s.headline for s in sources if s.source == "time step")
    mean, scatter = np.mean([base, *samples]), np.std([base, *samples], ddof=1)
    yield f"| lattice sample | mean and standard deviation of {len(samples) + 1} seeds | {mean:.7g} | ± {scatter:.1e} |"


def draw(points: list[Point], path: Path, title: str) -> None:
    """Error on x, time on y; a ring where the step is 0.8 of the limit, what `dt: auto` takes, a bar at 0.95."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.4), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for name, colour in (("velocity_verlet", "#0072B2"), ("trapezoidal", "#D55E00"), ("vefrl", "#009E73")):
        for precision, style in (("f64", "o-"), ("f32", ".--")):
            curve = [p for p in points if (p.integrator, p.precision) == (name, precision)]
            if not curve:
                continue
            label = f"{name}, {precision}"
            axes.loglog([p.error for p in curve], [p.seconds for p in curve], style, color=colour, label=label)
            for p in curve:
                if p.fraction in MARKS:
                    axes.loglog(p.error, p.seconds, MARKS[p.fraction], ms=12, mfc="none", color=colour)
    axes.set_xlabel("error of the headline")
    axes.set_ylabel("time to solution, one core  [s]")
    axes.set_title(title, fontsize=10)
    axes.grid(True, which="both", color="0.92")
    axes.legend(
        frameon=False, title="ring: 0.8 of the stability limit (automatic); bar: 0.95", fontsize=8, title_fontsize=8
    )
    atomic_write(path, lambda beside: figure.savefig(beside, metadata={"Software": None}))
