"""Compare the time step's error with the effects of lattice, number of points and wall
on the result."""

from __future__ import annotations

import sys
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path

from taichi_disk.base import runtime
from taichi_disk.base.errors import NOTICES, InputError, TaichiDiskError
from taichi_disk.base.files import (
    Summary,
    atomic_write,
    prepare_output,
    remove_empty,
    write_csv,
    write_text,
)
from taichi_disk.base.progress import Progress, terminal
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.computation.words import Numbers
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.setup import outcome_of
from taichi_disk.mechanics.integrators import INTEGRATORS
from taichi_disk.mechanics.lattice import file_digest
from taichi_disk.pictures.curves import OKABE_ITO
from taichi_disk.pictures.plot import matplotlib_style
from taichi_disk.runs.api.lattices import compare_lattices
from taichi_disk.runs.output.run_folder import refuse_run
from taichi_disk.studies.accuracy.steps import StepError, StepStudy

SEEDS = 8
FINER_LATTICE = 4  # factor of the number of points
HARDER_WALL = 10.0  # factor of wall.a
SCATTER = "lattice scatter"
FINER = f"{FINER_LATTICE} times the points"
HARDER = f"wall {HARDER_WALL:g} times as hard"
# in lattice scatters: a larger difference is an effect of the number of points
SIGNIFICANCE = 2.0
# colours of the integrators
COLOURS = dict(zip(INTEGRATORS, OKABE_ITO, strict=False))
TABLE_WIDTH = 120  # width of a printed table without a terminal


def study(scene: Scene, out: Path, title: str) -> None:
    """Measure the errors of a scene's primary result, print what limits it, and write a
    table and a picture to `out`.

    Raises InputError if `out` holds a run or cannot be written, if the scene's dt
    exceeds the stability limit, or for a wall with friction; SimulationError if the
    scene has no result.
    """
    refuse_run(out)
    made = prepare_output(out)
    try:
        runtime.start()
        with terminal(sys.stderr) as progress:
            steps = step_errors(scene, progress)
            changes = effects(scene, progress)
        name = scene.results[0]
        report(name, steps, sentence(name, steps, changes), out, title)
    except BaseException:
        remove_empty(made)
        raise
    print(f"files in {out}")


def step_errors(scene: Scene, progress: Progress) -> list[StepError]:
    """Return the errors of several steps of each integrator; none for an
    equilibrium."""
    scenario = scene.scenario()
    progress("simulate", 0, None)
    if scenario.model.has_friction:
        raise InputError(
            "wall.friction: must be 0, because the reference solution needs smooth"
            " forces; `run` also estimates errors"
        )
    if not scenario.step_dependent:
        return []
    outcome = compute(scenario, estimate=False)
    return StepStudy(scenario, outcome).measure(progress)


def effects(scene: Scene, progress: Progress) -> Numbers:
    """Return the scatter of the primary result over lattices, and its changes on a
    finer lattice and on a harder wall; without those that have no result."""
    # The step is automatic, because a user's dt rarely suits a finer lattice, and an
    # equilibrium is solved for.
    scene = scene.with_({"time.dt": "auto"})
    if scene.homes("method"):
        scene = scene.with_(method="newton")
    outcome = outcome_of(scene, estimate=False)
    name, value = outcome.scenario.primary(outcome.series)
    found = {}
    changes = {}
    if scene.lattice.file == "none":  # there is no other sample of a user's points
        outline = file_digest(scene.lattice, "outline")
        compared = compare_lattices(
            outcome, SEEDS, progress, force=False, outline=outline
        )
        if name in compared:
            found[SCATTER] = compared[name]["standard_deviation"]
        changes[FINER] = finer_lattice(scene)
    changes[HARDER] = {"wall.a": HARDER_WALL * scene.wall.a}
    for number, (effect, keys) in enumerate(changes.items()):
        progress("compare", number, len(changes))
        with suppress(TaichiDiskError):
            changed = outcome_of(scene.with_(keys), estimate=False)
            found[effect] = changed.scenario.primary(changed.series)[1] - value
    for text in outcome.summary["warnings"]:
        NOTICES.warning(text)
    return found


