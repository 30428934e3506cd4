"""The motion of a scene by SciPy's DOP853 on the NumPy twins of its laws: nothing that the kernels use."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Array, Lattice

if TYPE_CHECKING:
    from taichi_disk.physics import Model


RTOL = 1e-11


class Reference:
    """Solves the equations of motion of a `model` on a `lattice`, in scene coordinates at t = 0."""

    def __init__(self, lattice: Lattice, model: Model) -> None:
        self.lattice, self.model = lattice, model
        self._step = np.inf

    def solve(self, velocities: Array, end: float, rtol: float = RTOL) -> Array:
        """(2, n, 2): positions and velocities at time `end` [R/c], from the lattice's positions at t = 0."""
        stops, interval = [end], self.model.reset_interval
        if interval:
            stops = [*(np.arange(1, int(end / interval * (1 + 1e-12)) + 1) * interval), end]
        t = 0.0
        y: Array = np.concatenate([self.lattice.positions, velocities]).ravel()
        self._step = np.inf
        with np.errstate(all="ignore"):  # it tries steps that crush the disk, and takes them back
            for stop in stops:
                if stop > t:
                    y, t = self.stretch(t, float(stop), y, rtol), float(stop)
                if interval and stop is not stops[-1]:
                    y.reshape(2, -1, 2)[1, self.lattice.wall_boundary] = 0.0
        return y.reshape(2, -1, 2)

    def stretch(self, t: float, stop: float, y: Array, rtol: float) -> Array:
        """The state `y` of time `t`, at time `stop` [R/c]: no reset lies between.

        Raises SimulationError where SciPy gives up.
        """
        from scipy.integrate import DOP853

        first = min(self._step, stop - t) if np.isfinite(self._step) else None
        solver = DOP853(self.rate, t, y, stop, rtol=rtol, atol=1e-3 * rtol, first_step=first)
        longest, message = 0.0, None
        while solver.status == "running":
            message = solver.step()
            longest = max(longest, solver.step_size or 0.0)
        if solver.status == "failed":
            raise SimulationError(f"the reference solution ends at t = {solver.t:.6g} R/c: {message}")
        self._step = longest  # to begin the next stretch with: SciPy's own guess costs some steps
        return np.array(solver.y)

    def rate(self, _t: float, y: Array) -> Array:
        """Velocities and accelerations of the state `y`: x0, y0, x1 ... and the velocities likewise."""
        x, v = y.reshape(2, -1, 2)
        force = self.model.forces_moving(self.lattice, x, v)
        return np.concatenate([v, force / self.lattice.masses[:, None]]).ravel()
