"""An independent solver: the equations of motion in plain NumPy, integrated by SciPy's DOP853.

It shares no code with the stepping kernels: what they are measured against.
"""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.output import atomic_write

Array = NDArray[np.float64]
Indices = NDArray[np.integer[Any]]
RTOL = 1e-11


@dataclass(frozen=True)
class Contacts:
    """Where `points` (k,) of the disk lie over the wall springs from `left` to `right` (k,): n, l and the lever."""

    points: Indices
    left: Indices
    right: Indices
    normal: Array
    distance: Array
    lever: Array


@dataclass(frozen=True)
class Reference:
    """The whole model, forces (n, 2) [M c^2/R] from positions [R] and velocities [c]."""

    lattice: Lattice
    physics: Physics

    @cached_property
    def _difference(self) -> Any:
        """(springs, n) sparse: the first end of every spring less the second."""
        from scipy.sparse import csr_matrix

        i, j = self.lattice.bonds.T
        k, ones = np.arange(len(i)), np.ones(len(i))
        return csr_matrix((np.r_[ones, -ones], (np.r_[k, k], np.r_[i, j])), (len(i), len(self.lattice.positions)))

    @cached_property
    def _sum(self) -> Any:
        return self._difference.T.tocsr()

    def over(self, x: Array) -> tuple[Indices, Indices]:
        """The disk's surface points over a wall spring: their rows, and the springs. Every pair is looked at."""
        wall = self.lattice.wall_surface
        px, left, right = x[self.lattice.disk_surface, 0][:, None], x[wall[:-1], 0], x[wall[1:], 0]
        over = (left <= px) & (px < right)
        rows = np.flatnonzero(over.any(axis=1))
        return rows, over[rows].argmax(axis=1)

    def against(self, x: Array, rows: Indices, springs: Indices) -> Contacts:
        """Surface points number `rows` against the wall springs number `springs`."""
        points = self.lattice.disk_surface[rows]
        left, right = self.lattice.wall_surface[springs], self.lattice.wall_surface[springs + 1]
        t, to = x[right] - x[left], x[points] - x[left]
        length = np.hypot(t[:, 0], t[:, 1])
        normal = np.stack([-t[:, 1], t[:, 0]], axis=1) / length[:, None]
        distance, lever = (to * normal).sum(axis=1), (to * t).sum(axis=1) / length**2
        return Contacts(points, left, right, normal, distance, lever)

    def within_reach(self, x: Array) -> tuple[Indices, Indices]:
        """Rows and springs of `over` that push one another."""
        rows, springs = self.over(x)
        near = self.against(x, rows, springs).distance < self.physics.threshold
        return rows[near], springs[near]

    def contacts(self, x: Array) -> Contacts:
        """Who pushes whom while the points are at `x`."""
        return self.against(x, *self.within_reach(x))

    def force(self, x: Array, v: Array) -> Array:
        physics, disk = self.physics, self.lattice.disk_points
        d = self._difference @ x
        r = np.hypot(d[:, 0], d[:, 1])
        s = r - self.lattice.rest_lengths
        g = ((physics.k_a * s + physics.k_b * s**3) / r)[:, None] * d
        if physics.eta:
            g += physics.eta * (self._difference @ v)
        f = -(self._sum @ g)
        if physics.wall == "rigid":
            f[:disk, 1] += physics.a * physics.V0 * np.exp(-physics.a * x[:disk, 1])
        if physics.wall == "elastic":
            touching = self.contacts(x)
            push = (physics.a * physics.V0 * np.exp(-physics.a * touching.distance))[:, None] * touching.normal
            lever = touching.lever[:, None]
            np.add.at(f, touching.points, push)
            np.add.at(f, touching.left, (lever - 1.0) * push)
            np.add.at(f, touching.right, -lever * push)
        f[:disk, 1] -= physics.load / disk
        boundary = self.lattice.wall_boundary
        if physics.boundary == "dashpot":
            f[boundary] -= physics.impedance * v[boundary]
        if physics.boundary == "pinned":
            f[boundary] = 0.0
        return f

    def rate(self, _t: float, y: Array) -> Array:
        """Velocities and accelerations of the state `y`: x0, y0, x1 ... and the velocities likewise."""
        x, v = y.reshape(2, -1, 2)
        return np.concatenate([v, self.force(x, v) / self.lattice.masses[:, None]]).ravel()

    def solve(self, velocities: Array, end: float, rtol: float = RTOL) -> Array:
        """(2, n, 2): positions and velocities at time `end` [R/c], from the lattice's positions at t = 0."""
        stops, interval = [end], self.physics.reset_interval
        if interval:
            stops = [*(np.arange(1, int(end / interval * (1 + 1e-12)) + 1) * interval), end]
        t, y = 0.0, np.concatenate([self.lattice.positions, velocities]).ravel()
        for stop in stops:
            if stop > t:
                y, t = self.stretch(t, float(stop), y, rtol), float(stop)
            if interval and stop is not stops[-1]:
                y.reshape(2, -1, 2)[1, self.lattice.wall_boundary] = 0.0
        return y.reshape(2, -1, 2)

    def stretch(self, t: float, stop: float, y: Array, rtol: float) -> Array:
        """The state `y` of time `t`, at time `stop` [R/c]: no reset lies between."""
        from scipy.integrate import solve_ivp

        return np.asarray(solve_ivp(self.rate, (t, stop), y, "DOP853", rtol=rtol, atol=1e-3 * rtol).y[:, -1])


def cached_solution(reference: Reference, velocities: Array, end: float) -> Array:
    """`reference.solve`, kept between runs in $XDG_CACHE_HOME/taichi_disk (default ~/.cache)."""
    lattice, physics = reference.lattice, reference.physics
    parts = (lattice.positions, lattice.bonds, lattice.rest_lengths, lattice.masses, velocities, physics.impedance)
    key = hashlib.sha256(repr((physics, end, RTOL)).encode())
    for part in parts:
        key.update(np.ascontiguousarray(part).tobytes())
    folder = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "taichi_disk"
    path = folder / f"reference-{key.hexdigest()[:24]}.npy"
    if path.exists():
        return np.asarray(np.load(path))
    solution = reference.solve(velocities, end)
    folder.mkdir(parents=True, exist_ok=True)
    atomic_write(path, lambda beside: np.save(beside, solution))
    return solution
