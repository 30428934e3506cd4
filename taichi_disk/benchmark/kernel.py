"""What a step costs on one core: by what the scene models, by precision, by the number of points."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial

from taichi_disk.benchmark.engine import ours
from taichi_disk.benchmark.stopwatch import Timing, in_turn
from taichi_disk.benchmark.task import Task, impact
from taichi_disk.model.runtime import Precision

PART = "kernel"
SINGLE = "wall, dashpots (velocity_verlet)"
LARGE = 10_000  # points


def measure(repeats: int) -> list[Timing]:
    """Whole impacts, each compared with the first: the rigid wall without dashpots."""
    verlet = ("exponential_wall", "material.eta_star=10", "time.integrator=velocity_verlet")
    wall, damped = impact("exponential_wall", "material.eta_star=0"), impact(*verlet)
    cases: dict[str, tuple[Precision, Task]] = {
        "wall": ("f64", wall),
        SINGLE: ("f64", damped),
        "wall, dashpots (trapezoidal)": ("f64", impact(*verlet[:2], "time.integrator=trapezoidal")),
        "elastic wall, contact search, reset": ("f64", impact("absorbing_wall", "material.eta_star=0")),
        f"{SINGLE}, {LARGE:,} points": ("f64", impact(*verlet, f"lattice.points={LARGE}")),
        "wall, f32": ("f32", wall),
        f"{SINGLE}, f32": ("f32", damped),
    }
    with ExitStack() as stack:
        processes = {precision: stack.enter_context(ours(precision)) for precision in ("f64", "f32")}
        runs = {name: partial(processes[kind].run, processes[kind].open(task)) for name, (kind, task) in cases.items()}
        seconds = in_turn(runs, repeats)
    base = [one / wall.work for one in seconds["wall"]]
    return [
        Timing(PART, name, task.work, seconds[name], base, precision=precision, points=task.lattice.disk_points)
        for name, (precision, task) in cases.items()
    ]
