"""Quantities that pictures show: stress, rates, strains and energies, as NumPy arrays.

The stress is the virial stress of the springs (Irving and Kirkwood 1950; Born and Huang
1954). The force T of a spring along r = r_j - r_i is divided equally among its adjacent
triangles, so that a triangle of area A has the stress

    sigma = 1/A * sum over its sides of fraction * T/|r| * r r^T    [M c^2/R^2: force
    per length in two dimensions]

with the fraction 1/2 for inner springs and 1 for springs on the outline. For a spring
that is no side of a triangle, half of the force is divided equally among the triangles
around each end. A and r belong to the deformed state (Cauchy stress). The integral of
sigma over the area equals the virial of the springs, sum of T/|r| r r^T = -sum of x_i
f_i^T for forces f_i on points x_i. Dashpots do not contribute, because their force is
not along r and photoelasticity shows strain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.triangles import (
    Indices,
    double_area,
    norms,
    pair_keys,
)

if TYPE_CHECKING:
    from taichi_disk.mechanics.physics.springs import Springs

Support = Literal["triangles", "springs", "points"]

# smallest area over unloaded area; keeps the stress of folded triangles finite in a
# violent impact
MIN_AREA = 0.1
# standard deviation of the smoothing of stress [R]; largest number of averages
SMOOTHING = 0.06
MAX_PASSES = 12
# smaller stresses are rounding errors and show no fringes [M c^2/R^2]
STRESS_ROUNDING = 1e-13
MAX_MATERIALS = 8  # with more different stiffnesses, no interfaces are drawn
FRINGES = 5  # number of fringes in a picture if the scene gives no fringe constant


@dataclass(frozen=True)
class Field:
    """Values (k,) of a quantity, in `unit`, for each triangle, spring or point of a
    lattice."""

    values: Array
    on: Support
    unit: str


@dataclass(frozen=True)
class Quantity:
    """A quantity's label, whether it has a sign, the labels of its low and high values.

    `full`: approximate value of full colour of an impact, for each c of its speed.
    `power`: of a vibration's amplitude with which it grows.
    """

    label: str
    unit: str
    on: Support
    signed: bool
    full: float
    low: str = ""
    high: str = ""
    power: int = 1


# Full colours were measured in the shipped impacts at 0.02 to 0.1 c with the largest
# 98th percentile of each quantity; it was within a factor of 1.5 of the estimate,
# except for the speed of a disk that spins.
QUANTITIES = {
    "pressure": Quantity(
        "pressure", "Mc²/R²", "triangles", True, 0.9, "stretched", "compressed"
    ),
    "shear": Quantity("shear stress", "Mc²/R²", "triangles", False, 0.66),
    "fringes": Quantity(
        "photoelastic fringes, order", "", "points", False, 1.2 / FRINGES
    ),
    "rate": Quantity(
        "rate of compression", "c/R", "triangles", True, 0.7, "expanding", "contracting"
    ),
    "strain": Quantity(
        "strain of the springs", "", "springs", True, 0.45, "compressed", "stretched"
    ),
    "force": Quantity(
        "force of the springs", "Mc²/R", "springs", True, 0.026, "push", "pull"
    ),
    # in the frame of the disk's centre of mass
    "speed": Quantity("inner speed", "c", "points", False, 0.4),
    "kinetic": Quantity("inner kinetic energy", "Mc²", "points", False, 0.4, power=2),
}


def field(
    name: str, lattice: Lattice, springs: Springs, x: Array, v: Array, at: str = "own"
) -> Field:
    """Compute the quantity `name` of QUANTITIES for points at `x` (n, 2) [R] with
    velocities `v` (n, 2) [c].

    `springs` are the laws of the springs of `lattice`; `at`: "own", or "points" for
    values as in pictures: `at_points`.

    - pressure, shear: from the `stress` of each triangle; pressure is positive under
        compression.
    - fringes: brightness from 0 to 1 at the points, see `fringes` and `smooth_stress`.
    - rate: -div v of each triangle, positive under compression.
    - strain, force: of each spring, positive if stretched.
    - speed, kinetic: of each point; for the disk, relative to its centre of mass.
    """
    kind = QUANTITIES[name]
    place: Support = "points"
    compute = at_points
    if at == "own":
        place = kind.on
        compute = own_values
    values = compute(name, Triangles(lattice), springs, x, v)
    if name == "fringes":
        values = fringes(values)
    return Field(values, place, kind.unit)


def own_values(
    name: str, triangles: Triangles, springs: Springs, x: Array, v: Array
) -> Array:
    """Return the quantity `name` on the triangles, springs or points to which it
    belongs; of fringes twice shear."""
    lattice = triangles.lattice
    if name in OF_STRESS:
        return OF_STRESS[name](stress(triangles, springs, x))
    if name == "fringes":
        return 2.0 * shear(smooth_stress(triangles, springs, x))
    if name == "rate":
        return -triangles.area_rates(x, v) / triangles.areas(x)
    if name == "strain":
        return springs.strain(lattice, x)
    if name == "force":
        return springs.tension(lattice, x)
    relative = v.copy()
    relative[: lattice.disk_points] -= lattice.mean(v)
    speed = np.hypot(*relative.T)
    if name == "speed":
        return speed
    return 0.5 * lattice.masses * speed**2


def at_points(
    name: str, triangles: Triangles, springs: Springs, x: Array, v: Array
) -> Array:
    """Return the quantity `name` averaged to the points (n,); pictures interpolate
    between these values.

    Triangles around a point are weighted with their areas, springs at a point equally.
    Shear is computed from the averaged stress.
    """
    if name in OF_STRESS:
        return OF_STRESS[name](point_stress(triangles, springs, x))
    if name == "rate":
        rates = triangles.around @ triangles.area_rates(x, v)
        return -rates / (triangles.around @ triangles.areas(x))
    values = own_values(name, triangles, springs, x, v)
    if QUANTITIES[name].on == "springs":
        ends = triangles.lattice.bonds.ravel()
        return np.bincount(ends, np.repeat(values, 2)) / np.bincount(ends)
    return values


def fringes(difference: Array) -> Array:
    """Return the brightness sin^2(pi difference/fringe) in a dark-field circular
    polariscope.

    `difference` [M c^2/R^2]: of the principal stresses, twice the shear. The fringe is
    such that there are FRINGES in all.
    """
    fringe = 1.0
    maximum = difference.max(initial=0.0)
    if maximum > STRESS_ROUNDING:
        fringe = maximum / FRINGES
    return np.sin(np.pi * difference / fringe) ** 2


# ---- stress


class Triangles:
    """The triangles of a lattice and their sides.

    Attributes:
        triangles: (t, 3) int32 points, counter-clockwise in the unloaded lattice.
        fraction: (m,) of each spring's force carried by one adjacent triangle: 1/2
            between two triangles, 1 on an outline, 0 without a triangle.
        outline: (k, 2) int32 sides of only one triangle, which lies on their left.
        crossing: (k, 2) int32 springs that are no side of a triangle.
        interfaces: (k, 2) int32 sides between materials of different stiffness; empty
            beyond MAX_MATERIALS.
        carried: sparse matrix (t, m) that sums what springs carry over a triangle.
        around: sparse matrix (n, t) that sums over the triangles around a point.
    """

    def __init__(self, lattice: Lattice) -> None:
        self.lattice = lattice
        self.triangles = lattice.triangles
        self._corners = np.ascontiguousarray(self.triangles.T, np.intp)
        n = len(lattice.positions)
        m = len(lattice.bonds)
        t = len(self.triangles)
        next_corners = np.roll(self.triangles, -1, axis=1)
        sides = np.stack([self.triangles, next_corners], axis=-1).reshape(-1, 2)
        # the spring of each side, found so because bonds are sorted
        spring = np.searchsorted(pair_keys(lattice.bonds, n), pair_keys(sides, n))
        count = np.bincount(spring, minlength=m)
        self.fraction = np.where(count > 0, 1.0 / np.maximum(count, 1), 0.0)
        self.outline = sides[count[spring] == 1]
        self.crossing = lattice.bonds[count == 0]
        self.interfaces = self._interfaces(spring)
        area = np.abs(double_area(lattice.positions[self.triangles]))
        self._min_area = 0.5 * MIN_AREA * area
        # not imported where pictures are only finished
        from scipy.sparse import csr_array, identity

        # Three matrices for sums: `carried` over the springs of a triangle, `around`
        # over the triangles around a point, `_neighbours` over a point and its
        # neighbours.
        owner = np.repeat(np.arange(t), 3)  # the triangle of each side
        ones = np.ones(3 * t)
        self.around = csr_array((ones, (self.triangles.ravel(), owner)), (n, t))
        self.carried = csr_array((self.fraction[spring], (owner, spring)), (t, m))
        if len(self.crossing):
            point = self.crossing.ravel()
            column = np.repeat(np.flatnonzero(count == 0), 2)
            fraction = 0.5 / self.around.sum(axis=1)[point]
            at_ends = csr_array((fraction, (point, column)), (n, m))
            self.carried = csr_array(self.carried + self.around.T @ at_ends)
        pairs = csr_array((np.ones(m), lattice.bonds.T), (n, n))
        self._neighbours = csr_array(pairs + pairs.T + identity(n))

    def _interfaces(self, spring: NDArray[np.intp]) -> Indices:
        """Return the sides whose two triangles differ in stiffness. `spring` (3t,): the
        spring of each side of each triangle."""
        lattice = self.lattice
        if lattice.stiffness is None:
            return lattice.bonds[:0]
        of_triangle = np.median(lattice.stiffness[spring].reshape(-1, 3), axis=1)
        if len(np.unique(of_triangle)) > MAX_MATERIALS:
            return lattice.bonds[:0]
        at_side = np.repeat(of_triangle, 3)
        mean = self.fraction * np.bincount(spring, at_side, len(lattice.bonds))
        differs = np.unique(spring[at_side != mean[spring]])
        return lattice.bonds[differs]

    def _edges(self, x: Array) -> tuple[Array, Array]:
        """Return the vectors (2, t) from the first corner to the two others."""
        # Gathering columns is several times faster than gathering pairs.
        columns = np.ascontiguousarray(x.T)
        a, b, c = (columns.take(corner, axis=1) for corner in self._corners)
        return b - a, c - a

    def areas(self, x: Array) -> Array:
        """Return the areas (t,) [R^2] of the triangles if the points are at `x` (n, 2)
        [R].

        An area below MIN_AREA times the unloaded area, or a negative one, is replaced
        by this bound.
        """
        u, w = self._edges(x)
        area = 0.5 * (u[0] * w[1] - u[1] * w[0])
        return np.maximum(area, self._min_area)

    def area_rates(self, x: Array, v: Array) -> Array:
        """Return the rates of change (t,) of the areas [R c] at velocities `v` (n, 2)
        [c]: div v times the area."""
        u, w = self._edges(x)
        du, dw = self._edges(v)
        double_rate = du[0] * w[1] - du[1] * w[0] + u[0] * dw[1] - u[1] * dw[0]
        return 0.5 * double_rate

    def virials(self, springs: Springs, x: Array) -> Array:
        """Return T/|r| r r^T of each spring: xx, yy and xy (m, 3) [M c^2]."""
        vectors = self.lattice.spring_vectors(x)
        length = norms(vectors)
        pull = springs.pull(self.lattice, length - self.lattice.rest_lengths) / length
        rx, ry = vectors
        pull_x, pull_y = pull * vectors
        virials = np.empty((len(pull), 3))
        virials[:, 0] = pull_x * rx
        virials[:, 1] = pull_y * ry
        virials[:, 2] = pull_x * ry
        return virials

    def smoothed(self, values: Array, passes: int) -> Array:
        """Replace point values (n, k) by the mean of the point and its neighbours,
        `passes` times."""
        weight = 1.0 / self._neighbours.sum(axis=1)[:, None]
        for _ in range(passes):
            values = weight * (self._neighbours @ values)
        return values


def stress(triangles: Triangles, springs: Springs, x: Array) -> Array:
    """Return the stress of each triangle: xx, yy and xy (t, 3) [M c^2/R^2], positive
    under tension; `x` (n, 2) [R]."""
    integrals = triangles.carried @ triangles.virials(springs, x)
    return integrals / triangles.areas(x)[:, None]


def point_stress(triangles: Triangles, springs: Springs, x: Array) -> Array:
    """Return the stress at the points (n, 3): the area-weighted mean over the triangles
    around each."""
    integrals = triangles.carried @ triangles.virials(springs, x)
    areas = triangles.around @ triangles.areas(x)
    return triangles.around @ integrals / areas[:, None]


def smooth_stress(triangles: Triangles, springs: Springs, x: Array) -> Array:
    """Return `point_stress` (n, 3) smoothed with the standard deviation SMOOTHING, for
    fringes."""
    # Without smoothing, the scatter between points of a random lattice exceeds one
    # fringe. Each average over six neighbours adds 3/7 of the squared spacing to the
    # variance along x and y.
    spacing = np.median(triangles.lattice.rest_lengths)
    averages = round(SMOOTHING**2 / (3.0 / 7.0 * spacing**2))
    passes = min(max(averages, 1), MAX_PASSES)
    return triangles.smoothed(point_stress(triangles, springs, x), passes)


def pressure(sigma: Array) -> Array:
    """Return minus half the trace of stresses (..., 3) [M c^2/R^2], which is positive
    under compression."""
    return -0.5 * (sigma[..., 0] + sigma[..., 1])


def shear(sigma: Array) -> Array:
    """Return the maximum shear stress, half the difference of the principal stresses,
    of (..., 3) [M c^2/R^2]."""
    return np.hypot(0.5 * (sigma[..., 0] - sigma[..., 1]), sigma[..., 2])


OF_STRESS = {"pressure": pressure, "shear": shear}
