"""The true result of a scene, by solvers that share nothing with the stepping kernels.

For an impact: SciPy's DOP853 with the laws in NumPy. For a compression: SciPy's hybrid
Powell method finds the point where all forces vanish. Friction that holds points, and a
contact that jumps from spring to spring, are not smooth forces; then the true result is
the program's own at a 32nd of the step (`refined`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from taichi_disk.accuracy.steps import reference_state
from taichi_disk.computation.error_estimate import measured
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.scenario import Scenario
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model
from taichi_disk.simulation.observables import Columns
from taichi_disk.simulation.simulation import KernelCache

# rows of a true result over rows of a run, to reduce the error of values between two
# rows
ROWS = 8
ROUGH = 0.3  # decay lengths per step from which the true result itself may be uncertain


def at_rest(lattice: Lattice, model: Model, start: Array) -> Array:
    """Return positions (n, 2) near `start` at which all forces vanish. Raises
    SimulationError if there are none."""
    from scipy.optimize import root

    assert model.load is not None
    load = model.load.force

    def force(y: Any) -> Any:
        f = model.forces(lattice, y.reshape(-1, 2))
        # a flat wall does not hold x
        f[:, 0] -= model.springs.k_a * (y.reshape(-1, 2)[:, 0] - start[:, 0]).mean()
        return f.ravel() * lattice.disk_points / load

    found = root(force, start.ravel(), method="hybr", options={"xtol": 1e-13})
    if not np.abs(found.fun).max() < 1e-6:
        raise SimulationError(f"no rest found: {found.message}")
    return np.asarray(found.x.reshape(-1, 2))


def true_result(
    scenario: Scenario, columns: Columns, end: Array, dt: float, tolerance: float
) -> tuple[float, float]:
    """Return e or xi [R] of a scenario, and its uncertainty.

    Args:
        columns, end, dt: time series of a run, its positions (n, 2) at the end, and its
            step [R/c].
        tolerance: the error of e that is to be judged. If contacts jump or the wall is
            hard, the true result is computed at two tolerances, whose difference is its
            uncertainty.
    """
    if not scenario.step_dependent:
        y = at_rest(scenario.lattice, scenario.model, end)[:, 1]
        return scenario.unloaded - float(y.mean() - y.min()), 0.0  # type: ignore[attr-defined]
    wall = scenario.model.wall
    lattice = scenario.lattice
    a, speed = wall.a, scenario.velocity  # type: ignore[union-attr, attr-defined]
    # Speed far from the wall; its potential at the start is 1e-7 of the kinetic energy,
    # or 5e-8 of e.
    far = float(np.sqrt(speed**2 + 2.0 * wall.energy(lattice, lattice.positions)))  # type: ignore[union-attr]
    # Go on until the wall's potential has fallen by e^3: at the end of the run it is
    # small, but not zero.
    t = float(columns["t"][-1])
    v = float(columns["com_vy"][-1])
    stop = t + min(3.0 / (a * v), 0.3 * t)

    elastic = scenario.model.elastic is not None

    def solved(rtol: float) -> float:
        found = reference_state(
            lattice, scenario.model, scenario.velocities, stop, rtol
        )
        return float(found[1, : scenario.lattice.disk_points, 1].mean()) / far

    # The elastic wall's force jumps when a point passes to another spring, so errors
    # follow no order.
    rtol = max(1e-12, (1e-8 if elastic else 1e-4) * tolerance)
    tight = solved(rtol)
    return tight, (
        abs(tight - solved(10.0 * rtol)) if elastic or a * speed * dt > ROUGH else 0.0
    )


def refined(
    scenario: Scenario, summary: dict[str, Any], kernels: KernelCache, finest: int
) -> dict[str, tuple[float, float]]:
    """Return each result at 1/`finest` of the step of `summary`, and its difference
    from that at twice the step."""
    found = []
    rows = scenario.row_interval / ROWS
    for finer in (finest // 2, finest):
        step = {"dt": summary["dt"] / finer, "integrator": summary["integrator"]}
        time = replace(
            scenario.scene.time, **step, sample_interval=rows, tolerance="none"
        )
        finer_scenario = replace(scenario, scene=replace(scenario.scene, time=time))
        columns = compute(finer_scenario, estimate=False).series
        found.append(measured(scenario, columns))
    return {
        name: (value, abs(value - found[0][name]))
        for name, value in found[1].items()
        if name in found[0]
    }
