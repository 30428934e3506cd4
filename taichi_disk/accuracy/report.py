"""What `taichi-disk accuracy` shows and leaves: a sentence, tables, CSV files and the work-precision diagram."""

from __future__ import annotations

import math
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from taichi_disk.accuracy.study import Findings
from taichi_disk.output.files import atomic_write, write_csv, write_text
from taichi_disk.output.plot import BLUE, GREEN, RED

Table = tuple[list[str], list[list[str]]]  # heads, rows

COLOURS = {"velocity_verlet": BLUE, "trapezoidal": RED, "vefrl": GREEN}
WIDTH = 120  # of tables where there is no terminal


def tables(findings: Findings) -> list[Table]:
    """Of the time steps, where there are any, and of all sources of error."""
    heads = ["integrator", "step / limit", "steps", "time [ms]", "ns/spring/step", "error", "position [R]", "energy"]
    steps = [
        [
            p.integrator + " (run)" * p.own,
            *(f"{p.fraction:.2g}", f"{p.steps:,}", f"{1e3 * p.seconds:.1f}", f"{p.ns_per_spring_and_step:.1f}"),
            *(f"{p.error:.1e}", f"{p.trajectory_error:.1e}", f"{p.closing_imbalance:+.1e}"),
        ]
        for p in findings.steps
    ]
    sources = [
        [one.source, one.change, f"{one.result:.7g}", one.remark or f"{one.difference:+.1e}"]
        for one in findings.sources
    ]
    if math.isfinite(findings.scatter):
        mean = np.nanmean(findings.samples)
        name = f"mean and standard deviation of {len(findings.samples)}"
        sources.append(["lattice sample", name, f"{mean:.7g}", f"± {findings.scatter:.1e}"])
    if findings.step_dependent:
        sources.append(["time step", "that of `run`", sources[0][2], f"± {findings.step:.1e}"])
    return [(heads, steps)] * bool(steps) + [(["source of error", "change", findings.name, "difference"], sources)]


def print_findings(findings: Findings) -> None:
    """The sentence and the tables on stdout."""
    from rich.console import Console
    from rich.table import Table as Screen

    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    print(findings.sentence)
    for heads, rows in tables(findings):
        screen = Screen(*heads)
        for row in rows:
            screen.add_row(*row)
        console.print(screen)


def write_findings(findings: Findings, out: Path, title: str) -> None:
    """Write accuracy.md and error_sources.csv into `out`; where there are time steps, accuracy.csv and accuracy.png.

    Raises SimulationError for a full disk.
    """
    parts = [f"# {title}", f"{findings.sentence}."]
    for heads, rows in tables(findings):
        lines = [heads, ["---"] * len(heads), *rows]
        parts.append("\n".join(f"| {' | '.join(cell.replace('|', '/') for cell in line)} |" for line in lines))
    write_text(out / "accuracy.md", "\n\n".join(parts) + "\n")
    columns = ("source", "change", "result", "difference", "remark")
    write_csv(out / "error_sources.csv", [{name: getattr(one, name) for name in columns} for one in findings.sources])
    if findings.steps:
        write_csv(out / "accuracy.csv", [asdict(one) for one in findings.steps])
        draw(findings, out / "accuracy.png", title)


def draw(findings: Findings, path: Path, title: str) -> None:
    """Error (y) against cost (x): lower and farther left is better. A ring: the step that `run` takes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 4.4), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots()
    for name, colour in COLOURS.items():
        curve = [p for p in findings.steps if p.integrator == name and math.isfinite(p.error)]
        if curve:
            axes.loglog([p.seconds for p in curve], [p.error for p in curve], "o-", color=colour, ms=4, label=name)
        for p in curve:
            if p.own:
                axes.loglog(p.seconds, p.error, "o", ms=12, mfc="none", color=colour)
    axes.set_xlabel("time to solution  [s]")
    axes.set_ylabel(f"error of {findings.name}")
    axes.set_title(title, fontsize=10)
    axes.grid(True, which="both", color="0.92")
    axes.legend(frameon=False, title="ring: the step that run takes", fontsize=8, title_fontsize=8)
    atomic_write(path, lambda new: figure.savefig(new, metadata={"Software": None}))
