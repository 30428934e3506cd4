"""What a step costs in the engine of this environment: processor time of one core."""

from __future__ import annotations

from time import thread_time

from taichi_disk.base.engine import ti
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.mechanics.integrators import INTEGRATORS
from taichi_disk.mechanics.simulation.simulation import KernelCache

SCENES = {
    "wall": "exponential_wall material.eta_star=0",
    "wall, dashpots": "exponential_wall time.integrator=velocity_verlet",
    "wall, implicit dashpots": (
        "exponential_wall material.eta_star=100 time.integrator=trapezoidal"
    ),
    "elastic wall with resets": "absorbing_wall",
    "wall, 10,000 points": "exponential_wall lattice.points=10000",
}


def kernel(repeats, settings):
    """Measure whole impacts in one launch each; yield lines of a table."""
    kernels = KernelCache()
    engine = f"{ti.__name__} {'.'.join(map(str, ti.__version__))}"
    yield f"{engine:<40} ns per spring and step, e"
    for name, line in SCENES.items():
        scene, *own = line.split()
        scenario = load_scene(scene, [*own, *settings]).scenario()
        summary = compute(scenario, estimate=False).summary
        simulation = kernels.simulation(
            scenario.lattice,
            scenario.model,
            INTEGRATORS[summary["integrator"]],
            scenario.velocities,
            summary["dt"],
        )
        steps = summary["steps"]
        costs = []
        for _ in range(repeats):
            began = thread_time()
            simulation.advance(steps, steps)
            costs.append(thread_time() - began)
        cost = 1e9 * min(costs) / (steps * len(scenario.lattice.bonds))
        yield f"{name:<40} {cost:22.2f}, {summary['restitution']:.12g}"
