"""The true result of a scene, by a solver that shares nothing with the stepping kernels.

An impact: SciPy's DOP853 on a plain NumPy force, from event to event. The elastic wall's force jumps when a point
passes from one of its springs to the next, comes into reach or leaves it, and the boundary's velocities jump at a
reset: no method with error control steps over those, so each ends a stretch, and within a stretch the force is smooth.
A compression: the forces on all points are brought to zero by SciPy's hybrid Powell method.
"""

from __future__ import annotations

from dataclasses import astuple, replace
from typing import Any

import numpy as np

from taichi_disk.accuracy.reference import Array, Reference
from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice
from taichi_disk.physics import ElasticWall, Model
from taichi_disk.physics.elastic_wall import Contacts
from taichi_disk.simulation.observables import Columns
from taichi_disk.simulation.scenario import Scenario

PAST = 1e-13  # [R] by which a point has to be past an event to end a stretch, so that the next begins beyond it
AHEAD = 1e-10  # [R/c] by which to look ahead for contacts where a stretch ended where it began
ROUGH = 0.3  # of the wall's decay length crossed in a step, from which the truth itself may be in doubt


class HeldWall(ElasticWall):
    """An elastic wall whose contacts are those that there were once."""

    held = np.zeros(0, int), np.zeros(0, int)  # rows of the disk's surface, the wall's springs

    def contacts(self, lattice: Lattice, x: Array) -> Contacts:
        return self.against(lattice, x, *self.held)

    def touch(self, lattice: Lattice, x: Array) -> None:
        """Take the contacts that there are at positions `x` for those to come."""
        rows, springs = self.rows_over(lattice, x)
        near = self.against(lattice, x, rows, springs).distance < self.threshold
        self.held = rows[near], springs[near]

    def room(self, lattice: Lattice, x: Array) -> float:
        """How far the contacts at positions `x` are from others than those held [R]; negative beyond."""
        room, held = [1.0], self.contacts(lattice, x)
        if len(held.points):
            px, edges = x[held.points, 0], x[lattice.wall_surface, 0]
            room += [(px - edges[held.springs]).min(), (edges[held.springs + 1] - px).min()]
            room.append(self.threshold - held.distance.max())
        rows, springs = self.rows_over(lattice, x)
        free = ~np.isin(rows, self.held[0])
        if free.any():
            room.append(self.against(lattice, x, rows[free], springs[free]).distance.min() - self.threshold)
        return float(min(room))


class Solver(Reference):
    """The equations of motion of one scene, stretch by stretch; contacts are those with which a stretch begins."""

    def __init__(self, lattice: Lattice, model: Model) -> None:
        wall = HeldWall(*astuple(model.elastic)) if model.elastic else model.wall
        super().__init__(lattice, replace(model, wall=wall))
        self.wall: Any = wall

    def stretch(self, t: float, stop: float, y: Array, rtol: float) -> Array:
        """As in `Reference`, from event to event."""
        if self.model.elastic is None:
            return super().stretch(t, stop, y, rtol)
        from scipy.integrate import solve_ivp

        def room(_t: float, y: Any) -> float:
            return float(self.wall.room(self.lattice, y.reshape(2, -1, 2)[0])) + PAST

        room.terminal, room.direction = True, -1.0  # type: ignore[attr-defined]
        ahead = 0.0
        while t < stop:
            x, v = y.reshape(2, -1, 2)
            self.wall.touch(self.lattice, x + ahead * v)
            found = solve_ivp(self.rate, (t, stop), y, "DOP853", rtol=rtol, atol=1e-3 * rtol, events=room)
            if not found.success:
                raise SimulationError(found.message)
            # Where a point comes into reach from beside, l jumps, and the event is found just before that.
            ahead = AHEAD if found.t[-1] - t < AHEAD else 0.0
            t, y = float(found.t[-1]), found.y[:, -1]
        return np.asarray(y)


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
    a, speed = scenario.model.wall.a, scenario.velocity  # type: ignore[union-attr, attr-defined]
    # On until the wall's potential has fallen by e^3: the run ends where it is small, not where it is zero.
    t, v = float(columns["t"][-1]), float(columns["com_vy"][-1])
    stop = t + min(3.0 / (a * v), 0.3 * t)

    def solved(rtol: float) -> float:
        found = Solver(scenario.lattice, scenario.model).solve(scenario.velocities, stop, rtol)
        return float(found[1, : scenario.lattice.disk_points, 1].mean()) / speed

    rtol = max(1e-12, 1e-4 * tolerance)
    tight = solved(rtol)
    rough = scenario.model.elastic is not None or a * speed * dt > ROUGH
    return tight, abs(tight - solved(10.0 * rtol)) if rough else 0.0
