"""Speed against error: every integrator at several steps, against the independent reference."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from taichi_disk.benchmark.stopwatch import seconds_to_advance
from taichi_disk.dynamics import move
from taichi_disk.errors import InputError
from taichi_disk.model import runtime
from taichi_disk.model.physics import Integrator
from taichi_disk.model.runtime import Precision
from taichi_disk.model.stability import spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.progress import Progress
from taichi_disk.scene import CompressionScene, Scene
from taichi_disk.scenes import build
from taichi_disk.scenes.setup import Setup
from taichi_disk.simulate import as_columns, imbalance, make_world
from taichi_disk.study.reference import Reference, cached_solution
from taichi_disk.time_step import TimeStep

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
    columns = move(setup, time, modes, progress, force=True).columns
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
