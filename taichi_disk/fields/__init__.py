"""What a state means to an eye: stress, rates, strains and energies. NumPy in, NumPy out.

The stress is the virial stress of the springs (Irving and Kirkwood 1950; Born and Huang 1954). A spring of tension T
along r = r_j - r_i transmits T r between its ends. The triangles beside it carry that in equal parts, so that a
triangle of area A has the symmetric stress

    sigma = 1/A * sum over its sides of part * T/|r| * r r^T        [M c^2/R^2: force per length in two dimensions]

with part 1/2 for an inner spring and 1 for one on the outline. A spring of one's own that is no triangle's side counts
half for the triangles around either of its ends, in equal parts. A and r are those of the deformed state (Cauchy
stress). The integral of sigma over the area is then exactly the virial of the springs, sum of T/|r| r r^T, which
equals -sum of x_i f_i^T for the springs' forces f_i on the points at x_i. Dashpots are left out: their force is not
along r, and what light sees in a loaded plate is its strain.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from scipy.sparse import csr_array

from taichi_disk.lattice import Array, Lattice
from taichi_disk.lattice.lattice import double_area, pair_keys

if TYPE_CHECKING:
    from taichi_disk.physics.springs import Springs

Support = Literal["triangles", "springs", "points"]

# Of its unloaded area: a triangle that a violent hit has folded is not taken for smaller, so that stress stays finite.
LEAST_AREA = 0.1
SMOOTHING, PASSES = 0.06, 12  # [R]
ROUNDING = 1e-13  # of stresses [M c^2/R^2], which makes no fringes
KINDS = 8  # of springs, up to which a line is drawn between them
FRINGES = 5  # in a picture whose fringe constant nobody gave


@dataclass(frozen=True)
class Field:
    """Values (k,) of a quantity in `unit`, one for each of the lattice's triangles, springs or points."""

    values: Array
    on: Support
    unit: str


@dataclass(frozen=True)
class Quantity:
    """What is said about a quantity: its label, the meaning of a low and of a high value, whether it has a sign."""

    label: str
    unit: str
    on: Support
    signed: bool
    low: str = ""
    high: str = ""


QUANTITIES: dict[str, Quantity] = {
    "pressure": Quantity("pressure", "Mc²/R²", "triangles", True, "stretched", "compressed"),
    "shear": Quantity("maximum shear stress", "Mc²/R²", "triangles", False),
    "fringes": Quantity("photoelastic fringes, order", "", "points", False),
    "rate": Quantity("rate of compression", "c/R", "triangles", True, "expanding", "contracting"),
    "strain": Quantity("strain of the springs", "", "springs", True, "compressed", "stretched"),
    "force": Quantity("force of the springs", "Mc²/R", "springs", True, "push", "pull"),
    "speed": Quantity("speed, centre-of-mass frame", "c", "points", False),
    "kinetic": Quantity("kinetic energy of a point, centre-of-mass frame", "Mc²", "points", False),
}


def field(name: str, lattice: Lattice, springs: Springs, x: Array, v: Array) -> Field:
    """The quantity `name` of QUANTITIES of `lattice` and its `springs`.

    The points are at `x` (n, 2) [R] and have the velocities `v` (n, 2) [c].

    - pressure, shear: of the stress of each triangle, see `stress`; pressure is positive under compression.
    - fringes: brightness from 0 to 1 at the points, see `fringes` and `smooth_stress`.
    - rate: -div v of each triangle: positive while it is being compressed.
    - strain, force: of each spring, positive where it is stretched.
    - speed, kinetic: of each point of the disk in the frame of the disk's centre of mass; of a wall, as it is.
    """
    values, kind = _values(name, Triangles(lattice), springs, x, v), QUANTITIES[name]
    return Field(fringes(0.5 * values) if name == "fringes" else values, kind.on, kind.unit)


def _values(name: str, triangles: Triangles, springs: Springs, x: Array, v: Array) -> Array:
    lattice = triangles.lattice
    if name == "pressure":
        return pressure(stress(triangles, springs, x))
    if name == "shear":
        return shear(stress(triangles, springs, x))
    if name == "fringes":
        return 2.0 * shear(smooth_stress(triangles, springs, x))
    if name == "rate":
        return -triangles.growth(x, v) / triangles.areas(x)
    if name == "strain":
        return springs.strain(lattice, x)
    if name == "force":
        return springs.tension(lattice, x)
    n, relative = lattice.disk_points, v.copy()
    relative[:n] -= lattice.masses[:n] @ v[:n] / lattice.masses[:n].sum()
    speed = np.hypot(relative[:, 0], relative[:, 1])
    return speed if name == "speed" else 0.5 * lattice.masses * speed**2


