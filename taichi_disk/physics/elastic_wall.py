"""Contact with the elastic wall (paper section 5): a V0 exp(-a l) from the wall's surface spring below a point.

The distance l is measured along the spring's normal n. The spring's two ends take the reaction by the lever rule, which
balances force and torque and makes the force the gradient of V0 exp(-a l) while the point stays over one spring. The
potential is shifted to be zero at the threshold, so that coming into reach adds no energy.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.engine import ti
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics.law import Capacity, Integers1, Wall, array, get, put


@dataclass(frozen=True)
class Contacts:
    """Surface points of the disk within the threshold of the wall, in NumPy."""

    points: NDArray[np.intp]  # (k,) their numbers in the lattice
    carriers: NDArray[np.intp]  # (k, w) which of `wall_surface` take the reaction of each
    shares: Array  # (k, w) in which parts
    energy: Array  # (k,) V0 exp(-a l), not shifted [M c^2]
    force: Array  # (k, 2) on each [M c^2/R]


@ti.data_oriented
@dataclass(eq=False)
class ElasticWall(Wall):
    """The contact law between the disk's surface points and the wall's surface springs."""

    a: float  # hardness [1/R]
    V0: float  # potential at distance 0 [M c^2]
    threshold: float  # distance beyond which there is no contact [R]
    is_elastic = True
    scalars = ("a", "V0", "threshold", "shift")

    has_jumps = True  # of the force, where a point passes from one spring of the wall to the next

    @property
    def shift(self) -> float:
        """Of the potential, which is 0 at the threshold [M c^2]."""
        return float(self.potential(self.threshold))

    def added_stiffness(self, force: float) -> float:
        """As for the rigid wall, but two points of equal mass approach each other: 2 a F [M c^2/R^2]."""
        return 2.0 * super().added_stiffness(force)

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        super().make_fields(builder, capacity)
        self.disk_surface, self.wall_surface = (array(builder, capacity.points) for _ in range(2))
        self.count = array(builder, 2)

    def fill(self, lattice: Lattice) -> None:
        self._fill(lattice.disk_surface, lattice.wall_surface)

    @ti.kernel
    def _fill(self, disk: Integers1, wall: Integers1):
        self.count[0], self.count[1] = disk.shape[0], wall.shape[0]
        for k in range(disk.shape[0]):
            self.disk_surface[k] = disk[k]
        for k in range(wall.shape[0]):
            self.wall_surface[k] = wall[k]

    @ti.func
    def add(self, state: ti.template(), move):
        """Push every surface point of the disk off the wall spring below it.

        Returns the upward force on the disk [M c^2/R], the potential [M c^2], the largest force on one point, and what
        points lost by sliding in the last move, which was `move` times the velocity (see `slid`).
        """
        a, V0, threshold = self.a_now[None], self.V0_now[None], self.threshold_now[None]
        x, y = ti.static(state.x[0], state.x[1])
        upward, potential, peak_point_force, slid = 0.0, 0.0, 0.0, 0.0
        last = self.count[1] - 1
        top, left = self.top_and_left(state)
        pitch = (x[self.wall_surface[last]] - left) / last
        for n in range(self.count[0]):
            i = self.disk_surface[n]
            # The vertical distance is at most twice l unless the surface is steeper than 60 degrees.
            if y[i] - top < 2.0 * threshold:
                guess = ti.max(0, ti.min(last - 1, ti.cast((x[i] - left) / pitch, ti.i32)))
                k = self.spring_below(state, i, guess, 0.0)
                p, q = self.wall_surface[k], self.wall_surface[k + 1]
                if x[i] >= x[p] and x[i] < x[q]:
                    distance, lever, normal = self.over(state, i, k, 0.0)
                    if distance < threshold:
                        energy = V0 * ti.exp(-a * distance)
                        point_force = (a * energy) * normal
                        put(state.f, i, get(state.f, i) + point_force)
                        put(state.f, p, get(state.f, p) - (1.0 - lever) * point_force)
                        put(state.f, q, get(state.f, q) - lever * point_force)
                        upward += point_force[1]
                        potential += energy - self.shift_now[None]
                        peak_point_force = ti.max(peak_point_force, a * energy)
                        slid += self.slid(state, i, k, move)
        return upward, potential, peak_point_force, slid

    @ti.func
    def top_and_left(self, state: ti.template()):
        """y of the wall's highest surface point, x of its first."""
        top = state.x[1][self.wall_surface[0]]
        for k in range(1, self.count[1]):
            top = ti.max(top, state.x[1][self.wall_surface[k]])
        return top, state.x[0][self.wall_surface[0]]

    @ti.func
    def slid(self, state: ti.template(), i, k, move):
        """Energy that point i, now over wall spring k, lost if it was over another one before the last move.

        Where the surface is bent, the distance l jumps as a point passes from one spring to the next, and with it the
        potential: half of the jumps at either end of the move, as the trapezoidal rule has it.
        """
        before = self.spring_below(state, i, k, move)
        lost = 0.0
        if before != k:
            for case in range(4):  # a loop: what is inlined four times takes long to compile
                spring, half = k, -0.5
                if case < 2:
                    spring, half = before, 0.5
                distance, _lever, _normal = self.over(state, i, spring, (case % 2) * move)
                if distance < self.threshold_now[None]:
                    energy = self.V0_now[None] * ti.exp(-self.a_now[None] * distance)
                    lost += half * (energy - self.shift_now[None])
        return lost

    @ti.func
    def spring_below(self, state: ti.template(), i, guess, move):
        """Number of the wall spring below or nearest to point i, `move` times the velocity ago."""
        k = guess
        x = self.position_before(state, i, move)[0]
        while k > 0 and x < self.position_before(state, self.wall_surface[k], move)[0]:
            k -= 1
        while k < self.count[1] - 2 and x >= self.position_before(state, self.wall_surface[k + 1], move)[0]:
            k += 1
        return k

    @ti.func
    def over(self, state: ti.template(), i, k, move):
        """Distance and lever of point i over wall spring k, and the spring's normal, `move` times the velocity ago."""
        start = self.position_before(state, self.wall_surface[k], move)
        along = self.position_before(state, self.wall_surface[k + 1], move) - start
        away = self.position_before(state, i, move) - start
        length2 = along.dot(along)
        normal = ti.Vector([-along[1], along[0]]) / ti.sqrt(length2)
        return away.dot(normal), away.dot(along) / length2, normal

    @ti.func
    def position_before(self, state: ti.template(), i, move):
        """Where point i was `move` times the velocity ago."""
        return get(state.x, i) - move * get(state.v, i)

    # ---- in NumPy

    def contacts(self, lattice: Lattice, x: Array) -> Contacts:
        """All contacts with the points at `x` (n, 2) [R]."""
        px, chain = x[lattice.disk_surface, 0][:, None], x[lattice.wall_surface]
        over = (chain[:-1, 0] <= px) & (px < chain[1:, 0])
        rows = np.flatnonzero(over.any(axis=1))
        points, springs = lattice.disk_surface[rows].astype(np.intp), over[rows].argmax(axis=1)
        away, t = x[points] - chain[springs], chain[springs + 1] - chain[springs]
        length2 = (t * t).sum(axis=1)
        normal = np.stack([-t[:, 1], t[:, 0]], axis=1) / np.sqrt(length2)[:, None]
        distance, lever = (away * normal).sum(axis=1), (away * t).sum(axis=1) / length2
        shares = np.stack([1.0 - lever, lever], axis=1)
        return self._contacts(points, springs[:, None] + np.arange(2), shares, distance, normal)

    def _contacts(
        self, points: NDArray[np.intp], carriers: NDArray[np.intp], shares: Array, distance: Array, direction: Array
    ) -> Contacts:
        """Those within the threshold, each pushed along its `direction` (k, 2)."""
        with np.errstate(over="ignore", invalid="ignore"):  # after a blow-up
            energy, force = self.potential(distance), self.force_at(distance)[:, None] * direction
        near = distance < self.threshold
        return Contacts(points[near], carriers[near], shares[near], energy[near], force[near])

    def energy(self, lattice: Lattice, x: Array) -> float:
        return float((self.contacts(lattice, x).energy - self.shift).sum())

    def forces(self, lattice: Lattice, x: Array) -> Array:
        found, force = self.contacts(lattice, x), np.zeros_like(x)
        np.add.at(force, found.points, found.force)
        for carrier, share in zip(found.carriers.T, found.shares.T, strict=True):
            np.add.at(force, lattice.wall_surface[carrier], -share[:, None] * found.force)
        return force

    def contact_forces(self, lattice: Lattice, x: Array, *moving: Any) -> tuple[NDArray[np.intp], Array]:
        found = self.contacts(lattice, x)
        return found.points, found.force
