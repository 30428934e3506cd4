"""The laws that act in a scene."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics.body_forces import Load, MouseSpring
from taichi_disk.mechanics.physics.boundaries import Boundary
from taichi_disk.mechanics.physics.elastic_wall import ElasticWall
from taichi_disk.mechanics.physics.law import BodyForce, Law, Wall
from taichi_disk.mechanics.physics.springs import Springs


@dataclass(frozen=True)
class Model:
    """The laws of one scene. A law that is absent has no field and is neither compiled
    nor computed."""

    springs: Springs  # springs and dashpots of disk and wall
    wall: Wall | None = None
    load: Load | None = None
    boundary: Boundary | None = None  # law for the sides and bottom of the elastic wall
    mouse: MouseSpring | None = None
    others: tuple[BodyForce, ...] = ()  # further forces, see docs/extending.md

    @property
    def laws(self) -> tuple[Law, ...]:
        optional = (self.wall, self.load, self.boundary, self.mouse)
        return (
            self.springs,
            *(law for law in optional if law is not None),
            *self.others,
        )

    @property
    def loads(self) -> list[BodyForce]:
        """The forces on single points, besides a rigid wall."""
        return [
            law
            for law in self.laws
            if isinstance(law, BodyForce) and law is not self.wall
        ]

    @property
    def elastic(self) -> ElasticWall | None:
        if isinstance(self.wall, ElasticWall):
            return self.wall
        return None

    @property
    def has_friction(self) -> bool:
        return (self.wall or Wall).has_friction

    @property
    def solvable(self) -> bool:
        """Whether `trapezoidal` is useful: it cannot treat axial dashpots, and with
        friction it has only order 1."""
        return self.springs.damped and not (self.springs.axial or self.has_friction)

    @property
    def velocity_dependent(self) -> bool:
        return any(law.velocity_dependent for law in self.laws)

    @property
    def has_jumps(self) -> bool:
        return (self.wall or Wall).has_jumps

    @property
    def reset_interval(self) -> float:
        """Time between two resets of the boundary [R/c]; 0: no resets."""
        return (self.boundary or Boundary).interval

    @property
    def is_pinned(self) -> bool:
        return (self.boundary or Boundary).is_pinned

    @property
    def impedance(self) -> Array | None:
        """Dashpot constants (k, 2) of the points of a matched boundary [M c/R]; None if
        there is no such boundary."""
        return (self.boundary or Boundary).impedance

    def signature(self) -> tuple[Any, ...]:
        return tuple(law.signature for law in self.laws)

    # ---- in NumPy

    def energy(self, lattice: Lattice, x: Array) -> float:
        return sum(law.energy(lattice, x) for law in self.laws)

    def forces(self, lattice: Lattice, x: Array) -> Array:
        """Return the force (n, 2) on each point, without dashpots and friction [M
        c^2/R]."""
        return np.asarray(sum(law.forces(lattice, x) for law in self.laws))

    def forces_moving(self, lattice: Lattice, x: Array, v: Array) -> Array:
        """Return the force (n, 2) on each point at the velocities `v` (n, 2) [c]; 0 for
        pinned points."""
        damping = sum(law.damping_forces(lattice, x, v) for law in self.laws)
        force = self.forces(lattice, x) + damping
        if self.wall and self.has_friction:
            force[:, 0] += self.wall.friction_on(lattice, x, v, force)
        if self.is_pinned:
            force[lattice.wall_boundary] = 0.0
        return force

    def stiffness(self, lattice: Lattice, x: Array) -> Any:
        """Return the second derivative of `energy`, without an elastic wall, sparse
        (2n, 2n) [M c^2/R^2]."""
        return sum(law.stiffness(lattice, x) for law in self.laws)