def at_points(name: str, triangles: Triangles, springs: Springs, x: Array, v: Array) -> Array:
    """(n,) what pictures show between the points: `field`, brought to the points.

    Of triangles the mean around each point, weighted with their areas (of the shear: that of the mean stress); of
    springs the mean over those that meet in a point. "fringes": twice the shear, the fringes' argument.
    """
    if name == "shear":
        return shear(point_stress(triangles, springs, x))
    values, on = _values(name, triangles, springs, x, v), QUANTITIES[name].on
    if on == "triangles":
        areas = triangles.areas(x)
        return triangles.point_means(areas * values, areas)
    if on == "springs":
        ends, n = triangles.lattice.bonds.ravel(), len(x)
        return np.bincount(ends, np.repeat(values, 2), n) / np.maximum(np.bincount(ends, minlength=n), 1)
    return values


def point_field(name: str, lattice: Lattice, springs: Springs, x: Array, v: Array) -> Field:
    """Return the quantity `name` at the points, as pictures show it, see `at_points`. Arguments as for `field`."""
    values, kind = at_points(name, Triangles(lattice), springs, x, v), QUANTITIES[name]
    return Field(fringes(0.5 * values) if name == "fringes" else values, "points", kind.unit)


def fringes(largest_shear: Array, fringe: float = 0.0) -> Array:
    """Brightness sin^2(pi * 2 shear/fringe) of largest shear stresses [M c^2/R^2]: a circular polariscope's dark field.

    `fringe`: stress difference from one fringe to the next; 0: the largest difference makes FRINGES.
    """
    most = float(largest_shear.max(initial=0.0))
    fringe = fringe or (2.0 * most / FRINGES if most > ROUNDING else 1.0)
    return np.asarray(np.sin(2.0 * np.pi * largest_shear / fringe) ** 2)


# ---- stress


