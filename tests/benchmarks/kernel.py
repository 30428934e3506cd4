"""Measure the cost of a step by itself and in a run."""

from __future__ import annotations

from functools import partial
from time import perf_counter

from taichi_disk.computation.driver import Driver
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.stability import spectrum
from taichi_disk.computation.step_control import StepControl
from taichi_disk.integrators import INTEGRATORS
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache

from .timing import in_turn, table

RIGID = "exponential_wall"
VERLET = "time.integrator=velocity_verlet"
FREE = "material.eta_star=0"
STRONG = "material.eta_star=100"
NS = "ns per spring and step"


class Impact:
    """A whole impact at the step of a run.

    Attributes:
        dt, steps: time step of the run [R/c], and number of steps.
        attempts: number of runs until the step was accepted.
        work: springs times steps, in 10^9.
    """

    def __init__(self, kernels, scene, *settings):
        self.kernels = kernels
        self.scenario = load_scene(scene, settings).scenario()
        summary = compute(self.scenario, estimate=False).summary
        self.integrator = INTEGRATORS[summary["integrator"]]
        self.dt = summary["dt"]
        self.steps = summary["steps"]
        self.attempts = summary["attempts"]
        self.work = 1e-9 * len(self.scenario.lattice.bonds) * self.steps
        self.spectrum = spectrum(self.scenario.lattice, self.scenario.model)

    def cost(self, run):
        """Return the cost of a run of all steps [ns per spring and step]."""
        began = perf_counter()
        run()
        return (perf_counter() - began) / self.work

    def bare(self):
        """Return the cost of the steps in one launch."""
        scenario = self.scenario
        simulation = self.kernels.simulation(
            scenario.lattice,
            scenario.model,
            self.integrator,
            scenario.velocities,
            self.dt,
        )
        return self.cost(partial(simulation.advance, self.steps, self.steps))

    def driven(self):
        """Return the cost of the steps with everything that a run does around them,
        except start-up and compiling."""

        def drive():
            control = StepControl(self.scenario, self.spectrum)
            has_finished = False
            while not has_finished:
                driver = Driver(self.scenario, control.step, self.kernels)
                driver.advance()
                has_finished = not control.shortens(driver)

        return self.cost(drive)


def kernel(repeats, settings):
    """Measure whole impacts in one launch each, for several models."""
    kernels = KernelCache()
    scenes = {
        "wall": (RIGID, FREE),
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


def run(repeats, settings):
    """The simulation of `run` beside the bare steps in one launch."""
    kernels = KernelCache()
    whole = "driver: from the scenario to its end"
    scenes = ((RIGID, FREE), (RIGID,), (RIGID, STRONG), ("absorbing_wall",))
    for scene in scenes:
        impact = Impact(kernels, *scene, *settings)
        costs = in_turn({"bare steps": impact.bare, whole: impact.driven}, repeats)
        remarks = {whole: f"attempts: {impact.attempts}, of which the last is reported"}
        yield from table(" ".join((*scene, *settings)), costs, NS, remarks)
