"""What a step costs by itself, by Numba, in a run, and by the number of points."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from importlib.util import find_spec
from math import ceil
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from taichi_disk import runtime
from taichi_disk.integrators import INTEGRATORS, TRAPEZOIDAL, VELOCITY_VERLET, Integrator
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.driver import Driver
from taichi_disk.simulation.outcome import compute
from taichi_disk.simulation.scenario import Scenario
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.simulation.stability import spectrum

from .timing import in_turn, table

RIGID, VERLET = "exponential_wall", "time.integrator=velocity_verlet"
FREE, STRONG = "material.eta_star=0", "material.eta_star=100"
NS = "ns per spring and step"
POINTS = (1_000, 10_000, 100_000, 1_000_000)
WORK = 6_000_000  # springs times steps of a run by size: some 20 ms on one core


@dataclass(frozen=True)
class Task:
    """`steps` steps of `dt` [R/c] from the start of a scenario."""

    scenario: Scenario
    integrator: Integrator
    dt: float
    steps: int

    def run(self, kernels: KernelCache) -> tuple[float, NDArray[np.float64]]:
        """All steps in one launch: its seconds, and the velocities (n, 2) at the end [c]."""
        scenario = self.scenario
        simulation = kernels.simulation(scenario.lattice, scenario.model, self.integrator, scenario.velocities, self.dt)
        began = perf_counter()
        simulation.advance(self.steps, self.steps)
        return perf_counter() - began, simulation.velocities()

    def cost(self, run: Callable[[], tuple[float, NDArray[np.float64]]]) -> float:
        """Of a run of all steps, in nanoseconds per spring and step."""
        return 1e9 * run()[0] / (len(self.scenario.lattice.bonds) * self.steps)

    def timed(self, kernels: KernelCache) -> Callable[[], float]:
        return partial(self.cost, partial(self.run, kernels))


def impact(kernels: KernelCache, scene: str, *settings: str) -> Task:
    """A whole impact at the step that a run takes."""
    loaded = load_scene(scene, settings)
    scenario = loaded.scenario()
    facts = compute(scenario, loaded.time, kernels=kernels, estimate=False).facts
    return Task(scenario, INTEGRATORS[facts["integrator"]], facts["dt"], facts["steps"])


def kernel(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Whole impacts in one launch each, by what the scene models."""
    kernels = KernelCache()
    scenes = {
        "wall": (RIGID, FREE),
        "wall, vefrl (per step of four forces)": (RIGID, FREE, "time.integrator=vefrl"),
        "wall, dashpots (velocity_verlet)": (RIGID, VERLET),
        "wall, dashpots (trapezoidal)": (RIGID, STRONG, "time.integrator=trapezoidal"),
        "elastic wall, contact search, reset": ("absorbing_wall",),
        "wall, dashpots (velocity_verlet), 10,000 points": (RIGID, "lattice.points=10000", VERLET),
    }
    runs = {name: impact(kernels, *scene, *settings).timed(kernels) for name, scene in scenes.items()}
    yield from table("one core, whole impacts", in_turn(runs, repeats), NS)


def numba(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """The same impacts by Numba, springs in either of two orders."""
    if find_spec("numba") is None:
        yield "numba: not installed: pip install '.[peers]'"
        return
    from .numba_loops import leapfrog, orders

    kernels = KernelCache()
    for case, eta_star in (("wall", FREE), ("wall, dashpots", "material.eta_star=10")):
        task = impact(kernels, RIGID, VERLET, eta_star, *settings)
        runs, remarks = {"taichi_disk": task.timed(kernels)}, {}
        expected = task.run(kernels)[1]
        for order, springs in orders(task.scenario.lattice).items():
            name, by_numba = f"Numba, fastmath, springs {order}", partial(leapfrog, task, springs)
            remarks[name] = f"velocities at the end differ by {np.abs(by_numba()[1] - expected).max():.0e} c"
            runs[name] = partial(task.cost, by_numba)
        yield from table(f"{case}, one core", in_turn(runs, repeats), NS, remarks)


def run(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """The simulation of `run`, everything but start-up and compiling, beside the bare steps in one launch."""
    kernels = KernelCache()
    for scene, *own in ((RIGID, FREE), (RIGID,), (RIGID, STRONG), ("absorbing_wall",)):
        given = (*own, *settings)
        task, time, made = impact(kernels, scene, *given), load_scene(scene, given).time, []
        modes = spectrum(task.scenario.lattice, task.scenario.model)

        def bare(task: Task = task) -> float:
            return task.run(kernels)[0]

        def drive(task: Task = task, time: object = time, modes: object = modes, made: list[int] = made) -> float:
            began = perf_counter()
            driver = Driver(task.scenario, time, kernels, modes)
            while driver.advance() in ("running", "restarted"):
                pass
            made.append(driver.steps_made)
            return perf_counter() - began

        whole = "driver: from the scenario to its end"
        seconds = in_turn({"bare steps": bare, whole: drive}, repeats)
        remarks = {whole: f"{made[-1]:,} steps made, {task.steps:,} reported"}
        yield from table(" ".join((scene, *given)), seconds, "s", remarks)


def size(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Some steps above the rigid wall, with explicit dashpots and with implicit ones, on one core and on all."""
    for points in POINTS:
        costs = {}
        for threads in sorted({1, os.cpu_count() or 1}):
            runtime.start(threads=threads, afresh=True)
            kernels = KernelCache()
            cores = "one core" if threads == 1 else "all cores"
            tasks = {"explicit": above_wall(points, settings, VELOCITY_VERLET, 1.0)}
            # At the step that a run would take: how much there is to solve depends on it.
            tasks["trapezoidal, eta* = 100"] = above_wall(points, (*settings, STRONG), TRAPEZOIDAL, 5.0)
            costs |= in_turn({f"{how}, {cores}": task.timed(kernels) for how, task in tasks.items()}, repeats)
        yield from table(f"{points:,} points", costs, NS)


def above_wall(points: int, settings: tuple[str, ...], integrator: Integrator, longer: float) -> Task:
    """A disk whose lowest point is 0.05 R above the wall; the step is `longer` than an eighth of the springs' limit."""
    scenario = load_scene(RIGID, (*settings, f"lattice.points={points}")).scenario()
    lattice = scenario.lattice
    lowered = lattice.positions - [0.0, lattice.positions[:, 1].min() - 0.05]
    scenario.lattice = replace(lattice, positions=lowered)
    return Task(scenario, integrator, longer * 0.1 / np.sqrt(points), max(8, ceil(WORK / len(lattice.bonds))))
