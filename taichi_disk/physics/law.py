"""What all laws of motion have in common: their numbers, their fields, and the same law in NumPy.

Taichi 1.7.4 by default takes local vectors apart into scalars and leaves it to LLVM 15 to find vectors again; on a
processor that LLVM 15 does not know (Zen 4, Zen 5, ...) it makes pairs of numbers at best. `runtime.start` has them
kept whole, in registers as wide as the processor has. Two things go wrong then: the address of an element of a vector
field, so fields of vectors are pairs of scalar fields, side by side in memory; and `a -= b` of whole local vectors
(LLVM aborts), so write a = a - b.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.config.potential import ExponentialPotential
from taichi_disk.engine import ti
from taichi_disk.lattice import Array, Lattice

# NumPy arrays that kernels take.
Integers1 = ti.types.ndarray(ti.i32, ndim=1)
Reals1 = ti.types.ndarray(ti.f64, ndim=1)
Reals2 = ti.types.ndarray(ti.f64, ndim=2)
Reals3 = ti.types.ndarray(ti.f64, ndim=3)


@ti.func
def get(pair: ti.template(), i):
    """(x, y) at i of a pair of scalar fields."""
    return ti.Vector([pair[0][i], pair[1][i]])


@ti.func
def put(pair: ti.template(), i, value):
    """Set what `get` returns."""
    pair[0][i] = value[0]
    pair[1][i] = value[1]


def side_by_side(builder: Any, count: int, fields: int, kind: Any = ti.f64) -> tuple[Any, ...]:
    """`fields` fields of `count` numbers each. Those of one index lie together: loaded with one instruction."""
    made = tuple(ti.field(kind) for _ in range(fields))
    builder.dense(ti.i, count).place(*made)
    return made


def pair_of(builder: Any, count: int) -> tuple[Any, ...]:
    """`count` vectors, as `get` and `put` take them."""
    return side_by_side(builder, count, 2)


def array(builder: Any, count: int, kind: Any = ti.i32) -> Any:
    """A field of `count` numbers."""
    return side_by_side(builder, count, 1, kind)[0]


def scalar(builder: Any, kind: Any = ti.f64) -> Any:
    """A 0-D field: a number that kernels read from a register, and that changes without compiling anew."""
    field = ti.field(kind)
    builder.place(field)
    return field


@dataclass(frozen=True)
class Capacity:
    """How many points, blocks of springs and entries of a factor a simulation's fields can hold."""

    points: int
    blocks: int
    entries: int


class Law:
    """A force or a constraint: numbers, Taichi functions, and energy and forces in NumPy.

    Outside a `Simulation` a law is a plain value: numbers and NumPy. A simulation copies the law and gives the copy
    fields, which kernels read.

    Attributes:
        velocity_dependent: whether the force depends on velocity.
    """

    velocity_dependent: bool = False

    @property
    def signature(self) -> tuple[Any, ...]:
        """What kernels are compiled for, beside the class: which parts of the law are absent."""
        return ()

    @property
    def scalars(self) -> tuple[str, ...]:
        """Names of the numbers that kernels read, `k` from the 0-D field `k_now`: a new k needs no new compilation."""
        return ()

    def make_fields(self, builder: Any, capacity: Capacity) -> None:
        """Make the law's fields, those of `scalars` and others."""
        for name in self.scalars:
            setattr(self, f"{name}_now", scalar(builder))

    def take_values(self, other: "Law") -> None:
        """Become the value that `other`, a law with the same `signature`, is; the fields stay."""
        for name, value in vars(other).items():
            setattr(self, name, value)

    def numbers(self) -> list[tuple[Any, float]]:
        """The 0-D fields, each with the number that it holds. (A simulation writes all of them with one kernel.)"""
        return [(getattr(self, f"{name}_now"), getattr(self, name)) for name in self.scalars]

    def fill(self, lattice: Lattice) -> None:
        """Write what the other fields hold of `lattice`."""

    # ---- in NumPy

    def energy(self, lattice: Lattice, x: Array) -> float:
        """Potential energy [M c^2] with the points at `x` (n, 2) [R]; 0 where a law has none, or only in kernels."""
        return 0.0

    def forces(self, lattice: Lattice, x: Array) -> Array:
        """Force (n, 2) [M c^2/R] on each point: minus the gradient of `energy`."""
        return np.zeros_like(x)

    def damping_forces(self, lattice: Lattice, x: Array, v: Array) -> Array:
        """Force (n, 2) [M c^2/R] that depends on the velocities `v` (n, 2) [c], with the points at `x` (n, 2) [R]."""
        return np.zeros_like(v)

    def stiffness(self, lattice: Lattice, x: Array) -> Any:
        """Second derivative of `energy`, sparse (2n, 2n) [M c^2/R^2]; degrees of freedom x0, y0, x1, y1, ...

        Newton's method needs it of springs, rigid wall and load; the others, the elastic wall too, give zero.
        """
        from scipy.sparse import csr_matrix

        return csr_matrix((x.size, x.size))


class Wall(ExponentialPotential, Law):
    """What the disk meets; its energy is the column `wall`.

    Attributes:
        is_elastic: whether the wall is a lattice, of points behind those of the disk.
        has_friction: whether the wall resists sliding, by a Taichi function `rub`.
        has_jumps: whether the force jumps where points of the disk pass from spring to spring of the wall.
    """

    is_elastic: bool = False
    has_friction: bool = False
    has_jumps: bool = False

    def contact_forces(self, lattice: Lattice, x: Array, *moving: Any) -> tuple[NDArray[np.intp], Array]:
        """Return (points (k,), forces (k, 2) [M c^2/R]) of the wall on the points of the disk in its reach.

        `moving`: the velocities (n, 2) [c] and the springs, where friction counts.
        """
        raise NotImplementedError

    def friction_on(self, lattice: Lattice, x: Array, v: Array, others: Array) -> Array:
        """Return the friction (n,) along the wall [M c^2/R] on points at `x` with velocities `v`, all (n, 2).

        `others` (n, 2) are the other forces on them, which friction balances on a point that sticks.
        """
        return np.zeros(len(x))


class BodyForce(Law):
    """A force on each point that depends on nothing but the point. Kernels add it while they move the point.

    Its potential counts as `wall` in the time series if it is the model's wall, else as `load`.
    """

    at: Callable[..., Any]  # ti.func (state, i) -> force vector on point i [M c^2/R]
    potential_at: Callable[..., Any]  # ti.func (state, i) -> energy of point i [M c^2]
