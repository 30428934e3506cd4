"""The Taichi fields of one world, made by one factory: only what its physics needs."""

from __future__ import annotations

from typing import Any

import taichi as ti

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.sums import SUMS

BLOCK = 4  # springs handled together, so that their square roots and divisions become one vector instruction


def blocks_of(lattice: Lattice, lanes: int) -> tuple[int, int]:
    """(springs per block, number of blocks); lanes already fill a vector register on their own."""
    size = BLOCK if lanes == 1 else 1
    return size, -(-len(lattice.bonds) // size)


def make_fields(
    lattice: Lattice, physics: Physics, lanes: int, n_free: int, factor_entries: int, real: Any
) -> tuple[dict[str, Any], Any]:
    """Allocate the fields for `lanes` replicas of `lattice` in one SNode tree, `real` numbers in f64 or f32.

    One field per quantity; a point's x and y stand side by side (2 x lanes matrix per point), which the
    vectoriser turns into packed loads (30 % faster than separate x and y fields).

    Returns the fields by name and the tree, whose `destroy()` gives the memory back.
    """
    n = len(lattice.positions)
    size, blocks = blocks_of(lattice, lanes)
    builder = ti.FieldsBuilder()
    fields: dict[str, Any] = {}

    def scalars(name: str, count: int, kind: Any = real) -> None:
        fields[name] = ti.field(kind)
        builder.dense(ti.i, max(count, 1)).place(fields[name])

    def vectors(name: str, count: int) -> None:
        fields[name] = ti.Matrix.field(2, lanes, real)
        builder.dense(ti.i, count).place(fields[name])

    def per_lane(name: str) -> None:
        fields[name] = ti.Vector.field(lanes, real)
        builder.place(fields[name])

    # Two points past the end carry the springs that pad the last block.
    vectors("x", n + 2)  # positions at step k; in single precision displacements (see `frame`)
    vectors("v", n + 2)  # velocities at step k - 1/2
    vectors("f", n + 2)  # forces at step k
    scalars("bond_i", blocks * size, ti.i32)
    scalars("bond_j", blocks * size, ti.i32)
    scalars("rest", blocks * size)
    if size > 1:
        scalars("pull", blocks * size)
    if real is ti.f32:
        for name, count in (("base", n), ("span", blocks * size)):
            fields[name] = ti.Vector.field(2, real)
            builder.dense(ti.i, count).place(fields[name])
    fields["sums"] = ti.Matrix.field(SUMS, lanes, ti.f64)  # dissipated, absorbed... (see `stepping`)
    builder.dense(ti.i, 1).place(fields["sums"])
    if physics.load != 0.0:
        per_lane("load")
    if physics.pulled:
        fields["hand"] = ti.Vector.field(5, real)  # see `hand`
        builder.dense(ti.i, 1).place(fields["hand"])
    if physics.dissipates:
        vectors("u", n + 2)  # velocities at step k, predicted (explicit) or solved for (implicit)
        per_lane("eta")
    if physics.implicit_dashpot:
        vectors("z", n_free)
        scalars("order", n_free, ti.i32)
        scalars("column", n_free + 1, ti.i32)
        scalars("row", factor_entries, ti.i32)
        components = 2 if physics.boundary == "dashpot" else 1
        for name, count in (("factor", factor_entries), ("inverse_diagonal", n_free)):
            fields[name] = ti.Vector.field(components, real)
            builder.dense(ti.i, count).place(fields[name])
    if physics.wall == "elastic":
        scalars("disk_surface", len(lattice.disk_surface), ti.i32)
        scalars("wall_surface", len(lattice.wall_surface), ti.i32)
    if physics.boundary != "none":
        scalars("boundary", len(lattice.wall_boundary), ti.i32)
    if physics.boundary == "dashpot":
        fields["impedance"] = ti.Vector.field(2, real)
        builder.dense(ti.i, len(lattice.wall_boundary)).place(fields["impedance"])
    return fields, builder.finalize()
