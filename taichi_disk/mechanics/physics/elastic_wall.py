"""Contact with the elastic wall (paper section 5): a V0 exp(-a l) from the wall's
surface spring below a point.

The distance l is measured along the spring's normal n. The ends of the spring take the
reaction by the lever rule. This balances force and torque, and while the point stays
above one spring the force is the gradient of V0 exp(-a l). The potential is shifted to
be zero at the threshold, so that it does not jump when a contact begins.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics.law import Capacity, Contents, Wall, array, get, put
from taichi_disk.mechanics.physics.ordering import Arrangement
from taichi_disk.mechanics.potential import ExponentialPotential


@dataclass(frozen=True)
class Contacts:
    """Surface points of the disk within the threshold of the wall, in NumPy."""

    points: NDArray[np.intp]  # (k,) indices of the points in the lattice
    # (k, w) indices in `wall_surface` of the points that take the reaction
    carriers: NDArray[np.intp]
    shares: Array  # (k, w) fraction of the reaction on each of them
    energy: Array  # (k,) V0 exp(-a l), not shifted [M c^2]
    force: Array  # (k, 2) force on each point [M c^2/R]


@ti.data_oriented
@dataclass(eq=False)
class ElasticWall(ExponentialPotential, Wall):
    """The contact law between the disk's surface points and the surface springs of the
    wall, a lattice whose points follow those of the disk."""

    a: float  # hardness [1/R]
    V0: float  # potential at distance 0 [M c^2]
    threshold: float  # distance beyond which there is no contact [R]
    has_jumps = True
    scalars = ("a", "V0", "threshold", "shift")
    carriers = 2  # points of the wall that take the reaction of a contact
    # largest ratio of the height above the wall's highest point to l, for slopes up to
    # 60 degrees
    steepness = 2.0

    @property
    def shift(self) -> float:
        """Value of V0 exp(-a l) at the threshold, which is subtracted from the
        potential [M c^2]."""
        return float(self.potential(self.threshold))

    def added_stiffness(self, force: float) -> float:
        """Return 2 a F [M c^2/R^2]: twice that of the rigid wall, because two points of
        equal mass meet."""
        return 2.0 * super().added_stiffness(force)

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        super().make_fields(builder, capacity)
        self.disk_surface, self.wall_surface = (
            array(builder, capacity.points) for _ in range(2)
        )
        self.count = array(builder, 2)

    def contents(self, lattice: Lattice, arrangement: Arrangement) -> Contents:
        disk = lattice.disk_surface
        wall = lattice.wall_surface
        return [
            ((self.disk_surface,), disk),
            ((self.wall_surface,), wall),
            ((self.count,), [len(disk), len(wall)]),
        ]

    @ti.func
    def add(self, state: ti.template(), move):
        """Push every surface point of the disk away from the wall below it.

        Returns the upward force on the disk [M c^2/R], the potential [M c^2], the
        largest force on one point, and the energy lost by sliding in the last move,
        which was `move` times the velocity (see `sliding_loss`).
        """
        a = self.a_now[None]
        V0 = self.V0_now[None]
        threshold = self.threshold_now[None]
        x, y = ti.static(state.x[0], state.x[1])
        upward = 0.0
        potential = 0.0
        peak_point_force = 0.0
        sliding = 0.0
        last = self.count[1] - 1
        top = self.top(state)
        left = x[self.wall_surface[0]]
        pitch = (x[self.wall_surface[last]] - left) / last
        for n in range(self.count[0]):
            i = self.disk_surface[n]
            if y[i] - top < self.steepness * threshold:
                guess = ti.cast((x[i] - left) / pitch, ti.i32)
                guess = ti.max(0, ti.min(last - 1, guess))
                k = self.spring_below(state, i, guess, 0.0)
                distance, direction, first, shares = self.contact(state, i, k)
                if distance < threshold:
                    energy = V0 * ti.exp(-a * distance)
                    point_force = (a * energy) * direction
                    put(state.f, i, get(state.f, i) + point_force)
                    for c in ti.static(range(self.carriers)):
                        carrier = self.wall_surface[first + c]
                        reaction = shares[c] * point_force
                        put(state.f, carrier, get(state.f, carrier) - reaction)
                    upward += point_force[1]
                    potential += energy - self.shift_now[None]
                    size = a * energy
                    if ti.static(self.has_jumps):
                        sliding += self.sliding_loss(state, i, k, move)
                    else:
                        size = point_force.norm()
                    peak_point_force = ti.max(peak_point_force, size)
        return upward, potential, peak_point_force, sliding

    @ti.func
    def contact(self, state: ti.template(), i, k):
        """Return the contact of point i with the wall near spring k.

        The values are the distance (the threshold if there is no wall below the point),
        the direction of the force, the index in `wall_surface` of the first point that
        takes the reaction, and the fractions of all such points.
        """
        distance = self.threshold_now[None]
        normal = ti.Vector([0.0, 0.0])
        lever = 0.0
        x = state.x[0][i]
        p = self.wall_surface[k]
        q = self.wall_surface[k + 1]
        if x >= state.x[0][p] and x < state.x[0][q]:
            distance, lever, normal = self.position_above(state, i, k, 0.0)
        return distance, normal, k, ti.Vector([1.0 - lever, lever])

    @ti.func
    def depth(self, state: ti.template()):
        """Return the largest depth of a point of the disk below the wall's surface [R],
        0 if none is there. The contact itself looks only for the spring below a point.
        """
        x, y = ti.static(state.x[0], state.x[1])
        top = self.top(state)
        deepest = 0.0
        for i in range(state.n_disk[None]):
            if y[i] < top:
                # A ray upwards from a point below the surface crosses it an odd number
                # of times, however the surface is folded.
                crossings = 0
                nearest = ti.math.inf
                for k in range(self.count[1] - 1):
                    p = self.wall_surface[k]
                    q = self.wall_surface[k + 1]
                    if (x[p] <= x[i]) != (x[q] <= x[i]):
                        fraction = (x[i] - x[p]) / (x[q] - x[p])
                        height = y[p] + fraction * (y[q] - y[p]) - y[i]
                        if height > 0.0:
                            crossings += 1
                            nearest = ti.min(nearest, height)
                if crossings % 2 == 1:
                    deepest = ti.max(deepest, nearest)
        return deepest

    @ti.func
    def top(self, state: ti.template()):
        """Return the height of the highest point of the wall's surface [R]."""
        y = ti.static(state.x[1])
        top = y[self.wall_surface[0]]
        for k in range(1, self.count[1]):
            top = ti.max(top, y[self.wall_surface[k]])
        return top

    @ti.func
    def sliding_loss(self, state: ti.template(), i, k, move):
        """Return the energy that point i lost in the last move by passing from another
        wall spring to spring k [M c^2]."""
        # On a bent surface the distance l, and with it the potential, jumps when a
        # point passes from one spring to the next. By the trapezoidal rule, half of the
        # jump at each end of the move counts.
        previous = self.spring_below(state, i, k, move)
        lost = 0.0
        if previous != k:
            # loops, because four inlined calls take long to compile
            spring = previous
            weight = 0.5
            for _ in range(2):
                for end in range(2):
                    distance, _lever, _normal = self.position_above(
                        state, i, spring, end * move
                    )
                    if distance < self.threshold_now[None]:
                        energy = self.V0_now[None] * ti.exp(
                            -self.a_now[None] * distance
                        )
                        lost += weight * (energy - self.shift_now[None])
                spring = k
                weight = -0.5
        return lost

    @ti.func
    def spring_below(self, state: ti.template(), i, guess, move):
        """Return the wall spring below or nearest to point i, `move` [R/c] ago."""
        k = guess
        x = self.position_before(state, i, move)[0]
        while k > 0 and x < self.position_before(state, self.wall_surface[k], move)[0]:
            k -= 1
        while (
            k < self.count[1] - 2
            and x >= self.position_before(state, self.wall_surface[k + 1], move)[0]
        ):
            k += 1
        return k

    @ti.func
    def position_above(self, state: ti.template(), i, k, move):
        """Return distance [R], lever and normal of point i above wall spring k, `move`
        [R/c] ago."""
        start = self.position_before(state, self.wall_surface[k], move)
        along = self.position_before(state, self.wall_surface[k + 1], move) - start
        away = self.position_before(state, i, move) - start
        length2 = along.dot(along)
        normal = ti.Vector([-along[1], along[0]]) / ti.sqrt(length2)
        return away.dot(normal), away.dot(along) / length2, normal

    @ti.func
    def position_before(self, state: ti.template(), i, move):
        """Return the position of point i if it has moved for the time `move` [R/c] at
        its present velocity."""
        return get(state.x, i) - move * get(state.v, i)

    # ---- in NumPy

    def contacts(self, lattice: Lattice, x: Array) -> Contacts:
        chain = x[lattice.wall_surface]
        start, end = self.pieces(chain)
        rim_x = x[lattice.disk_surface, 0][:, None]
        # (points of the disk's surface, pieces of the wall's)
        is_above = (start[:, 0] <= rim_x) & (rim_x < end[:, 0])
        rows = np.flatnonzero(is_above.any(axis=1))
        points = lattice.disk_surface[rows].astype(np.intp)
        first_carrier = is_above[rows].argmax(axis=1)
        carriers = first_carrier[:, None] + np.arange(self.carriers)
        distance, direction, shares = self.geometry(x[points], chain[carriers])
        is_near = distance < self.threshold
        distance = distance[is_near]
        with np.errstate(over="ignore", invalid="ignore"):  # values after a blow-up
            return Contacts(
                points=points[is_near],
                carriers=carriers[is_near],
                shares=shares[is_near],
                energy=self.potential(distance),
                force=self.force_at(distance)[:, None] * direction[is_near],
            )

    def pieces(self, chain: Array) -> tuple[Array, Array]:
        """Return start and end (m, 2) of the pieces of the surface with the points
        `chain` (n, 2)."""
        return chain[:-1], chain[1:]

    def geometry(self, x: Array, ends: Array) -> tuple[Array, Array, Array]:
        """Return distances (k,), directions (k, 2) and fractions (k, w) as `contact`
        does.

        `x` (k, 2) are points of the disk, `ends` (k, w, 2) the wall's points that take
        the reactions.
        """
        start, end = ends.swapaxes(0, 1)
        away = x - start
        along = end - start
        length2 = (along * along).sum(axis=1)
        across = along[:, ::-1] * [-1.0, 1.0]
        normal = across / np.sqrt(length2)[:, None]
        distance = (away * normal).sum(axis=1)
        lever = (away * along).sum(axis=1) / length2
        return distance, normal, np.stack([1.0 - lever, lever], axis=1)

    def energy(self, lattice: Lattice, x: Array) -> float:
        return float((self.contacts(lattice, x).energy - self.shift).sum())

    def forces(self, lattice: Lattice, x: Array) -> Array:
        contacts = self.contacts(lattice, x)
        force = np.zeros_like(x)
        np.add.at(force, contacts.points, contacts.force)
        for carrier, share in zip(contacts.carriers.T, contacts.shares.T, strict=True):
            reaction = -share[:, None] * contacts.force
            np.add.at(force, lattice.wall_surface[carrier], reaction)
        return force

    def contact_forces(
        self, lattice: Lattice, x: Array, *moving: Any
    ) -> tuple[NDArray[np.intp], Array]:
        contacts = self.contacts(lattice, x)
        return contacts.points, contacts.force
