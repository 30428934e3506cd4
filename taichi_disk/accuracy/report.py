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

COLOURS = {"velocity_verlet": BLUE, "trapezoidal": RED, "vefrl": GREEN}
WIDTH = 120  # of tables where there is no terminal


def report(findings: Findings, out: Path, title: str) -> None:
    """Write accuracy.md and error_sources.csv into `out`; where there are time steps, accuracy.csv and accuracy.png.

    The sentence and the tables are shown on stdout, too. Raises SimulationError for a full disk.
    """
    from rich.console import Console
    from rich.markdown import Markdown

    text = tables(findings)
    write_text(out / "accuracy.md", f"# {title}\n\n{findings.sentence}.\n\n{text}\n")
    columns = ("source", "change", "result", "difference", "remark")
    write_csv(out / "error_sources.csv", [{name: getattr(one, name) for name in columns} for one in findings.sources])
    if findings.steps:
        write_csv(out / "accuracy.csv", [asdict(one) for one in findings.steps])
        draw(findings, out / "accuracy.png", title)
    print(findings.sentence)
    Console(width=None if sys.stdout.isatty() else WIDTH).print(Markdown(text))


def tables(findings: Findings) -> str:
    """In Markdown: of the time steps, where there are any, and of the other sources of error."""
    lines = []
    if findings.steps:
        lines += ["| integrator | step/limit | steps | ms | ns/spring | error | position | energy |", "|---" * 8 + "|"]
    for p in findings.steps:
        name, cost = p.integrator + " (run)" * p.own, f"{1e3 * p.seconds:.1f} | {p.ns_per_spring_and_step:.1f}"
        errors = f"{p.error:.1e} | {p.trajectory_error:.1e} | {p.closing_imbalance:+.1e}"
        lines.append(f"| {name} | {p.fraction:.2g} | {p.steps:,} | {cost} | {errors} |")
    lines += ["", f"| source of error | change | {findings.name} | difference |", "|---" * 4 + "|"]
    for one in findings.sources:
        difference = one.remark.replace("|", "/") or f"{one.difference:+.1e}"
        lines.append(f"| {one.source} | {one.change} | {one.result:.7g} | {difference} |")
    if math.isfinite(findings.scatter):
        name = f"mean and standard deviation of {len(findings.samples)}"
        lines.append(f"| lattice sample | {name} | {np.nanmean(findings.samples):.7g} | ± {findings.scatter:.1e} |")
    return "\n".join(lines)


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
