"""An independent solver: the equations of motion in plain NumPy, integrated by SciPy's DOP853.

Shares no code with the program; takes what lattice.npz holds and the numbers of the scene.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp


@dataclass
class Model:
    bonds: np.ndarray
    rest: np.ndarray
    mass: float
    disk_points: int
    k_a: float = 1.0
    k_b: float = 0.0
    eta: float = 0.0
    a: float = 300.0
    V0: float = 150.0
    rigid: bool = False
    load: float = 0.0
    threshold: float = 0.1
    disk_surface: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    wall_surface: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    boundary: np.ndarray = field(default_factory=lambda: np.zeros(0, int))
    impedance: np.ndarray | None = None
    pinned: bool = False

    @classmethod
    def of(cls, lattice, physics):
        """The model with a lattice's arrays and a `Physics`' numbers."""
        return cls(
            bonds=lattice.bonds,
            rest=lattice.rest_lengths,
            mass=lattice.masses[0],
            disk_points=lattice.disk_points,
            k_a=physics.k_a,
            k_b=physics.k_b,
            eta=physics.eta,
            a=physics.a,
            V0=physics.V0,
            rigid=physics.wall == "rigid",
            load=physics.load,
            threshold=physics.threshold,
            disk_surface=lattice.disk_surface,
            wall_surface=lattice.wall_surface if physics.wall == "elastic" else np.zeros(0, int),
            boundary=lattice.wall_boundary,
            impedance=physics.impedance if physics.boundary == "dashpot" else None,
            pinned=physics.boundary == "pinned",
        )

    def contacts(self, x):
        """(point, left end, right end, n, l, lever) of the disk's surface points over a wall spring, one row each.

        Brute force: every point is held against every spring.
        """
        left, right = self.wall_surface[:-1], self.wall_surface[1:]
        if not len(left):
            return
        px = x[self.disk_surface, 0][:, None]
        over = (x[left, 0] <= px) & (px < x[right, 0])
        for row in np.flatnonzero(over.any(axis=1)):
            i, k = self.disk_surface[row], np.argmax(over[row])
            a, b = x[left[k]], x[right[k]]
            t = b - a
            length = np.hypot(*t)
            normal = np.array([-t[1], t[0]]) / length
            distance = (x[i] - a) @ normal
            if distance < self.threshold:
                yield i, left[k], right[k], normal, distance, (x[i] - a) @ t / length**2

    def elastic(self, x):
        d = x[self.bonds[:, 0]] - x[self.bonds[:, 1]]
        s = np.hypot(d[:, 0], d[:, 1]) - self.rest
        return np.sum(self.k_a * s**2 / 2 + self.k_b * s**4 / 4)

    def wall(self, x):
        rigid = np.sum(self.V0 * np.exp(-self.a * x[: self.disk_points, 1])) if self.rigid else 0.0
        edge = np.exp(-self.a * self.threshold)
        return rigid + sum(self.V0 * (np.exp(-self.a * c[4]) - edge) for c in self.contacts(x))

    def potential(self, x):
        return self.elastic(x) + self.wall(x) + self.load * x[: self.disk_points, 1].mean()

    def force(self, x, v):
        f = np.zeros_like(x)
        i, j = self.bonds.T
        d = x[i] - x[j]
        r = np.hypot(d[:, 0], d[:, 1])
        s = r - self.rest
        g = -((self.k_a * s + self.k_b * s**3) / r)[:, None] * d - self.eta * (v[i] - v[j])
        for c in (0, 1):
            f[:, c] += np.bincount(i, g[:, c], len(x)) - np.bincount(j, g[:, c], len(x))
        if self.rigid:
            f[: self.disk_points, 1] += self.a * self.V0 * np.exp(-self.a * x[: self.disk_points, 1])
        f[: self.disk_points, 1] -= self.load / self.disk_points
        for p, left, right, normal, distance, lever in self.contacts(x):
            push = self.a * self.V0 * np.exp(-self.a * distance) * normal
            f[p] += push
            f[left] -= (1 - lever) * push
            f[right] -= lever * push
        if self.impedance is not None:
            f[self.boundary] -= self.impedance * v[self.boundary]
        if self.pinned:
            f[self.boundary] = 0.0
        return f

    def solve(self, x, v, end, rtol=1e-11, reset_interval=None):
        """State (x, v) at time `end`; the boundary's velocities are zeroed every `reset_interval`."""
        n = len(x)

        def rate(_t, y):
            x, v = y.reshape(2, n, 2)
            return np.concatenate([v, self.force(x, v) / self.mass]).ravel()

        stops = [end]
        if reset_interval:
            count = int(np.floor(end / reset_interval * (1 + 1e-12)))
            stops = [*(np.arange(1, count + 1) * reset_interval), end]
        t, y = 0.0, np.concatenate([x, v]).ravel()
        for k, stop in enumerate(stops):
            if stop > t:
                y = solve_ivp(rate, (t, stop), y, method="DOP853", rtol=rtol, atol=1e-3 * rtol).y[:, -1]
                t = stop
            if reset_interval and k < len(stops) - 1:
                y.reshape(2, n, 2)[1, self.boundary] = 0.0
        return y.reshape(2, n, 2)
