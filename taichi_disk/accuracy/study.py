"""The error of the time step beside the others: how the result changes with lattice, number of points and wall."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.accuracy.steps import StepError, StepStudy
from taichi_disk.computation.outcome import compute, quasistatic
from taichi_disk.computation.stability import spectrum
from taichi_disk.config.sections import DASHPOTS, ElasticWallSection
from taichi_disk.errors import InputError, TaichiDiskError
from taichi_disk.output.files import atomic_write, prepare_output, remove_empty, write_csv, write_text
from taichi_disk.output.plot import matplotlib_style
from taichi_disk.output.run_folder import refuse_run
from taichi_disk.progress import Progress, duration, terminal
from taichi_disk.scenes import Scene
from taichi_disk.simulation.observables import BLUE, GREEN, ORANGE, PINK, RED
from taichi_disk.simulation.simulation import KernelCache

SEEDS = 8
FINER = (4, 16, 64)  # times the points; same mass, stiffness and viscosity of the whole disk
MOST_POINTS = 200_000  # of the disk, beyond which only the first of these is tried
HARDER = (3.0, 10.0)  # times the wall's a
VISCOSITY = "material.viscosity"
SAMPLE, POINTS, WALL = "lattice sample", "points", "wall hardness"
CLEAR = 2.0  # times the lattice scatter, from which a finer lattice is more than another sample
COMPILING = 5.0  # [s] of kernels, about
COLOURS = dict(zip(DASHPOTS, (BLUE, RED, GREEN, ORANGE, PINK), strict=False))  # of the integrators
WIDTH = 120  # of tables where there is no terminal


@dataclass(frozen=True)
class Change:
    """A change to the scene: the primary result with it, and how far that is from the result without.

    Attributes:
        source: of error.
        change: in words.
        keys: the same, as `DiskScene.with_` takes it.
        finer: times as many points.
        remark: why there is no result, which is then NaN.
    """

    source: str
    change: str
    keys: dict[str, Any] = field(default_factory=dict)
    finer: int = 1
    result: float = math.nan
    difference: float = math.nan
    remark: str = ""


@dataclass(frozen=True)
class Findings:
    """`name`: of the primary result; `steps`: empty for an equilibrium; `sources`: the scene itself first."""

    name: str
    steps: list[StepError]
    sources: list[Change]

    @property
    def step(self) -> float:
        """The error of the primary result at the step that `run` takes; 0 for an equilibrium."""
        return next((one.error for one in self.steps if one.own), 0.0)

    @property
    def samples(self) -> list[float]:
        """The primary result of the scene on one lattice after the other."""
        return [one.result for one in self.sources[:1] + [one for one in self.sources if one.source == SAMPLE]]

    @property
    def scatter(self) -> float:
        """Standard deviation over lattices; NaN where there is but one."""
        found = [one for one in self.samples if math.isfinite(one)]
        return float(np.std(found, ddof=1)) if len(found) > 1 else math.nan

    def last_difference(self, source: str) -> float:
        """What the last change of that kind does; NaN without one."""
        found = [one.difference for one in self.sources if one.source == source and not one.remark]
        return found[-1] if found else math.nan

    @property
    def sentence(self) -> str:
        """What matters, and so what to do."""
        finest, scatter = self.last_difference(POINTS), self.scatter
        parts = [f"time step {self.step:.1g}" if self.steps else "time step none (an equilibrium)"]
        known = (("lattice scatter", scatter), ("finest lattice", finest), ("hardest wall", self.last_difference(WALL)))
        parts += [f"{name} {value:.1g}" for name, value in known if math.isfinite(value)]
        more = ["seeds"] * (scatter > self.step) + ["points"] * (abs(finest) > max(CLEAR * scatter, self.step))
        advice = "use smaller steps (time.tolerance)" if self.steps else "nothing to gain"
        if more:
            advice = f"use more {' and '.join(more)}, not smaller steps"
            eta = next((one.keys[VISCOSITY] for one in self.sources if VISCOSITY in one.keys), None)
            if eta and self.steps and "points" in more:
                advice += f"; {VISCOSITY} = {eta:.4g} keeps the body the same"
        return f"{self.name}: {', '.join(parts)}: {advice}"


def study(scene: Scene, out: Path, title: str, note: Callable[[str], None]) -> None:
    """Measure the errors of a scene's primary result, print them, and leave tables and a picture in `out`.

    Args:
        note: gets one line after the first runs: how many there are, and about how long they will take.

    Raises InputError for a folder that holds a run or cannot be written, a step by hand beyond the stability limit, or
    friction;
    SimulationError where the scene has no result.
    """
    refuse_run(out)
    made = prepare_output(out)
    try:
        runtime.start()
        with terminal(sys.stderr) as progress:
            findings = assess(scene, progress, note)
        report(findings, out, title)
    except BaseException:
        remove_empty(made)
        raise
    print(f"files in {out}")


def assess(scene: Scene, progress: Progress, note: Callable[[str], None]) -> Findings:
    """The measurements of `study`. Taichi has to be started."""
    kernels, scenario, study = KernelCache(), scene.scenario(), None
    progress("simulate", 0, None)
    if scenario.model.has_friction:
        raise InputError(
            "wall.friction: the reference solution of `accuracy` needs smooth forces; `run` estimates the error"
        )
    if scenario.step_dependent:
        modes = spectrum(scenario.lattice, scenario.model)
        outcome = compute(scenario, scene.time, kernels=kernels, modes=modes, estimate=False)
        study = StepStudy(scenario, modes, outcome)
    others, began = list(changes(scene)), perf_counter()
    base = result_of(scene, kernels)
    each = perf_counter() - began
    growth = 1.4 if study else 1.1  # of time with the number of points: steps are shorter, too
    expected = COMPILING + each * sum(one.finer**growth for one in others)
    runs, steps = f"{len(others)} runs", []
    if study:
        runs = f"{len(others) + len(study.runs)} runs and a reference solution"
        expected += study.seconds(each)
    note(f"{runs}, about {duration(expected)}")
    if study:
        count = 1 + len(study.runs)
        progress("reference and steps", 0, count)
        steps = study.measure(kernels, lambda done: progress("reference and steps", done, count))
    sources = [Change("scene", "as it is", result=base, difference=0.0)]
    for number, change in enumerate(others):
        progress("compare", number, len(others))
        sources.append(measured(scene, base, change, kernels))
    return Findings(scene.results[0], steps, sources)


def changes(scene: Scene) -> Iterator[Change]:
    """Other lattices, finer lattices and harder walls."""
    lattice, wall = scene.lattice, scene.wall
    if lattice.file == "none":  # of points of one's own there is no other sample
        for seed in range(lattice.seed + 1, lattice.seed + SEEDS):
            yield Change(SAMPLE, f"seed {seed}", {"lattice.seed": seed})
        for factor in FINER:
            if factor > FINER[0] and factor * lattice.points > MOST_POINTS:
                break
            keys = scene.changes_with("lattice.points", factor * lattice.points)
            # A reset is a drag of 2 m/interval on each point of the boundary.
            if isinstance(wall, ElasticWallSection) and wall.boundary == "reset":
                keys["wall.reset_interval"] = wall.reset_interval / math.sqrt(factor)
            same = ", same η" * bool(scene.material.dashpots[1])
            yield Change(POINTS, f"N = {factor * lattice.points:,}{same}", keys, factor)
    for multiple in HARDER:
        yield Change(WALL, f"a = {multiple * wall.a:g}/R", {"wall.a": multiple * wall.a})


def measured(scene: Scene, base: float, change: Change, kernels: KernelCache) -> Change:
    """`change` with what it does to the result `base` of the scene."""
    try:
        result = result_of(scene.with_(change.keys), kernels)
    except TaichiDiskError as error:
        return replace(change, remark=str(error))
    return replace(change, result=result, difference=result - base)


def result_of(scene: Scene, kernels: KernelCache) -> float:
    """The primary result by the automatic step, because a step by hand seldom suits a finer lattice.

    At once by Newton's method where the result does not depend on the step. Raises TaichiDiskError.
    """
    scenario = scene.scenario()
    if not scenario.step_dependent:
        return scenario.primary(quasistatic(scenario, loads=1).columns)[1]
    outcome = compute(scenario, replace(scene.time, dt="auto"), kernels=kernels, estimate=False)
    return scenario.primary(outcome.columns)[1]


# ---- the report


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

    with matplotlib_style({}):
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
