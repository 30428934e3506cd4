"""A spring between the mouse and one point of the disk, and the work that it does."""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.model.world import World

STIFFNESS = 0.2  # of the pulling spring, in k_a
STRONGEST = 0.05  # largest pull, in k_a R: a tenth of what turns triangles inside out
Pair = ti.types.vector(2, ti.f64)


@ti.kernel
def _place(x: ti.template(), i: ti.i32) -> Pair:  # type: ignore[valid-type]
    return Pair(x[i][0, 0], x[i][1, 0])


@ti.kernel
def _kick(v: ti.template(), i: ti.i32, dx: ti.f64, dy: ti.f64):  # type: ignore[valid-type]
    v[i][0, 0] += dx
    v[i][1, 0] += dy


class Pull:
    """Pulls point `point` of `world` towards `target` (x, y) [R]; `work` is what it has given to the disk [M c^2]."""

    def __init__(self, world: World, point: int, target: tuple[float, float]) -> None:
        self.point, self.target, self.work = point, target, 0.0
        self._world = world

    def step(self) -> NDArray[np.float64]:
        """Make one step under the pull; returns the observables (1, columns) after it.

        The pull at the place x_k is a kick before the drift, as every force of the leapfrog; its work on the way
        to x_{k+1} is that of the trapezoidal rule, so that the energy balance closes to the same order, 2.
        """
        world = self._world
        before = self._where()
        force = self._force(before)
        _kick(world.fields["v"], self.point, *(world.dt / world.mass * force))
        row = world.advance(1, 1)[:, :, 0]
        after = self._where()
        self.work += float(0.5 * (force + self._force(after)) @ (after - before))
        return row

    def _where(self) -> NDArray[np.float64]:
        place = _place(self._world.fields["x"], self.point)
        return np.array([place[0], place[1]])

    def _force(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        k_a = self._world.physics.k_a
        force = STIFFNESS * k_a * (np.array(self.target) - place)
        size = float(np.hypot(*force))
        return force * min(1.0, STRONGEST * k_a / size) if size else force
