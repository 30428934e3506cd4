"""The true headline of a scene, by a solver that shares nothing with the stepping kernels.

An impact: SciPy's DOP853 on a plain NumPy force, from event to event. The elastic wall's force jumps when a point
passes from one of its springs to the next, comes into reach or leaves it, and the boundary's velocities jump at a
reset: no method with error control steps over those, so each ends a stretch, and within a stretch the force is smooth.
A compression: the forces on all points are brought to zero by SciPy's hybrid Powell method.
"""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.study.reference import Array, Contacts, Indices, Reference

PAST = 1e-13  # [R] by which a point has to be past an event to end a stretch, so that the next begins beyond it
AHEAD = 1e-10  # [R/c] by which to look ahead for contacts where a stretch ended where it began
FREE = -1  # in place of the wall spring of a point that is out of reach


class Solver(Reference):
    """The equations of motion of one scene, stretch by stretch; contacts are those with which a stretch begins."""

    @cached_property
    def _held(self) -> Indices:
        """The wall spring of every surface point in reach."""
        return np.full(len(self.lattice.disk_surface), FREE)

    def touch(self, x: Array) -> None:
        """Take the contacts that there are at positions `x` for those of the stretch to come."""
        rows, springs = self.within_reach(x)
        self._held[:] = FREE
        self._held[rows] = springs

    def contacts(self, x: Array) -> Contacts:
        """Those of the stretch, were the points at `x`."""
        rows = np.flatnonzero(self._held != FREE)
        return self.against(x, rows, self._held[rows])

    def contact_energy(self, x: Array) -> float:
        """Potential of the contacts of the stretch, were the points at `x` [M c^2]."""
        physics = self.physics
        edge = np.exp(-physics.a * physics.threshold)
        return float(np.sum(physics.V0 * (np.exp(-physics.a * self.contacts(x).distance) - edge)))

    def _room(self, x: Array) -> float:
        """How far the contacts at positions `x` are from others than those of the stretch [R]; negative beyond."""
        room, held = [1.0], self.contacts(x)
        if len(held.points):
            px = x[held.points, 0]
            room += [(px - x[held.left, 0]).min(), (x[held.right, 0] - px).min()]
            room.append(self.physics.threshold - held.distance.max())
        rows, springs = self.over(x)
        free = self._held[rows] == FREE
        if free.any():
            room.append(self.against(x, rows[free], springs[free]).distance.min() - self.physics.threshold)
        return float(min(room))

    def stretch(self, t: float, stop: float, y: Array, rtol: float) -> Array:
        """As in `Reference`, from event to event."""
        if self.physics.wall != "elastic":
            return super().stretch(t, stop, y, rtol)
        from scipy.integrate import solve_ivp

        def room(_t: float, y: Any) -> float:
            return self._room(y.reshape(2, -1, 2)[0]) + PAST

        room.terminal, room.direction = True, -1.0  # type: ignore[attr-defined]
        ahead = 0.0
        while t < stop:
            x, v = y.reshape(2, -1, 2)
            self.touch(x + ahead * v)
            found = solve_ivp(self.rate, (t, stop), y, "DOP853", rtol=rtol, atol=1e-3 * rtol, events=room)
            # Where a point comes into reach from beside, l jumps, and the event is found just before that.
            ahead = AHEAD if found.t[-1] - t < AHEAD else 0.0
            t, y = float(found.t[-1]), found.y[:, -1]
        return np.asarray(y)


def at_rest(lattice: Lattice, physics: Physics, start: Array) -> Array:
    """(n, 2): positions near `start` at which no point feels a force. Raises SimulationError where none are found."""
    from scipy.optimize import root

    solver, still = Solver(lattice, physics), np.zeros_like(start)
    scale = physics.load / lattice.disk_points

    def force(y: Any) -> Any:
        f = solver.force(y.reshape(-1, 2), still)
        f[:, 0] -= physics.k_a * (y.reshape(-1, 2)[:, 0] - start[:, 0]).mean()  # a flat wall does not hold x
        return f.ravel() / scale

    found = root(force, start.ravel(), method="hybr", options={"xtol": 1e-13})
    if not np.abs(found.fun).max() < 1e-6:
        raise SimulationError(f"no rest found: {found.message}")
    return np.asarray(found.x.reshape(-1, 2))
