"""Speed against error: every integrator at several steps, against the independent reference."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path

import numpy as np

from taichi_disk.benchmark.stopwatch import seconds_to_advance
from taichi_disk.dynamics import move
from taichi_disk.errors import InputError
from taichi_disk.model import runtime
from taichi_disk.model.physics import Integrator
from taichi_disk.model.runtime import Precision
from taichi_disk.model.stability import spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.output import atomic_write, prepare_output
from taichi_disk.progress import Progress
from taichi_disk.results import write_text
from taichi_disk.scene import CompressionScene, Scene
from taichi_disk.scenes import build
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import as_columns, imbalance, make_world
from taichi_disk.study.reference import Reference, cached_solution
from taichi_disk.time_step import TimeStep, choose

PRECISIONS: tuple[Precision, ...] = ("f64", "f32")
FRACTIONS = (0.95, 0.8, 0.6, 0.4, 0.2, 0.1, 0.05)  # of the stability limit
REPEATS = 5
ROWS = 200  # at which the energy is looked at


@dataclass(frozen=True)
class Point:
    """One integrator at one step. Errors are absolute: e is of the order 1, positions are in R."""

    integrator: Integrator
    precision: Precision
    fraction: float  # of the stability limit
    dt: float  # [R/c]
    steps: int
    seconds: float  # to the end, compilation apart, the best of REPEATS
    ns_per_spring_and_step: float
    error: float  # of e; of the compression at the end
    trajectory_error: float  # largest of any coordinate at the end [R]
    closing_imbalance: float  # of the energy, relative to the scene's scale
    worst_imbalance: float


def measure(scene: Scene, progress: Progress) -> list[Point]:
    """Run `scene` to the time at which it ends (a compression: to 20 R/c) with every integrator, precision and step.

    The reference, SciPy's DOP853 at rtol 1e-11 on a NumPy force, takes from seconds to minutes once and is kept.
    Raises InputError for a compression by Newton's method, which has no time step.
    """
    if isinstance(scene, CompressionScene) and scene.compression.method == "newton":
        raise InputError("compression.method: newton takes no time steps; its error is its tolerance")
    runtime.start("cpu", threads=1)
    setup = build(scene)
    end = _end(setup, progress)
    progress.start("reference", None)
    truth = cached_solution(Reference(setup.lattice, setup.physics), setup.velocities, end)
    integrators: list[Integrator] = ["velocity_verlet"]
    if setup.physics.dissipates:
        integrators.append("trapezoidal")
    if not setup.physics.damped:
        integrators.append("vefrl")
    progress.start("measure", len(PRECISIONS) * len(integrators) * len(FRACTIONS))
    points = []
    for precision in PRECISIONS:
        runtime.start("cpu", 1, precision)
        for integrator in integrators:
            world: World | None = None
            for fraction in FRACTIONS:
                point, world = _measure(setup, integrator, precision, fraction, end, truth, world)
                points.append(point)
                progress.update(len(points))
    return points


def _end(setup: Setup, progress: Progress) -> float:
    if isinstance(setup.scene, CompressionScene):
        return 20.0 / float(np.sqrt(setup.physics.k_a))
    modes, time = spectrum(setup.lattice, setup.physics), setup.scene.time
    columns = move(setup, time, modes, choose(time, setup.physics, modes, setup.point_force, True), progress).columns
    return float(columns["t"][-1])


def _measure(
    setup: Setup,
    integrator: Integrator,
    precision: Precision,
    fraction: float,
    end: float,
    truth: np.ndarray,
    earlier: World | None,
) -> tuple[Point, World]:
    physics = replace(setup.physics, integrator=integrator)
    limit = step_limit(spectrum(setup.lattice, physics), physics, setup.point_force)
    if physics.reset_interval:
        steps = round(end / physics.reset_interval) * int(np.ceil(physics.reset_interval / (fraction * limit)))
        stride = 1
    else:
        stride = max(1, int(end / (fraction * limit) / ROWS))
        steps = stride * int(np.ceil(end / (fraction * limit) / stride))
    world = make_world(setup, TimeStep(integrator, limit, end / steps), earlier)
    start = world.export_state()
    rows = world.advance(steps // stride, stride)
    positions, velocities = world.positions()[0], world.velocities()[0]
    seconds = [seconds_to_advance(world, start, steps) for _ in range(REPEATS)]
    columns = as_columns(np.concatenate([world.first_row[None], rows])[:, :, 0], world.dt, stride)
    lost = imbalance(columns) / setup.energy_scale(columns)
    disk = setup.lattice.disk_points
    if isinstance(setup.scene, CompressionScene):
        error = _compression(positions) - _compression(truth[0])
    else:
        error = float(velocities[:disk, 1].mean() - truth[1][:disk, 1].mean()) / setup.scene.impact.velocity
    point = Point(
        integrator=integrator,
        precision=precision,
        fraction=fraction,
        dt=world.dt,
        steps=steps,
        seconds=min(seconds),
        ns_per_spring_and_step=1e9 * min(seconds) / steps / len(setup.lattice.bonds),
        error=abs(error),
        trajectory_error=float(np.abs(positions - truth[0]).max()),
        closing_imbalance=float(lost[-1]),
        worst_imbalance=float(np.abs(lost).max()),
    )
    return point, world


def _compression(positions: np.ndarray) -> float:
    return float(positions[:, 1].mean() - positions[:, 1].min())


def write(points: list[Point], out: Path, title: str) -> None:
    """accuracy.csv, accuracy.md and the work-precision diagram accuracy.png."""
    prepare_output(out)

    def table(beside: Path) -> None:
        with beside.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, [field.name for field in fields(Point)], lineterminator="\n")
            writer.writeheader()
            writer.writerows(asdict(point) for point in points)

    atomic_write(out / "accuracy.csv", table)
    text = "\n".join(markdown(points)) + "\n"
    write_text(out / "accuracy.md", text)
    draw(points, out / "accuracy.png", title)


def markdown(points: list[Point]) -> Iterator[str]:
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


def draw(points: list[Point], path: Path, title: str) -> None:
    """Error on x, time on y; a vertical mark where the step is 0.8 of the limit, what `dt: auto` takes."""
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
                if p.fraction == 0.8:
                    axes.loglog(p.error, p.seconds, "o", ms=12, mfc="none", color=colour)
    axes.set_xlabel("error of the headline")
    axes.set_ylabel("time to solution, one core  [s]")
    axes.set_title(title, fontsize=10)
    axes.grid(True, which="both", color="0.92")
    axes.legend(frameon=False, title="ring: the automatic step (0.8 of the limit)")
    atomic_write(path, lambda beside: figure.savefig(beside, metadata={"Software": None}))
