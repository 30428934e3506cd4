"""The true headline of a scene, by a solver that shares nothing with the stepping kernels.

An impact: SciPy's DOP853 on a plain NumPy force, from event to event. The elastic wall's force jumps when a point
passes from one of its springs to the next, comes into reach or leaves it, and the boundary's velocities jump at a
reset: no method with error control steps over those, so each ends a stretch, and within a stretch the force is smooth.
A compression: the forces on all points are brought to zero by SciPy's hybrid Powell method.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics

Array = NDArray[np.float64]
Indices = NDArray[np.integer[Any]]
PAST = 1e-13  # [R] by which a point has to be past an event to end a stretch, so that the next begins beyond it
AHEAD = 1e-10  # [R/c] by which to look ahead for contacts where a stretch ended where it began
SPARSE_FROM = 150  # points: for fewer, whole matrices are multiplied faster
FREE = -1  # in place of the wall spring of a point that is out of reach


@dataclass(frozen=True)
class Contacts:
    """Where `points` (k,) of the disk lie over the wall springs from `left` to `right` (k,): n, l and the lever."""

    points: Indices
    left: Indices
    right: Indices
    normal: Array
    distance: Array
    lever: Array


class Solver:
    """The equations of motion of one scene; positions and velocities are (n, 2) [R], [c]."""

    def __init__(self, lattice: Lattice, physics: Physics) -> None:
        from scipy.sparse import csr_matrix

        self.lattice, self.physics = lattice, physics
        i, j = lattice.bonds.T
        k = np.arange(len(i))
        ones = np.ones(len(i))
        shape = len(i), len(lattice.positions)
        self._difference: Any = csr_matrix((np.r_[ones, -ones], (np.r_[k, k], np.r_[i, j])), shape)
        if shape[1] < SPARSE_FROM:
            self._difference = self._difference.toarray()
        self._gather = self._difference.T.copy()
        self._over = np.full(len(lattice.disk_surface), FREE)  # the wall spring of every surface point in reach

    def force(self, x: Array, v: Array) -> Array:
        """On every point (n, 2) [M c^2/R]; the contacts are those of the stretch."""
        physics, disk = self.physics, self.lattice.disk_points
        d = self._difference @ x
        r = np.hypot(d[:, 0], d[:, 1])
        s = r - self.lattice.rest_lengths
        g = ((physics.k_a * s + physics.k_b * s**3) / r)[:, None] * d
        if physics.eta:
            g += physics.eta * (self._difference @ v)
        f = -(self._gather @ g)
        if physics.wall == "rigid":
            f[:disk, 1] += physics.a * physics.V0 * np.exp(-physics.a * x[:disk, 1])
        elif (self._over != FREE).any():
            rows = np.flatnonzero(self._over != FREE)
            c = self._contacts(x, rows, self._over[rows])
            push = (physics.a * physics.V0 * np.exp(-physics.a * c.distance))[:, None] * c.normal
            np.add.at(f, c.points, push)
            np.add.at(f, c.left, -(1.0 - c.lever)[:, None] * push)
            np.add.at(f, c.right, -c.lever[:, None] * push)
        f[:disk, 1] -= physics.load / disk
        boundary = self.lattice.wall_boundary
        if physics.boundary == "dashpot":
            f[boundary] -= physics.impedance * v[boundary]
        if physics.boundary == "pinned":
            f[boundary] = 0.0
        return f

    def _contacts(self, x: Array, rows: Indices, springs: Indices) -> Contacts:
        """Of the surface points number `rows` with the wall springs number `springs`."""
        points = self.lattice.disk_surface[rows]
        left, right = self.lattice.wall_surface[springs], self.lattice.wall_surface[springs + 1]
        t, to = x[right] - x[left], x[points] - x[left]
        length = np.hypot(t[:, 0], t[:, 1])
        normal = np.stack([-t[:, 1], t[:, 0]], axis=1) / length[:, None]
        distance, lever = (to * normal).sum(axis=1), (to * t).sum(axis=1) / length**2
        return Contacts(points, left, right, normal, distance, lever)

    def _below(self, x: Array) -> tuple[Indices, Indices, Array]:
        """The surface points over a wall spring: (their rows, the springs, the distances l [R])."""
        surface, wall = self.lattice.disk_surface, self.lattice.wall_surface
        px, left, right = x[surface, 0][:, None], x[wall[:-1], 0], x[wall[1:], 0]
        over = (left <= px) & (px < right)
        rows = np.flatnonzero(over.any(axis=1))
        springs = over[rows].argmax(axis=1)
        return rows, springs, self._contacts(x, rows, springs).distance

    def touch(self, x: Array) -> None:
        """Take the contacts that there are at positions `x` for those of the stretch to come."""
        rows, springs, distance = self._below(x)
        near = distance < self.physics.threshold
        self._over[:] = FREE
        self._over[rows[near]] = springs[near]

    def contact_energy(self, x: Array) -> float:
        """Potential of the contacts of the stretch, were the points at `x` [M c^2]."""
        rows = np.flatnonzero(self._over != FREE)
        distance = self._contacts(x, rows, self._over[rows]).distance
        physics = self.physics
        edge = np.exp(-physics.a * physics.threshold)
        return float(np.sum(physics.V0 * (np.exp(-physics.a * distance) - edge)))

    def _room(self, x: Array) -> float:
        """How far the contacts at positions `x` are from others than those of the stretch [R]; negative beyond."""
        room = [1.0]
        held = np.flatnonzero(self._over != FREE)
        if len(held):
            c = self._contacts(x, held, self._over[held])
            px = x[c.points, 0]
            room += [(px - x[c.left, 0]).min(), (x[c.right, 0] - px).min(), self.physics.threshold - c.distance.max()]
        rows, _, distance = self._below(x)
        free = self._over[rows] == FREE
        if free.any():
            room.append(distance[free].min() - self.physics.threshold)
        return float(min(room))

    def solve(self, velocities: Array, end: float, rtol: float) -> Array:
        """(2, n, 2): positions and velocities at time `end` [R/c], from the lattice's positions at t = 0."""
        interval, x = self.physics.reset_interval, self.lattice.positions
        stops = [end]
        if interval:
            stops = [*(np.arange(1, int(end / interval * (1 + 1e-12)) + 1) * interval), end]
        t, y = 0.0, np.concatenate([x, velocities]).ravel()
        for stop in stops:
            if stop > t:
                y, t = self._stretches(t, y, float(stop), rtol), float(stop)
            if interval and stop is not stops[-1]:
                y.reshape(2, -1, 2)[1, self.lattice.wall_boundary] = 0.0
        return y.reshape(2, -1, 2)

    def _stretches(self, t: float, y: Array, stop: float, rtol: float) -> Array:
        from scipy.integrate import solve_ivp

        mass = self.lattice.masses[:, None]
        shape = (2, len(self.lattice.positions), 2)

        def rate(_t: float, y: Any) -> Any:
            x, v = y.reshape(shape)
            return np.concatenate([v, self.force(x, v) / mass]).ravel()

        def room(_t: float, y: Any) -> float:
            return self._room(y.reshape(shape)[0]) + PAST

        room.terminal, room.direction = True, -1.0  # type: ignore[attr-defined]
        elastic = self.physics.wall == "elastic"
        ahead = 0.0
        while t < stop:
            if elastic:
                x, v = y.reshape(shape)
                self.touch(x + ahead * v)
            events = room if elastic else None
            found = solve_ivp(rate, (t, stop), y, "DOP853", rtol=rtol, atol=1e-3 * rtol, events=events)
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
