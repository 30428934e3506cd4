"""A spring between the mouse and one point of the disk, and the work that it does."""

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.model.world import World

STIFFNESS = 0.2  # of the pulling spring, in k_a
STRONGEST = 0.02  # largest pull, in k_a R: more would turn triangles of a fine lattice inside out
Four = ti.types.vector(4, ti.f64)


@ti.kernel
def _read(x: ti.template(), v: ti.template(), f: ti.template(), i: ti.i32, closing: ti.f64) -> Four:  # type: ignore[valid-type]
    """Place and velocity of point i now; closing: see `Parameters`."""
    return Four(x[i][0, 0], x[i][1, 0], v[i][0, 0] + closing * f[i][0, 0], v[i][1, 0] + closing * f[i][1, 0])


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

        Once a step the point is kicked by d = h F/m, which changes its energy by m (u.d + d^2/2), u its velocity:
        that is the work, to the last bit. Kicks between steps are Strang's splitting, order 2, with the half kicks
        of neighbouring steps joined.
        """
        world = self._world
        g = world.dt / world.mass
        fields = world.fields
        state = _read(fields["x"], fields["v"], fields["f"], self.point, world.splitting.kicks[-1] * g)
        kick = g * self._force(np.array([state[0], state[1]]))
        _kick(fields["v"], self.point, *kick)
        self.work += world.mass * float(np.array([state[2], state[3]]) @ kick + 0.5 * kick @ kick)
        return world.advance(1, 1)[:, :, 0]

    def _force(self, place: NDArray[np.float64]) -> NDArray[np.float64]:
        k_a = self._world.physics.k_a
        force = STIFFNESS * k_a * (np.array(self.target) - place)
        size = float(np.hypot(*force))
        return force * min(1.0, STRONGEST * k_a / size) if size else force
