"""The motion of a scene by SciPy's DOP853 on the NumPy twins of its laws: nothing that the kernels use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.signals import raise_if_interrupted

if TYPE_CHECKING:
    from taichi_disk.physics import Model


RTOL = 1e-11


class Reference:
    """Solves the equations of motion of a `model` on a `lattice`, in scene coordinates at t = 0."""

    def __init__(self, lattice: Lattice, model: Model) -> None:
        self.lattice, self.model = lattice, model

    def solve(self, velocities: Array, end: float, rtol: float = RTOL) -> Array:
        """(2, n, 2): positions and velocities at time `end` [R/c], from the lattice's positions at t = 0.

        Raises SimulationError where SciPy gives up.
        """
        from scipy.integrate import solve_ivp

        stops, interval = [end], self.model.reset_interval
        if interval:
            stops = [*(np.arange(1, int(end / interval * (1 + 1e-12)) + 1) * interval), end]
        t = 0.0
        y: Array = np.concatenate([self.lattice.positions, velocities]).ravel()
        for stop in stops:
            if stop > t:
                # Between resets a step or two do; of a whole motion the end alone is kept.
                how: dict[str, Any] = {"first_step": stop - t} if interval else {"t_eval": [stop]}
                with np.errstate(all="ignore"):  # it tries steps that crush the disk, and takes them back
                    found = solve_ivp(self.rate, (t, stop), y, "DOP853", rtol=rtol, atol=1e-3 * rtol, **how)
                if not found.success:
                    raise SimulationError(f"the reference solution ends before t = {stop:.6g} R/c: {found.message}")
                y, t = np.array(found.y[:, -1]), stop
            if interval and stop is not stops[-1]:
                y.reshape(2, -1, 2)[1, self.lattice.wall_boundary] = 0.0
        return y.reshape(2, -1, 2)

    def rate(self, _t: float, y: Array) -> Array:
        """Velocities and accelerations of the state `y`: x0, y0, x1 ... and the velocities likewise."""
        raise_if_interrupted()
        x, v = y.reshape(2, -1, 2)
        force = self.model.forces_moving(self.lattice, x, v)
        return np.concatenate([v, force / self.lattice.masses[:, None]]).ravel()
