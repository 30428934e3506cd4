"""Compare the time step's error with the effects of lattice, number of points and wall
on the result."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.accuracy.steps import StepError, StepStudy
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.stability import spectrum
from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.integrators import INTEGRATORS
from taichi_disk.output.files import (
    atomic_write,
    prepare_output,
    remove_empty,
    write_csv,
    write_text,
)
from taichi_disk.output.plot import matplotlib_style
from taichi_disk.output.run_folder import refuse_run
from taichi_disk.progress import Progress, terminal
from taichi_disk.scenes import Scene
from taichi_disk.simulation.observables import BLUE, GREEN, ORANGE, PINK, RED

SEEDS = 8
# factors of the number of points, at equal mass, stiffness and viscosity of the disk
REFINEMENTS = (4, 16, 64)
MAX_POINTS = 200_000  # largest disk of a refinement, except for the first
HARDNESS_FACTORS = (3.0, 10.0)  # factors of wall.a
SAMPLE = "lattice sample"
POINTS = "points"
WALL = "wall hardness"
# in lattice scatters: a larger difference is an effect of the number of points
SIGNIFICANCE = 2.0
# colours of the integrators
COLOURS = dict(zip(INTEGRATORS, (BLUE, RED, GREEN, ORANGE, PINK), strict=False))
TABLE_WIDTH = 120  # width of a printed table without a terminal


@dataclass(frozen=True)
class Change:
    """A change of the scene and its effect on the primary result."""

    source: str  # source of error
    change: str  # description of the change
    # changed keys, as `DiskScene.with_` takes them
    keys: dict[str, Any] = field(default_factory=dict)
    result: float = math.nan  # primary result; NaN if the run failed
    difference: float = math.nan  # result minus that of the unchanged scene
    remark: str = ""  # why the run failed


@dataclass(frozen=True)
class Findings:
    """Measured errors of the primary result `name`."""

    name: str
    steps: list[StepError]  # empty for an equilibrium
    sources: list[Change]  # the unchanged scene first

    @property
    def step(self) -> float:
        """Error of the primary result at the default step of `run`; 0 for an
        equilibrium."""
        return next((step.error for step in self.steps if step.is_default), 0.0)

    @property
    def samples(self) -> list[float]:
        return [
            self.sources[0].result,
            *(change.result for change in self.sources if change.source == SAMPLE),
        ]

    @property
    def scatter(self) -> float:
        results = [result for result in self.samples if math.isfinite(result)]
        return float(np.std(results, ddof=1)) if len(results) > 1 else math.nan

    def last_difference(self, source: str) -> float:
        """Return the difference due to the last successful change of `source`; NaN if
        there is none."""
        differences = [
            change.difference
            for change in self.sources
            if change.source == source and not change.remark
        ]
        return differences[-1] if differences else math.nan

    @property
    def sentence(self) -> str:
        """Summary of the errors, with advice on the largest."""
        finest = self.last_difference(POINTS)
        scatter = self.scatter
        parts = ["no time step (an equilibrium)"]
        advice = "nothing to gain"
        if self.steps:
            parts = [f"time step {self.step:.1g}"]
            advice = "use smaller steps (time.tolerance)"
        others = (
            ("lattice scatter", scatter),
            ("finest lattice", finest),
            ("hardest wall", self.last_difference(WALL)),
        )
        parts += [
            f"{name} {value:.1g}" for name, value in others if math.isfinite(value)
        ]
        more = []
        if scatter > self.step:
            more.append("seeds")
        if abs(finest) > max(SIGNIFICANCE * scatter, self.step):
            more.append("points")
        if more:
            advice = f"use more {' and '.join(more)}, not smaller steps"
        return f"{self.name}: {', '.join(parts)}: {advice}"


def study(scene: Scene, out: Path, title: str) -> None:
    """Measure the errors of a scene's primary result, print them, and write tables and
    a picture to `out`.

    Raises InputError if `out` holds a run or cannot be written, if the scene's dt
    exceeds the stability limit, or for a wall with friction; SimulationError if the
    scene has no result.
    """
    refuse_run(out)
    made = prepare_output(out)
    try:
        runtime.start()
        with terminal(sys.stderr) as progress:
            findings = assess(scene, progress)
        report(findings, out, title)
    except BaseException:
        remove_empty(made)
        raise
    print(f"files in {out}")


def assess(scene: Scene, progress: Progress) -> Findings:
    scenario = scene.scenario()
    study = None
    progress("simulate", 0, None)
    if scenario.model.has_friction:
        raise InputError(
            "wall.friction: must be 0, because the reference solution needs smooth"
            " forces; `run` also estimates errors"
        )
    if scenario.step_dependent:
        outcome = compute(scenario, estimate=False)
        study = StepStudy(scenario, spectrum(scenario.lattice, scenario.model), outcome)
    others = list(changes(scene))
    base = result_of(scene)
    steps = []
    if study:
        count = 1 + len(study.runs)
        progress("reference and steps", 0, count)
        steps = study.measure(lambda done: progress("reference and steps", done, count))
    sources = [Change("scene", "as it is", result=base, difference=0.0)]
    for number, change in enumerate(others):
        progress("compare", number, len(others))
        sources.append(with_result(scene, base, change))
    return Findings(scene.results[0], steps, sources)


def changes(scene: Scene) -> Iterator[Change]:
    lattice = scene.lattice
    a = scene.wall.a
    if lattice.file == "none":  # user-supplied points have no other random sample
        for seed in range(lattice.seed + 1, lattice.seed + SEEDS):
            yield Change(SAMPLE, f"seed {seed}", {"lattice.seed": seed})
        for factor in REFINEMENTS:
            if factor > REFINEMENTS[0] and factor * lattice.points > MAX_POINTS:
                break
            keys = scene.changes_with("lattice.points", factor * lattice.points)
            # A reset acts on each boundary point like a drag of 2 m/interval.
            if scene.reset_interval:
                keys["wall.reset_interval"] = scene.reset_interval / math.sqrt(factor)
            text = f"N = {factor * lattice.points:,}"
            if scene.material.dashpots[1]:
                text += ", same η"
            yield Change(POINTS, text, keys)
    for multiple in HARDNESS_FACTORS:
        yield Change(WALL, f"a = {multiple * a:g}/R", {"wall.a": multiple * a})


def with_result(scene: Scene, base: float, change: Change) -> Change:
    try:
        result = result_of(scene.with_(change.keys))
    except TaichiDiskError as error:
        return replace(change, remark=str(error))
    return replace(change, result=result, difference=result - base)


def result_of(scene: Scene) -> float:
    """Compute the primary result, by Newton's method if it does not depend on the
    step."""
    # The step is automatic, because a user's dt rarely suits a finer lattice.
    scenario = replace(scene, time=replace(scene.time, dt="auto")).scenario()
    if not scenario.step_dependent:
        return scenario.primary(scenario.quasistatic(loads=1).series)[1]
    outcome = compute(scenario, estimate=False)
    return scenario.primary(outcome.series)[1]


# ---- the report


def report(findings: Findings, out: Path, title: str) -> None:
    """Print the findings and write accuracy.md, error_sources.csv and, for impacts,
    accuracy.csv and accuracy.png.

    Raises SimulationError if a file cannot be written.
    """
    from rich.console import Console
    from rich.markdown import Markdown

    text = tables(findings)
    write_text(out / "accuracy.md", f"# {title}\n\n{findings.sentence}.\n\n{text}\n")
    write_csv(out / "error_sources.csv", [_source_row(one) for one in findings.sources])
    if findings.steps:
        write_csv(out / "accuracy.csv", [_step_row(step) for step in findings.steps])
        draw(findings, out / "accuracy.png", title)
    print(findings.sentence)
    Console(width=None if sys.stdout.isatty() else TABLE_WIDTH).print(Markdown(text))


def _source_row(change: Change) -> dict[str, Any]:
    columns = ("source", "change", "result", "difference", "remark")
    return {name: getattr(change, name) for name in columns}


def _step_row(step: StepError) -> dict[str, Any]:
    own = {"is_default": "own"}  # the column `own` keeps its old name
    return {own.get(name, name): value for name, value in asdict(step).items()}


def tables(findings: Findings) -> str:
    lines = []
    if findings.steps:
        lines += [
            (
                "| integrator | step/limit | steps | ms | ns/spring | error | position"
                " | energy |"
            ),
            "|---" * 8 + "|",
        ]
    for p in findings.steps:
        name = p.integrator
        if p.is_default:
            name += " (run)"
        cost = f"{1e3 * p.seconds:.1f} | {p.ns_per_spring_and_step:.1f}"
        errors = (
            f"{p.error:.1e} | {p.trajectory_error:.1e} | {p.closing_imbalance:+.1e}"
        )
        lines.append(f"| {name} | {p.fraction:.2g} | {p.steps:,} | {cost} | {errors} |")
    lines += [
        "",
        f"| source of error | change | {findings.name} | difference |",
        "|---" * 4 + "|",
    ]
    for change in findings.sources:
        difference = change.remark.replace("|", "/") or f"{change.difference:+.1e}"
        lines.append(
            f"| {change.source} | {change.change} | {change.result:.7g} |"
            f" {difference} |"
        )
    if math.isfinite(findings.scatter):
        name = f"mean and standard deviation of {len(findings.samples)}"
        lines.append(
            f"| lattice sample | {name} | {np.nanmean(findings.samples):.7g} | ±"
            f" {findings.scatter:.1e} |"
        )
    return "\n".join(lines)


def draw(findings: Findings, path: Path, title: str) -> None:
    """Draw error (y) against cost (x); a ring marks the default step of `run`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib_style({}):
        figure = Figure(figsize=(6.4, 4.4), dpi=120, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for name, colour in COLOURS.items():
            curve = [
                p
                for p in findings.steps
                if p.integrator == name and math.isfinite(p.error)
            ]
            if curve:
                axes.loglog(
                    [p.seconds for p in curve],
                    [p.error for p in curve],
                    "o-",
                    color=colour,
                    ms=4,
                    label=name,
                )
            for p in curve:
                if p.is_default:
                    axes.loglog(
                        p.seconds, p.error, "o", ms=12, mfc="none", color=colour
                    )
        axes.set_xlabel("time to solution  [s]")
        axes.set_ylabel(f"error of {findings.name}")
        axes.set_title(title, fontsize=10)
        axes.grid(True, which="both", color="0.92")
        axes.legend(
            frameon=False,
            title="ring: default step of run",
            fontsize=8,
            title_fontsize=8,
        )
        atomic_write(path, lambda new: figure.savefig(new, metadata={"Software": None}))
