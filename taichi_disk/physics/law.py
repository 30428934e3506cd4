"""What all laws of motion have in common: their numbers, their fields, and the same law in NumPy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import taichi as ti

from taichi_disk.lattice import Array, Lattice


@dataclass(frozen=True)
class Room:
    """How many points, blocks of springs and entries of a factor a simulation's fields have room for."""

    points: int
    blocks: int
    entries: int


class Law:
    """A force or a constraint: numbers, Taichi functions, and the same law in NumPy (its twin).

    An object of its own is a value: numbers and the NumPy twin. A `Simulation` takes a copy, gives it fields with
    `place`, and fills them with `fill`. Kernels read a number `a` as `self.now.a[None]`: changing it compiles nothing.

    Class attributes:
        scalars: names of the attributes that kernels read.
    """

    scalars: ClassVar[tuple[str, ...]] = ()
    now: Any

    @property
    def signature(self) -> tuple[Any, ...]:
        """What kernels are compiled for, beside the class: which parts of the law are absent."""
        return ()

    def place(self, builder: Any, room: Room) -> None:
        """Make the law's fields."""
        self.now = SimpleNamespace(**{name: ti.field(ti.f64) for name in self.scalars})
        builder.place(*vars(self.now).values())

    def fill(self, lattice: Lattice) -> None:
        """Write what the fields hold of `lattice`. (A simulation writes the scalars, all with one kernel.)"""

    def adopt(self, other: Law) -> None:
        """Take the numbers of another law of the same class and signature, which is a value; keep the fields."""
        vars(self).update(vars(other))

    # ---- the NumPy twin

    def energy(self, lattice: Lattice, x: Array) -> float:
        """Potential energy [M c^2] with the points at `x` (n, 2) [R]."""
        return 0.0

    def forces(self, lattice: Lattice, x: Array) -> Array:
        """Force (n, 2) [M c^2/R] on each point: minus the gradient of `energy`."""
        return np.zeros_like(x)

    def damping_forces(self, lattice: Lattice, v: Array) -> Array:
        """Force (n, 2) [M c^2/R] that depends on the velocities `v` (n, 2) [c]."""
        return np.zeros_like(v)

    def stiffness(self, lattice: Lattice, x: Array) -> Any:
        """Second derivative of `energy`, sparse (2n, 2n) [M c^2/R^2]; degrees of freedom x0, y0, x1, y1, ..."""
        from scipy.sparse import csr_matrix

        return csr_matrix((x.size, x.size))


class BodyForce(Law):
    """A force on each point that depends on nothing but the point. Kernels add it while they move the point.

    Class attributes:
        column: the energy column of the time series that its potential is added to, "wall" or "load".
    """

    column: ClassVar[str] = "load"
    at: Callable[..., Any]  # ti.func (state, i) -> force vector on point i [M c^2/R]
    potential_at: Callable[..., Any]  # ti.func (state, i) -> energy of point i [M c^2]