def finer_lattice(scene: Scene) -> Summary:
    """Return the keys for more points, and equal mass, stiffness and viscosity of the
    disk."""
    points = FINER_LATTICE * scene.lattice.points
    keys = scene.changes_with("lattice.points", points)
    # A reset acts on each boundary point like a drag of 2 m/interval.
    if scene.reset_interval:
        keys["wall.reset_interval"] = scene.reset_interval / FINER_LATTICE**0.5
    return keys


# ---- the report


def sentence(name: str, steps: list[StepError], changes: Numbers) -> str:
    """Return what limits the result `name`, and advice. `changes`: as `effects` returns
    them."""
    step = 0.0
    parts = ["no time step (an equilibrium)"]
    advice = "nothing to gain"
    if steps:
        step = next(one.error for one in steps if one.is_default)
        parts = [f"time step {step:.1g}"]
        advice = "use smaller steps (time.tolerance)"
    for effect, change in changes.items():
        parts.append(f"{effect} {change:.1g}")
    scatter = changes.get(SCATTER, 0.0)
    more = []
    if scatter > step:
        more.append("seeds")
    if abs(changes.get(FINER, 0.0)) > max(SIGNIFICANCE * scatter, step):
        more.append("points")
    if more:
        advice = f"use more {' and '.join(more)}, not smaller steps"
    return f"{name}: {', '.join(parts)}: {advice}"


def report(
    name: str, steps: list[StepError], answer: str, out: Path, title: str
) -> None:
    """Print the answer and the errors of steps in the result `name`, and write
    accuracy.md and, for impacts, accuracy.csv and accuracy.png.

    Raises SimulationError if a file cannot be written.
    """
    from rich.console import Console
    from rich.markdown import Markdown

    text = table(steps)
    write_text(out / "accuracy.md", f"# {title}\n\n{answer}.\n\n{text}\n")
    print(answer)
    if steps:
        write_csv(out / "accuracy.csv", [_step_row(step) for step in steps])
        draw(name, steps, out / "accuracy.png", title)
        width = None
        if not sys.stdout.isatty():
            width = TABLE_WIDTH
        Console(width=width).print(Markdown(text))


def _step_row(step: StepError) -> Summary:
    own = {"is_default": "own"}  # the column `own` keeps its old name
    return {own.get(name, name): value for name, value in asdict(step).items()}


def table(steps: list[StepError]) -> str:
    """Return the table of steps; empty for an equilibrium."""
    if not steps:
        return ""
    lines = [
        "| integrator | step/limit | steps | ms | ns/spring | error | position"
        " | energy |",
        "|---" * 8 + "|",
    ]
    for p in steps:
        name = p.integrator
        if p.is_default:
            name += " (run)"
        cost = f"{1e3 * p.seconds:.1f} | {p.ns_per_spring_and_step:.1f}"
        errors = (
            f"{p.error:.1e} | {p.trajectory_error:.1e} | {p.closing_imbalance:+.1e}"
        )
        lines.append(f"| {name} | {p.fraction:.2g} | {p.steps:,} | {cost} | {errors} |")
    return "\n".join(lines)


def draw(name: str, steps: list[StepError], path: Path, title: str) -> None:
    """Draw error (y) against cost (x); a ring marks the default step of `run`."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    with matplotlib_style({"legend.frameon": False, "legend.fontsize": 8}):
        figure = Figure(figsize=(6.4, 4.4), dpi=120, layout="constrained")
        FigureCanvasAgg(figure)
        axes = figure.subplots()
        for integrator, colour in COLOURS.items():
            curve = [p for p in steps if p.integrator == integrator]
            seconds = [p.seconds for p in curve]
            errors = [p.error for p in curve]
            axes.loglog(seconds, errors, "o-", color=colour, ms=4, label=integrator)
        run = next(p for p in steps if p.is_default)
        ring = {"ms": 12, "mfc": "none", "color": COLOURS[run.integrator]}
        axes.loglog(run.seconds, run.error, "o", **ring)
        axes.set_xlabel("time to solution  [s]")
        axes.set_ylabel(f"error of {name}")
        axes.set_title(title, fontsize=10)
        axes.grid(True, which="both", color="0.92")
        axes.legend(title="ring: default step of run", title_fontsize=8)
        atomic_write(path, lambda new: figure.savefig(new, metadata={"Software": None}))
