"""Common features of all laws of motion: parameters, fields, and the same law in NumPy.

By default Taichi 1.7.4 splits local vectors into scalars and leaves it to LLVM 15 to
find vectors again, which finds at best pairs on processors that it does not know (Zen
4, Zen 5, ...). `internals.own_settings` keeps vectors whole, in registers as wide as
the processor has. Taichi then fails in two cases. It cannot address an element of a
vector field, so fields of vectors are pairs of scalar fields, adjacent in memory. And
LLVM aborts at `a -= b` and `-a` of whole local vectors, so write a = a - b and
-1.0 * a.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.base.engine import ti
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics.ordering import Arrangement

# Types of the NumPy arrays that kernels accept.
Integers1 = ti.types.ndarray(ti.i32, ndim=1)
Reals1 = ti.types.ndarray(ti.f64, ndim=1)
Reals2 = ti.types.ndarray(ti.f64, ndim=2)
Reals3 = ti.types.ndarray(ti.f64, ndim=3)

Contents = list[tuple[tuple[Any, ...], ArrayLike]]
"""Initial values of fields: pairs (fields, values (rows, fields)); row i goes to index
i of each field."""


@ti.func
def get(pair: ti.template(), i):
    """Return the vector (x, y) at index i of a pair of scalar fields."""
    return ti.Vector([pair[0][i], pair[1][i]])


@ti.func
def put(pair: ti.template(), i, value):
    pair[0][i] = value[0]
    pair[1][i] = value[1]


def side_by_side(
    builder: Any, count: int, fields: int, kind: Any = ti.f64
) -> tuple[Any, ...]:
    """Make `fields` fields of `count` numbers, adjacent in memory, so that one
    instruction loads all for an index."""
    made = tuple(ti.field(kind) for _ in range(fields))
    builder.dense(ti.i, count).place(*made)
    return made


def pair_of(builder: Any, count: int) -> tuple[Any, ...]:
    return side_by_side(builder, count, 2)


def array(builder: Any, count: int, kind: Any = ti.i32) -> Any:
    return side_by_side(builder, count, 1, kind)[0]


def scalar(builder: Any, kind: Any = ti.f64) -> Any:
    """Make a 0-D field: a number that kernels read from a register, and that can change
    without a compilation."""
    field = ti.field(kind)
    builder.place(field)
    return field


class Capacity(NamedTuple):
    """Numbers of points, blocks of springs and entries of a factor for which the fields
    of a simulation have room."""

    points: int
    blocks: int
    entries: int


class Law:
    """A force or a constraint: parameters, Taichi functions, and energy and forces in
    NumPy.

    Outside a `Simulation` a law is a plain value object. A simulation copies the law
    and gives the copy fields, which kernels read. Kernels read a parameter `k` that is
    named in `scalars` from the 0-D field `k_now`, so it can change without a
    compilation.
    """

    velocity_dependent = False  # whether the force depends on velocity
    # attributes that tell which parts of the law are absent; each needs a compilation
    switches: tuple[str, ...] = ()

    @property
    def scalars(self) -> tuple[str, ...]:
        return ()

    @property
    def signature(self) -> tuple[Any, ...]:
        """Everything about the law that requires a compilation of the kernels."""
        return (type(self), *(getattr(self, name) for name in self.switches))

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        for name in self.scalars:
            setattr(self, f"{name}_now", scalar(builder))

    def take_values(self, other: "Law") -> None:
        """Copy the attributes of `other`, a law with the same `signature`, but keep the
        fields."""
        vars(self).update(vars(other))

    def numbers(self) -> list[tuple[Any, float]]:
        return [
            (getattr(self, f"{name}_now"), getattr(self, name)) for name in self.scalars
        ]

    def contents(self, lattice: Lattice, arrangement: Arrangement) -> Contents:
        return []

    # ---- in NumPy

    def energy(self, lattice: Lattice, x: Array) -> float:
        """Return the potential energy [M c^2] with the points at `x` (n, 2) [R]; 0 if
        only kernels compute it."""
        return 0.0

    def forces(self, lattice: Lattice, x: Array) -> Array:
        """Return the force (n, 2) [M c^2/R] on each point: minus the gradient of
        `energy`."""
        return np.zeros_like(x)

    def damping_forces(self, lattice: Lattice, x: Array, v: Array) -> Array:
        """Return the force (n, 2) [M c^2/R] of dashpots at positions `x` (n, 2) [R] and
        velocities `v` (n, 2) [c]."""
        return np.zeros_like(v)

    def stiffness(self, lattice: Lattice, x: Array) -> Any:
        """Return the second derivative of `energy`, sparse (2n, 2n) [M c^2/R^2]; order
        x0, y0, x1, y1, ...

        It is zero except for springs, rigid wall and load, because Newton's method
        needs no other.
        """
        from scipy.sparse import csr_matrix

        return csr_matrix((x.size, x.size))


class Wall(Law, ABC):
    """A law by which the disk is reflected. Its energy is the column `wall`.

    A rigid wall is also a `BodyForce`. An exponential potential is in
    `ExponentialPotential`.
    """

    # whether a Taichi function `add_friction` makes the wall resist sliding
    has_friction = False
    # whether the force jumps when a point passes to the next spring of the wall
    has_jumps = False
    # how far the surface is below the straight lines between its points [R]
    corner_depth = 0.0

    # (lattice, x, v, others) -> friction along the wall, of a wall that has friction
    friction_on: Callable[..., Array]

    @property
    @abstractmethod
    def decay_length(self) -> float:
        """Length over which the force falls to 1/e or less [R]."""

    @abstractmethod
    def height_of_force(self, force: float) -> float:
        """Return the height above the wall at which it exerts `force` [M c^2/R]."""

    @abstractmethod
    def added_stiffness(self, force: float) -> float:
        """Return the wall's contribution to the stiffness of a point under the force
        `force` of the wall [M c^2/R^2]."""

    @abstractmethod
    def contact_forces(
        self, lattice: Lattice, x: Array, *moving: Any
    ) -> tuple[NDArray[np.intp], Array]:
        """Return the points (k,) of the disk near the wall, and the forces (k, 2) of
        the wall on them [M c^2/R].

        `moving`: the velocities (n, 2) [c] and the springs, on which friction depends.
        """


class BodyForce(Law):
    """A force on each point that depends only on that point; kernels add it while they
    move the point."""

    # Its potential counts as `wall` in the time series if it is the model's wall,
    # otherwise as `load`.

    at: Callable[..., Any]  # ti.func (state, i) -> force vector on point i [M c^2/R]
    potential_at: Callable[..., Any]  # ti.func (state, i) -> energy of point i [M c^2]
