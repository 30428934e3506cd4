"""The true result of a scene, by solvers that share nothing with the kernels.

For an impact DOP853, for a compression Powell's hybrid method. If friction holds points
or a contact jumps from spring to spring, forces are not smooth: then it is the
program's own result at a 32nd of the step (`refined`).
"""

from dataclasses import replace

import numpy as np

from taichi_disk.base.errors import SimulationError
from taichi_disk.experiments.computation.error_estimate import measured
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.studies.accuracy.steps import reference_state

# rows of a true result over rows of a run, against errors between two rows
ROWS = 8
ROUGH = 0.3  # decay lengths per step from which the true result itself may be uncertain


def at_rest(lattice, model, start):
    """Return positions (n, 2) near `start` at which all forces vanish."""
    from scipy.optimize import root

    def force(y):
        x = y.reshape(-1, 2)
        f = model.forces(lattice, x)
        # a flat wall does not hold x
        f[:, 0] -= model.springs.k_a * (x[:, 0] - start[:, 0]).mean()
        return f.ravel() * lattice.disk_points / model.load.force

    found = root(force, start.ravel(), method="hybr", options={"xtol": 1e-13})
    if not np.abs(found.fun).max() < 1e-6:
        raise SimulationError(f"no rest found: {found.message}")
    return found.x.reshape(-1, 2)


def true_result(scenario, outcome, tolerance):
    """Return e or xi [R] of a scenario, and its uncertainty: if contacts jump or the
    wall is hard, the difference at two tolerances. `tolerance`: the judged error."""
    lattice = scenario.lattice
    model = scenario.model
    if not scenario.step_dependent:
        y = at_rest(lattice, model, outcome.positions)[:, 1]
        return scenario.unloaded - (y.mean() - y.min()), 0.0
    wall = model.wall
    speed = scenario.velocity
    # speed far from the wall, whose potential at the start is 5e-8 of e
    far = np.sqrt(speed**2 + 2.0 * wall.energy(lattice, lattice.positions))
    # Go on until the wall's potential, small but not zero, has fallen by e^3.
    t = outcome.series["t"][-1]
    v = outcome.series["com_vy"][-1]
    stop = t + min(3.0 / (wall.a * v), 0.3 * t)

    def solved(rtol):
        start = scenario.velocities
        found = reference_state(lattice, model, start, stop, rtol)
        return found[1, : lattice.disk_points, 1].mean() / far

    # The elastic wall's force jumps from spring to spring, so errors have no order.
    elastic = model.elastic is not None
    rtol = max(1e-12, (1e-8 if elastic else 1e-4) * tolerance)
    tight = solved(rtol)
    if elastic or wall.a * speed * outcome.summary["dt"] > ROUGH:
        return tight, abs(tight - solved(10.0 * rtol))
    return tight, 0.0


def refined(outcome, finest):
    """Return each result at 1/`finest` of the step, and its last difference."""
    scenario = outcome.scenario
    found = []
    rows = scenario.row_interval / ROWS
    own = {"sample_interval": rows, "tolerance": "none"}
    own["integrator"] = outcome.summary["integrator"]
    for finer in (finest // 2, finest):
        dt = outcome.summary["dt"] / finer
        time = replace(scenario.scene.time, dt=dt, **own)
        scene = replace(scenario.scene, time=time)
        columns = compute(replace(scenario, scene=scene), estimate=False).series
        found.append(measured(scenario, columns))
    coarse, fine = found
    return {
        name: (value, abs(value - coarse[name]))
        for name, value in fine.items()
        if name in coarse
    }
