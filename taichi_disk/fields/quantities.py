"""The quantities by name: their values, where they live, their unit, and what is written beside their colours."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from taichi_disk.fields import stress as tensor
from taichi_disk.fields.stress import Array, Triangles
from taichi_disk.lattice import Lattice

if TYPE_CHECKING:
    from taichi_disk.physics.springs import Springs

Place = Literal["triangles", "springs", "points"]

ROUNDING = 1e-13  # of stresses [M c^2/R^2], which makes no fringes
FRINGES = 5  # in a picture whose fringe constant nobody gave


@dataclass(frozen=True)
class Field:
    """Values (k,) of a quantity in `unit`, one for each of the lattice's triangles, springs or points."""

    values: Array
    on: Place
    unit: str


@dataclass(frozen=True)
class Quantity:
    """What is said about a quantity: its label, the meaning of a low and of a high value, whether it has a sign."""

    label: str
    unit: str
    on: Place
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
    """The quantity `name` of QUANTITIES with the points at `x` (n, 2) [R] and velocities `v` (n, 2) [c].

    - pressure, shear: of the stress of each triangle, see `stress`; pressure is positive under compression.
    - fringes: brightness from 0 to 1 at the points, see `fringes` and `smooth_stress`.
    - rate: -div v of each triangle: positive while it is being compressed.
    - strain, force: of each spring, positive where it is stretched.
    - speed, kinetic: of each point of the disk in the frame of the disk's centre of mass; of a wall, as it is.
    """
    values, kind = _values(name, Triangles(lattice), springs, x, v), QUANTITIES[name]
    return Field(fringes(0.5 * values) if name == "fringes" else values, kind.on, kind.unit)


def _values(name: str, tiles: Triangles, springs: Springs, x: Array, v: Array) -> Array:
    lattice = tiles.lattice
    if name == "pressure":
        return tensor.pressure(tensor.stress(tiles, springs, x))
    if name == "shear":
        return tensor.shear(tensor.stress(tiles, springs, x))
    if name == "fringes":
        return 2.0 * tensor.shear(tensor.smooth_stress(tiles, springs, x))
    if name == "rate":
        return -tiles.growth(x, v) / tiles.areas(x)
    if name == "strain":
        return springs.strain(lattice, x)
    if name == "force":
        return springs.tension(lattice, x)
    speed = motion(lattice, v)
    return speed if name == "speed" else 0.5 * lattice.masses * speed**2


def at_points(name: str, tiles: Triangles, springs: Springs, x: Array, v: Array) -> Array:
    """(n,) what pictures show between the points: `field`, brought to the points.

    Of triangles the mean around each point, weighted with their areas (of the shear: that of the mean stress); of
    springs the mean over those that meet in a point. "fringes": twice the shear, the fringes' argument.
    """
    if name == "shear":
        return tensor.shear(tensor.point_stress(tiles, springs, x))
    values, on = _values(name, tiles, springs, x, v), QUANTITIES[name].on
    if on == "triangles":
        areas = tiles.areas(x)
        return tiles.point_means(areas * values, areas)
    if on == "springs":
        ends, n = tiles.lattice.bonds.ravel(), len(x)
        return np.bincount(ends, np.repeat(values, 2), n) / np.maximum(np.bincount(ends, minlength=n), 1)
    return values


def fringes(shear: Array, fringe: float = 0.0) -> Array:
    """Brightness sin^2(pi * 2 shear/fringe) of shear stresses [M c^2/R^2]: a circular polariscope's dark field.

    `fringe`: stress difference from one fringe to the next; 0: the largest difference makes FRINGES.
    """
    largest = float(shear.max(initial=0.0))
    fringe = fringe or (2.0 * largest / FRINGES if largest > ROUNDING else 1.0)
    return np.asarray(np.sin(2.0 * np.pi * shear / fringe) ** 2)


def motion(lattice: Lattice, v: Array) -> Array:
    """(n,) speeds [c]: of the disk's points in the frame of its centre of mass, of a wall's points as they are."""
    n, relative = lattice.disk_points, v.copy()
    relative[:n] -= lattice.masses[:n] @ v[:n] / lattice.masses[:n].sum()
    return np.hypot(relative[:, 0], relative[:, 1])
