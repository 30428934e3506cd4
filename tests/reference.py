"""An independent solver: plain NumPy and SciPy's DOP853. It shares no code with the
program: it uses lattice.npz and the scene's parameters."""

from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp


class Contacts(NamedTuple):
    """Contacts, one per row; `left` and `right`: ends of the wall's spring."""

    point: np.ndarray
    left: np.ndarray
    right: np.ndarray
    normal: np.ndarray
    distance: np.ndarray
    lever: np.ndarray


class Model:
    """The arrays of one lattice, and the parameters of the program's `model`."""

    def __init__(self, lattice, model):
        kind = type(model.wall).__name__
        springs = model.springs
        self.bonds = lattice.bonds
        self.rest = lattice.rest_lengths
        self.mass = lattice.masses[:, None]
        self.disk_points = lattice.disk_points
        self.disk_surface = lattice.disk_surface
        self.k_a = springs.k_a
        self.k_b = springs.k_b
        self.eta = springs.eta
        # missing in lattice.npz of a plain disk
        stiffness = getattr(lattice, "stiffness", None)
        self.factor = np.ones(len(lattice.bonds)) if stiffness is None else stiffness
        self.weight = (
            self.mass[: lattice.disk_points] / self.mass[: lattice.disk_points].sum()
        )
        self.axial = springs.axial
        self.rigid = kind == "ExponentialWall"  # at y = 0
        self.wall_surface = (
            lattice.wall_surface if kind == "ElasticWall" else np.zeros(0, int)
        )
        self.a, self.V0, self.threshold = (
            getattr(model.wall, name, 0.0) for name in ("a", "V0", "threshold")
        )
        self.load = model.load.force if model.load else 0.0
        self.boundary = lattice.wall_boundary
        self.impedance = getattr(model.boundary, "impedance", None)
        self.pinned = type(model.boundary).__name__ == "PinnedBoundary"

    def contacts(self, x):
        """Return the contacts of disk and wall; every pair is tried."""
        left = self.wall_surface[:-1]
        right = self.wall_surface[1:]
        px = x[self.disk_surface, 0][:, None]
        row, spring = np.nonzero((x[left, 0] <= px) & (px < x[right, 0]))
        row, first = np.unique(row, return_index=True)
        point = self.disk_surface[row]
        left = left[spring[first]]
        right = right[spring[first]]
        t = x[right] - x[left]
        away = x[point] - x[left]
        length = np.hypot(*t.T)
        normal = np.stack([-t[:, 1], t[:, 0]], axis=1) / length[:, None]
        distance = (away * normal).sum(axis=1)
        lever = (away * t).sum(axis=1) / length**2
        near = distance < self.threshold
        return Contacts(
            *(values[near] for values in (point, left, right, normal, distance, lever))
        )

    def elastic(self, x):
        d = x[self.bonds[:, 0]] - x[self.bonds[:, 1]]
        s = np.hypot(d[:, 0], d[:, 1]) - self.rest
        return np.sum(self.factor * (self.k_a * s**2 / 2 + self.k_b * s**4 / 4))

    def wall(self, x):
        if self.rigid:
            return np.sum(self.V0 * np.exp(-self.a * x[: self.disk_points, 1]))
        edge = np.exp(-self.a * self.threshold)
        return np.sum(self.V0 * (np.exp(-self.a * self.contacts(x).distance) - edge))

    def potential(self, x):
        return (
            self.elastic(x)
            + self.wall(x)
            + self.load * np.sum(self.weight[:, 0] * x[: self.disk_points, 1])
        )

    def wall_force(self, x):
        """Return the wall's force on all points (n, 2), with its reaction."""
        f = np.zeros_like(x)
        if self.rigid:
            f[: self.disk_points, 1] += (
                self.a * self.V0 * np.exp(-self.a * x[: self.disk_points, 1])
            )
            return f
        found = self.contacts(x)
        push = (self.a * self.V0 * np.exp(-self.a * found.distance))[
            :, None
        ] * found.normal
        np.add.at(f, found.point, push)
        np.add.at(f, found.left, (found.lever - 1.0)[:, None] * push)
        np.add.at(f, found.right, -found.lever[:, None] * push)
        return f

    def force(self, x, v):
        f = self.wall_force(x)
        i, j = self.bonds.T
        d = x[i] - x[j]
        r = np.hypot(d[:, 0], d[:, 1])
        s = r - self.rest
        u = v[i] - v[j]
        if self.axial:
            u = (np.sum(u * d, axis=1) / r**2)[:, None] * d
        g = self.factor[:, None] * (
            -((self.k_a * s + self.k_b * s**3) / r)[:, None] * d - self.eta * u
        )
        for c in (0, 1):
            f[:, c] += np.bincount(i, g[:, c], len(x)) - np.bincount(j, g[:, c], len(x))
        f[: self.disk_points, 1] -= self.load * self.weight[:, 0]
        if self.impedance is not None:
            f[self.boundary] -= self.impedance * v[self.boundary]
        if self.pinned:
            f[self.boundary] = 0.0
        return f

    def solve(self, x, v, times, rtol=1e-11, method="DOP853"):
        """Return (x, v) (times, 2, n, 2); `times` begin at the start. LSODA is quicker
        for strong dashpots of few points."""

        def rate(_t, y):
            x, v = y.reshape(2, *shape)
            return np.concatenate([v, self.force(x, v) / self.mass]).ravel()

        shape = x.shape
        y = np.concatenate([x, v]).ravel()
        span = times[0], times[-1]
        found = solve_ivp(
            rate, span, y, method, rtol=rtol, atol=1e-3 * rtol, t_eval=times
        )
        return found.y.T.reshape(-1, 2, *shape)

    def solve_with_resets(self, x, v, end, interval, rtol=1e-11):
        """Return (x, v) at `end`; every `interval` the boundary is reset."""
        t = 0.0
        for stop in np.arange(1, int(end / interval * (1 + 1e-12)) + 1) * interval:
            x, v = self.solve(x, v, (t, stop), rtol)[-1]
            v[self.boundary] = 0.0
            t = stop
        return self.solve(x, v, (t, end), rtol)[-1] if t < end else (x, v)
