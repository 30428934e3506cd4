"""Measure the cost of a step by itself, in Numba, and in a run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from taichi_disk.computation.driver import Driver
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.stability import spectrum
from taichi_disk.computation.step_control import StepControl
from taichi_disk.integrators import INTEGRATORS
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache

from .timing import in_turn, table

RIGID, VERLET = "exponential_wall", "time.integrator=velocity_verlet"
FREE, STRONG = "material.eta_star=0", "material.eta_star=100"
NS = "ns per spring and step"


class Impact:
    """A whole impact at the step of a run.

    Attributes:
        dt, steps: time step of the run [R/c], and number of steps.
        attempts: number of runs until the step was accepted.
        velocities: (n, 2) at the end [c].
        work: springs times steps, in 10^9.
    """

    def __init__(self, kernels: KernelCache, scene: str | Path, *settings: str) -> None:
        loaded = load_scene(scene, settings)
        self.kernels, self.scenario = kernels, loaded.scenario()
        outcome = compute(self.scenario, estimate=False)
        summary, self.velocities = outcome.summary, outcome.velocities
        self.integrator = INTEGRATORS[summary["integrator"]]
        self.dt, self.steps, self.attempts = (
            summary["dt"],
            summary["steps"],
            summary["attempts"],
        )
        self.work = 1e-9 * len(self.scenario.lattice.bonds) * self.steps
        self.spectrum = spectrum(self.scenario.lattice, self.scenario.model)

    def cost(self, run: Callable[[], Any]) -> float:
        """Return the cost of a run of all steps [ns per spring and step]."""
        began = perf_counter()
        run()
        return (perf_counter() - began) / self.work

    def bare(self) -> float:
        """Return the cost of the steps in one launch."""
        lattice, model, velocities = (
            self.scenario.lattice,
            self.scenario.model,
            self.scenario.velocities,
        )
        simulation = self.kernels.simulation(
            lattice, model, self.integrator, velocities, self.dt
        )
        return self.cost(partial(simulation.advance, self.steps, self.steps))

    def driven(self) -> float:
        """Return the cost of the steps with everything that a run does around them,
        except start-up and compiling."""

        def drive() -> None:
            control = StepControl(self.scenario, self.spectrum)
            has_finished = False
            while not has_finished:
                driver = Driver(self.scenario, control.step, self.kernels)
                driver.advance()
                has_finished = not control.shortens(driver)

        return self.cost(drive)


def kernel(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Measure whole impacts in one launch each, for several models."""
    kernels = KernelCache()
    scenes = {
        "wall": (RIGID, FREE),
        "wall, vefrl (per step of four forces)": (RIGID, FREE, "time.integrator=vefrl"),
        "wall, dashpots (velocity_verlet)": (RIGID, VERLET),
        "wall, dashpots (trapezoidal)": (RIGID, STRONG, "time.integrator=trapezoidal"),
        "elastic wall, contact search, reset": ("absorbing_wall",),
        "wall, dashpots (velocity_verlet), 10,000 points": (
            RIGID,
            "lattice.points=10000",
            VERLET,
        ),
    }
    runs = {
        name: Impact(kernels, *scene, *settings).bare for name, scene in scenes.items()
    }
    yield from table("one core, whole impacts", in_turn(runs, repeats), NS)


def numba(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Measure the same impacts in Numba."""
    if find_spec("numba") is None:
        yield "numba: not installed: pip install '.[peers]'"
        return
    from .numba_loops import leapfrog

    kernels = KernelCache()
    for case, eta_star in (("wall", FREE), ("wall, dashpots", "material.eta_star=10")):
        impact = Impact(kernels, RIGID, VERLET, eta_star, *settings)
        by_numba = partial(leapfrog, impact)
        off = np.abs(by_numba()[1] - impact.velocities).max()
        runs = {
            "taichi_disk": impact.bare,
            "Numba, fastmath": partial(impact.cost, by_numba),
        }
        remarks = {"Numba, fastmath": f"velocities at the end differ by {off:.0e} c"}
        yield from table(f"{case}, one core", in_turn(runs, repeats), NS, remarks)


def run(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """The simulation of `run` beside the bare steps in one launch."""
    kernels, whole = KernelCache(), "driver: from the scenario to its end"
    for scene in ((RIGID, FREE), (RIGID,), (RIGID, STRONG), ("absorbing_wall",)):
        impact = Impact(kernels, *scene, *settings)
        costs = in_turn({"bare steps": impact.bare, whole: impact.driven}, repeats)
        remarks = {whole: f"attempts: {impact.attempts}, of which the last is reported"}
        yield from table(" ".join((*scene, *settings)), costs, NS, remarks)
