"""The triangles of a lattice, and the stress in them that the springs' forces amount to.

It is the virial stress (Irving and Kirkwood 1950; Born and Huang 1954). A spring of tension T along r = r_j - r_i
transmits T r between its ends. The triangles beside it share that equally, so that a triangle of area A has the
symmetric stress

    sigma = 1/A * sum over its sides of share * T/|r| * r r^T        [M c^2/R^2: force per length in two dimensions]

with share 1/2 for an inner spring and 1 for one on the outline. A spring of one's own that is no triangle's side counts
half for the triangles around either of its ends, in equal parts. A and r are those of the deformed state (Cauchy
stress). The integral of sigma over the area is then exactly the virial of the springs, sum of T/|r| r r^T, which
equals -sum of x_i f_i^T for the springs' forces f_i on the points at x_i. Dashpots are left out: their force is not
along r, and what light sees in a loaded plate is its strain.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.sparse import csr_array

from taichi_disk.lattice import Array, Lattice
from taichi_disk.lattice.lattice import pair_keys

if TYPE_CHECKING:
    from taichi_disk.physics.springs import Springs


# Of its unloaded area: a triangle that a violent hit has folded is not taken for smaller, so that stress stays finite.
LEAST_AREA = 0.1
SMOOTHING, PASSES = 0.06, 12  # [R]


class Triangles:
    """The triangles of a lattice and their sides.

    Attributes:
        triangles: (t, 3) int32, points, counter-clockwise in the unloaded lattice.
        sides: (t, 3) springs; side k joins corners k and k + 1.
        share: (m,) of each spring's force that one triangle beside it carries: 1/2 between two triangles, 1 on an
            outline; 0 where there is none.
        outline: (k, 2) int32, the sides that belong to one triangle, with that triangle on their left.
    """

    def __init__(self, lattice: Lattice) -> None:
        self.lattice = lattice
        self.triangles = np.ascontiguousarray(lattice.triangles, dtype=np.int32).reshape(-1, 3)
        n, m, t = len(lattice.positions), len(lattice.bonds), len(self.triangles)
        ends = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
        self.sides = np.searchsorted(pair_keys(lattice.bonds, n), pair_keys(ends, n)).reshape(-1, 3)  # bonds are sorted
        count = np.bincount(self.sides.ravel(), minlength=m)
        self.share = np.where(count > 0, 1.0 / np.maximum(count, 1), 0.0)
        self.outline = ends[count[self.sides.ravel()] == 1]
        self._least_area = LEAST_AREA * np.abs(self._signed_areas(lattice.positions))
        # Sums over what each triangle carries, over the triangles around each point, over a point and its neighbours.
        owner, ones = np.repeat(np.arange(t), 3), np.ones(3 * t)
        self._carried = csr_array((self.share[self.sides.ravel()], (owner, self.sides.ravel())), (t, m))
        self._around = csr_array((ones, (self.triangles.ravel(), owner)), (n, t))
        if len(across := np.flatnonzero(count == 0)):
            point = lattice.bonds[across].ravel()
            part = 0.5 / self._around.sum(axis=1)[point]
            ends = csr_array((part, (point, np.repeat(across, 2))), (n, m))
            self._carried = csr_array(self._carried + self._around.T @ ends)
        own, (i, j) = np.arange(n), lattice.bonds.T
        pairs = np.concatenate([own, i, j]), np.concatenate([own, j, i])
        self._neighbours = csr_array((np.ones(n + 2 * m), pairs), (n, n))

    def _signed_areas(self, x: Array) -> Array:
        u, w = self._edges(x)
        return np.asarray(0.5 * (u[0] * w[1] - u[1] * w[0]))

    def _edges(self, x: Array) -> tuple[Array, Array]:
        """(2, t) from the first corner to the second, and to the third."""
        a, b, c = self.triangles.T
        return np.stack([y[b] - y[a] for y in x.T]), np.stack([y[c] - y[a] for y in x.T])

    def areas(self, x: Array) -> Array:
        """(t,) [R^2] with the points at `x` (n, 2) [R], at least LEAST_AREA of the unloaded ones."""
        return np.asarray(np.maximum(self._signed_areas(x), self._least_area))

    def growth(self, x: Array, v: Array) -> Array:
        """(t,) rate of change of the areas [R c] at velocities `v` (n, 2) [c]: div v times the area."""
        (u, w), (du, dw) = self._edges(x), self._edges(v)
        return np.asarray(0.5 * (du[0] * w[1] - du[1] * w[0] + u[0] * dw[1] - u[1] * dw[0]))

    def carried(self, values: Array) -> Array:
        """(t, k) what each triangle carries of `values` (m, k) of the springs."""
        return np.asarray(self._carried @ values)

    def point_means(self, integrals: Array, areas: Array) -> Array:
        """(n, ...) means over the triangles around each point, from `integrals` (t, ...) over each and `areas` (t,)."""
        sums: Any = self._around @ integrals
        return np.asarray((sums.T / np.maximum(self._around @ areas, 1e-300)).T)

    def smoothed(self, values: Array, passes: int) -> Array:
        """(n, k) point values, each replaced `passes` times by the mean of itself and its neighbours."""
        share = 1.0 / self._neighbours.sum(axis=1)[:, None]
        for _ in range(passes):
            values = share * (self._neighbours @ values)
        return values


def _virial(tiles: Triangles, springs: Springs, x: Array) -> Array:
    """(t, 3) stress times area."""
    rx, ry = apart = springs.ends_apart(tiles.lattice, x)
    length = springs.lengths(apart)
    pull = springs.pull(length - tiles.lattice.rest_lengths) / length
    return tiles.carried(np.stack([pull * rx * rx, pull * ry * ry, pull * rx * ry], axis=1))


def stress(tiles: Triangles, springs: Springs, x: Array) -> Array:
    """(t, 3) xx, yy and xy of each triangle [M c^2/R^2], positive under tension, with the points at `x` (n, 2) [R]."""
    return _virial(tiles, springs, x) / tiles.areas(x)[:, None]


def point_stress(tiles: Triangles, springs: Springs, x: Array) -> Array:
    """(n, 3) like `stress`, at the points: the mean over the triangles around each, weighted with their areas."""
    return tiles.point_means(_virial(tiles, springs, x), tiles.areas(x))


def smooth_stress(tiles: Triangles, springs: Springs, x: Array) -> Array:
    """(n, 3) `point_stress`, averaged over neighbours to a standard deviation of SMOOTHING: what fringes show.

    The stress of a random lattice scatters from point to point by more than one fringe is worth. Each average over six
    neighbours adds the variance 3/7 of the spacing's square along x and y; there are PASSES of them at most.
    """
    spacing = float(np.median(tiles.lattice.rest_lengths))
    passes = int(np.clip(round(SMOOTHING**2 / (3.0 / 7.0 * spacing**2)), 1, PASSES))
    return tiles.smoothed(point_stress(tiles, springs, x), passes)


def pressure(sigma: Array) -> Array:
    """Minus half the trace of stresses (..., 3) [M c^2/R^2]: positive where the material is compressed."""
    return np.asarray(-0.5 * (sigma[..., 0] + sigma[..., 1]))


def shear(sigma: Array) -> Array:
    """The largest shear stress, half the difference of the principal stresses of (..., 3) [M c^2/R^2]."""
    return np.hypot(0.5 * (sigma[..., 0] - sigma[..., 1]), sigma[..., 2])
