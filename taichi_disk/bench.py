"""How fast this machine steps and films: `taichi-disk bench`. Tests assert no times; this prints them."""

from __future__ import annotations

import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from statistics import median
from time import perf_counter

import numpy as np

from taichi_disk.lattice import disk_lattice
from taichi_disk.model import runtime
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build

REPEATS = 9
SPRING_STEPS = 3_000_000  # per measurement: long enough for the clock, short enough for nine of each


@dataclass(frozen=True)
class Timing:
    """Seconds of several measurements of the same work, `work` units each."""

    name: str
    work: float
    seconds: list[float]

    @property
    def best(self) -> float:
        return min(self.seconds) / self.work

    @property
    def typical(self) -> float:
        return median(self.seconds) / self.work


def stepping() -> Iterator[Timing]:
    """Time per spring, step and lane, f64, one core, whole kernel (springs, wall, integration, observables)."""
    runtime.start("cpu", threads=1)
    points = 1099
    disk = disk_lattice(points, 0)
    disk = replace(disk, positions=disk.positions + np.array([0.0, 0.95]))  # 0.05 R above the wall: in contact
    wall = Physics(k_b=1e-3, wall="rigid")
    damped = replace(wall, eta=10.0 / points)
    cases = (
        ("springs", Physics(), 1),
        ("springs, wall", wall, 1),
        ("springs, wall, dashpot (velocity_verlet)", damped, 1),
        ("springs, wall, dashpot (trapezoidal)", replace(damped, integrator="trapezoidal"), 1),
        ("springs, wall, 8 lanes", wall, 8),
        ("springs, wall, dashpot (velocity_verlet), 8 lanes", damped, 8),
    )
    for name, physics, lanes in cases:
        dt = 0.5 * step_limit(spectrum(disk, physics), physics, 0.0)
        world = World(disk, physics, np.tile([0.0, -0.02], (lanes, points, 1)), dt)
        yield _time(name, world)
    setup = build(load_scene("absorbing_wall"))
    world = World(setup.lattice, setup.physics, setup.velocities[None], setup.physics.reset_interval)
    yield _time("elastic wall, contact search, reset boundary", world)


def _time(name: str, world: World) -> Timing:
    springs = len(world.lattice.bonds) * world.lanes
    steps = max(1, SPRING_STEPS // springs)
    start = world.export_state()
    world.advance(1, steps)
    seconds = []
    for _ in range(REPEATS):
        world.import_state(start)
        began = perf_counter()
        world.advance(1, steps)
        seconds.append(perf_counter() - began)
    world.destroy()
    return Timing(name, springs * steps, seconds)


def film() -> Iterator[Timing]:
    """The whole of `taichi-disk run exponential_wall`, as a process of its own, with empty and with warm caches."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"TI_OFFLINE_CACHE_FILE_PATH": str(Path(folder) / "cache")}
        command = [sys.executable, "-m", "taichi_disk", "run", "exponential_wall", "--out", str(Path(folder) / "out")]
        for name, repeats in (("run exponential_wall to its film, empty cache", 1), ("the same, warm cache", 3)):
            seconds = []
            for _ in range(repeats):
                began = perf_counter()
                subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
                seconds.append(perf_counter() - began)
            yield Timing(name, 1.0, seconds)


def print_benchmark() -> None:
    """Print all timings, best and median of the repeats."""
    print(f"{platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}")
    print(f"{'ns per spring, step and lane, one core, f64':<54}{'best':>8}{'median':>8}")
    for timing in stepping():
        print(f"  {timing.name:<52}{1e9 * timing.best:8.2f}{1e9 * timing.typical:8.2f}", flush=True)
    print(f"{'seconds':<54}{'best':>8}{'median':>8}")
    for timing in film():
        print(f"  {timing.name:<52}{timing.best:8.1f}{timing.typical:8.1f}", flush=True)
