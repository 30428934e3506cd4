"""An independent solver: the equations of motion in plain NumPy, integrated by SciPy's DOP853.

It shares no code with the stepping kernels: what they are measured against.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.output import atomic_write

Array = NDArray[np.float64]
RTOL = 1e-11


@dataclass(frozen=True)
class Reference:
    """The whole model, forces (n, 2) [M c^2/R] from positions [R] and velocities [c]."""

    lattice: Lattice
    physics: Physics

    def contacts(self, x: Array) -> Iterator[tuple[int, int, int, Array, float, float]]:
        """(point, left end, right end, n, l, lever) of the disk's surface points over a wall spring.

        Brute force: every point is held against every spring.
        """
        left, right = self.lattice.wall_surface[:-1], self.lattice.wall_surface[1:]
        surface = self.lattice.disk_surface
        px = x[surface, 0][:, None]
        over = (x[left, 0] <= px) & (px < x[right, 0])
        for row in np.flatnonzero(over.any(axis=1)):
            i, k = surface[row], np.argmax(over[row])
            a, b = x[left[k]], x[right[k]]
            t = b - a
            length = np.hypot(*t)
            normal = np.array([-t[1], t[0]]) / length
            distance = float((x[i] - a) @ normal)
            if distance < self.physics.threshold:
                yield i, left[k], right[k], normal, distance, float((x[i] - a) @ t / length**2)

    def force(self, x: Array, v: Array) -> Array:
        physics, disk = self.physics, self.lattice.disk_points
        f = np.zeros_like(x)
        i, j = self.lattice.bonds.T
        d = x[i] - x[j]
        r = np.hypot(d[:, 0], d[:, 1])
        s = r - self.lattice.rest_lengths
        g = -((physics.k_a * s + physics.k_b * s**3) / r)[:, None] * d - physics.eta * (v[i] - v[j])
        for c in (0, 1):
            f[:, c] += np.bincount(i, g[:, c], len(x)) - np.bincount(j, g[:, c], len(x))
        if physics.wall == "rigid":
            f[:disk, 1] += physics.a * physics.V0 * np.exp(-physics.a * x[:disk, 1])
        if physics.wall == "elastic":
            for point, left, right, normal, distance, lever in self.contacts(x):
                push = physics.a * physics.V0 * np.exp(-physics.a * distance) * normal
                f[point] += push
                f[left] -= (1 - lever) * push
                f[right] -= lever * push
        f[:disk, 1] -= physics.load / disk
        boundary = self.lattice.wall_boundary
        if physics.boundary == "dashpot":
            f[boundary] -= physics.impedance * v[boundary]
        if physics.boundary == "pinned":
            f[boundary] = 0.0
        return f

    def solve(self, velocities: Array, end: float, rtol: float = RTOL) -> Array:
        """(2, n, 2): positions and velocities at time `end` [R/c], from the lattice's positions at t = 0."""
        from scipy.integrate import solve_ivp

        x = self.lattice.positions
        mass = self.lattice.masses[:, None]

        def rate(_t: float, y: Any) -> Any:
            x, v = y.reshape(2, -1, 2)
            return np.concatenate([v, self.force(x, v) / mass]).ravel()

        stops, interval = [end], self.physics.reset_interval
        if interval:
            stops = [*(np.arange(1, int(end / interval * (1 + 1e-12)) + 1) * interval), end]
        t, y = 0.0, np.concatenate([x, velocities]).ravel()
        for stop in stops:
            if stop > t:
                y = solve_ivp(rate, (t, stop), y, method="DOP853", rtol=rtol, atol=1e-3 * rtol).y[:, -1]
                t = stop
            if interval and stop is not stops[-1]:
                y.reshape(2, -1, 2)[1, self.lattice.wall_boundary] = 0.0
        return np.asarray(y).reshape(2, -1, 2)


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
