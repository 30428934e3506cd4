"""The true result of a scene, by solvers that share nothing with the stepping kernels.

An impact: SciPy's DOP853 on the laws' NumPy twins. A compression: SciPy's hybrid Powell method brings the forces on all
points to zero. Friction that holds points, and a contact that jumps from spring to spring, is no smooth force: there
the truth is that of the program itself at a 32nd of the step (`refined`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from taichi_disk.accuracy.steps import Reference
from taichi_disk.computation.outcome import compute
from taichi_disk.computation.scenario import Scenario
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model
from taichi_disk.simulation.observables import Columns
from taichi_disk.simulation.simulation import KernelCache

ROWS = 8  # as many of a truth as of a run: both truths would share the error of what is read between two rows
ROUGH = 0.3  # of the wall's decay length crossed in a step, from which the truth itself may be in doubt


def at_rest(lattice: Lattice, model: Model, start: Array) -> Array:
    """(n, 2): positions near `start` at which no point feels a force. Raises SimulationError where none are found."""
    from scipy.optimize import root

    assert model.load is not None
    load = model.load.force

    def force(y: Any) -> Any:
        f = model.forces(lattice, y.reshape(-1, 2))
        f[:, 0] -= model.springs.k_a * (y.reshape(-1, 2)[:, 0] - start[:, 0]).mean()  # a flat wall does not hold x
        return f.ravel() * lattice.disk_points / load

    found = root(force, start.ravel(), method="hybr", options={"xtol": 1e-13})
    if not np.abs(found.fun).max() < 1e-6:
        raise SimulationError(f"no rest found: {found.message}")
    return np.asarray(found.x.reshape(-1, 2))


def true_result(scenario: Scenario, columns: Columns, end: Array, dt: float, tolerance: float) -> tuple[float, float]:
    """e or xi [R] of a scenario, and how far that is in doubt itself.

    Args:
        columns, end, dt: of a run: its time series, positions (n, 2) at the end, step [R/c].
        tolerance: the error of e that is to be judged. Where contacts jump or the wall is hard the truth is computed at
            two tolerances of its own, and in doubt by what they differ by.
    """
    if not scenario.step_dependent:
        y = at_rest(scenario.lattice, scenario.model, end)[:, 1]
        return scenario.unloaded - float(y.mean() - y.min()), 0.0  # type: ignore[attr-defined]
    wall, lattice = scenario.model.wall, scenario.lattice
    a, speed = wall.a, scenario.velocity  # type: ignore[union-attr, attr-defined]
    # Far from the wall, whose potential is 1e-7 of the kinetic energy at the start: 5e-8 of e.
    far = float(np.sqrt(speed**2 + 2.0 * wall.energy(lattice, lattice.positions)))  # type: ignore[union-attr]
    # On until the wall's potential has fallen by e^3: the run ends where it is small, not where it is zero.
    t, v = float(columns["t"][-1]), float(columns["com_vy"][-1])
    stop = t + min(3.0 / (a * v), 0.3 * t)

    reference, elastic = Reference(scenario.lattice, scenario.model), scenario.model.elastic is not None

    def solved(rtol: float) -> float:
        found = reference.solve(scenario.velocities, stop, rtol)
        return float(found[1, : scenario.lattice.disk_points, 1].mean()) / far

    # The elastic wall's force jumps where a point comes to another of its springs: there the order is lost.
    rtol = max(1e-12, (1e-8 if elastic else 1e-4) * tolerance)
    tight = solved(rtol)
    return tight, abs(tight - solved(10.0 * rtol)) if elastic or a * speed * dt > ROUGH else 0.0


def refined(
    scenario: Scenario, summary: dict[str, Any], kernels: KernelCache, finest: int
) -> dict[str, tuple[float, float]]:
    """Each result with the step of `summary` over `finest`, and how far it is from that with twice this step."""
    found, rows = [], scenario.row_interval / ROWS
    for finer in (finest // 2, finest):
        step = {"dt": summary["dt"] / finer, "integrator": summary["integrator"]}
        time = replace(scenario.scene.time, **step, sample_interval=rows, tolerance="none")
        found.append(scenario.result(compute(scenario, time, estimate=False).columns))
    return {name: (value, abs(value - found[0][name])) for name, value in found[1].items() if name in found[0]}