class Triangles:
    """The triangles of a lattice and their sides.

    Attributes:
        triangles: (t, 3) int32, points, counter-clockwise in the unloaded lattice.
        part: (m,) of each spring's force that one triangle beside it carries: 1/2 between two triangles, 1 on an
            outline; 0 where there is none.
        outline: (k, 2) int32, the sides that belong to one triangle, with that triangle on their left.
        across: (k, 2) int32, the springs that are no triangle's side.
        interfaces: (k, 2) int32, the sides at which the springs' stiffness changes, where there are but a few kinds.
    """

    def __init__(self, lattice: Lattice) -> None:
        self.lattice = lattice
        self.triangles = np.ascontiguousarray(lattice.triangles, dtype=np.int32).reshape(-1, 3)
        n, m, t = len(lattice.positions), len(lattice.bonds), len(self.triangles)
        ends = np.stack([self.triangles, np.roll(self.triangles, -1, axis=1)], axis=-1).reshape(-1, 2)
        sides = np.searchsorted(pair_keys(lattice.bonds, n), pair_keys(ends, n))  # bonds are sorted
        count = np.bincount(sides, minlength=m)
        self.part = np.where(count > 0, 1.0 / np.maximum(count, 1), 0.0)
        self.outline, self.across = ends[count[sides] == 1], lattice.bonds[count == 0]
        self.interfaces = self.across[:0]
        if lattice.stiffness is not None:
            kind = np.median(lattice.stiffness[sides].reshape(-1, 3), axis=1)  # of a triangle: what two of three are
            least, most = np.full(m, np.inf), np.zeros(m)
            np.minimum.at(least, sides, np.repeat(kind, 3))
            np.maximum.at(most, sides, np.repeat(kind, 3))
            if len(np.unique(kind)) <= KINDS:
                self.interfaces = lattice.bonds[most > least]
        self._least_area = 0.5 * LEAST_AREA * np.abs(double_area(lattice.positions[self.triangles]))
        # Sums over what each triangle carries, over the triangles around each point, over a point and its neighbours.
        owner, ones = np.repeat(np.arange(t), 3), np.ones(3 * t)
        self._carried = csr_array((self.part[sides], (owner, sides)), (t, m))
        self._around = csr_array((ones, (self.triangles.ravel(), owner)), (n, t))
        if len(across := np.flatnonzero(count == 0)):
            point = lattice.bonds[across].ravel()
            part = 0.5 / self._around.sum(axis=1)[point]
            ends = csr_array((part, (point, np.repeat(across, 2))), (n, m))
            self._carried = csr_array(self._carried + self._around.T @ ends)
        own, (i, j) = np.arange(n), lattice.bonds.T
        pairs = np.concatenate([own, i, j]), np.concatenate([own, j, i])
        self._neighbours = csr_array((np.ones(n + 2 * m), pairs), (n, n))

    def _edges(self, x: Array) -> tuple[Array, Array]:
        """(2, t) from the first corner to the second, and to the third."""
        a, b, c = self.triangles.T
        return np.stack([y[b] - y[a] for y in x.T]), np.stack([y[c] - y[a] for y in x.T])

    def areas(self, x: Array) -> Array:
        """(t,) [R^2] with the points at `x` (n, 2) [R], at least LEAST_AREA of the unloaded ones."""
        return np.asarray(np.maximum(0.5 * double_area(x[self.triangles]), self._least_area))

    def growth(self, x: Array, v: Array) -> Array:
        """(t,) rate of change of the areas [R c] at velocities `v` (n, 2) [c]: div v times the area."""
        (u, w), (du, dw) = self._edges(x), self._edges(v)
        return np.asarray(0.5 * (du[0] * w[1] - du[1] * w[0] + u[0] * dw[1] - u[1] * dw[0]))

    def virial(self, springs: Springs, x: Array) -> Array:
        """(t, 3) xx, yy and xy of the stress times the area [M c^2]."""
        rx, ry = between = springs.ends_apart(self.lattice, x)
        length = springs.lengths(between)
        pull = springs.pull(self.lattice, length - self.lattice.rest_lengths) / length
        return np.asarray(self._carried @ np.stack([pull * rx * rx, pull * ry * ry, pull * rx * ry], axis=1))

    def point_means(self, integrals: Array, areas: Array) -> Array:
        """(n, ...) means over the triangles around each point, from `integrals` (t, ...) over each and `areas` (t,)."""
        sums: Any = self._around @ integrals
        return np.asarray((sums.T / np.maximum(self._around @ areas, 1e-300)).T)

    def smoothed(self, values: Array, passes: int) -> Array:
        """(n, k) point values, each replaced `passes` times by the mean of itself and its neighbours."""
        weight = 1.0 / self._neighbours.sum(axis=1)[:, None]
        for _ in range(passes):
            values = weight * (self._neighbours @ values)
        return values


def stress(triangles: Triangles, springs: Springs, x: Array) -> Array:
    """(t, 3) xx, yy and xy of each triangle [M c^2/R^2], positive under tension, with the points at `x` (n, 2) [R]."""
    return triangles.virial(springs, x) / triangles.areas(x)[:, None]


def point_stress(triangles: Triangles, springs: Springs, x: Array) -> Array:
    """(n, 3) like `stress`, at the points: the mean over the triangles around each, weighted with their areas."""
    return triangles.point_means(triangles.virial(springs, x), triangles.areas(x))


def smooth_stress(triangles: Triangles, springs: Springs, x: Array) -> Array:
    """(n, 3) `point_stress`, averaged over neighbours to a standard deviation of SMOOTHING: what fringes show.

    The stress of a random lattice scatters from point to point by more than one fringe is worth. Each average over six
    neighbours adds the variance 3/7 of the spacing's square along x and y; there are PASSES of them at most.
    """
    spacing = float(np.median(triangles.lattice.rest_lengths))
    passes = int(np.clip(round(SMOOTHING**2 / (3.0 / 7.0 * spacing**2)), 1, PASSES))
    return triangles.smoothed(point_stress(triangles, springs, x), passes)


def pressure(sigma: Array) -> Array:
    """Minus half the trace of stresses (..., 3) [M c^2/R^2]: positive where the material is compressed."""
    return np.asarray(-0.5 * (sigma[..., 0] + sigma[..., 1]))


def shear(sigma: Array) -> Array:
    """The largest shear stress, half the difference of the principal stresses of (..., 3) [M c^2/R^2]."""
    return np.hypot(0.5 * (sigma[..., 0] - sigma[..., 1]), sigma[..., 2])
