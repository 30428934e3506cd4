"""The Taichi fields of one world, made by one factory: only what its physics needs."""

from __future__ import annotations

from typing import Any

import taichi as ti

from taichi_disk.lattice import Lattice
from taichi_disk.model.ordering import Arrangement
from taichi_disk.model.physics import Physics
from taichi_disk.model.sums import SUMS


def make_fields(
    lattice: Lattice,
    physics: Physics,
    springs: Arrangement,
    lanes: int,
    n_free: int,
    factor_entries: int,
    real: Any,
) -> tuple[dict[str, Any], Any]:
    """Allocate the fields for `lanes` replicas of `lattice` in one SNode tree, `real` numbers in f64 or f32.

    One field per quantity; a point's x and y stand side by side (2 x lanes matrix per point), which the
    vectoriser turns into packed loads (30 % faster than separate x and y fields).

    Returns the fields by name and the tree, whose `destroy()` gives the memory back.
    """
    n = len(lattice.positions)
    filled = n + 2 * springs.chunks
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

    # Two points past the end for each chunk carry the springs that fill up its blocks.
    vectors("x", filled)  # positions at step k; in single precision displacements (see `frame`)
    vectors("v", filled)  # velocities at step k - 1/2
    vectors("f", filled)  # forces at step k
    # A block's numbers in one element: else, where a loop begins anywhere, the compiler does not see them side by side.
    for name, kind in (("bond_i", ti.i32), ("bond_j", ti.i32), ("rest", real)):
        fields[name] = ti.Vector.field(springs.block, kind)
        builder.dense(ti.i, springs.blocks).place(fields[name])
    if real is ti.f32:
        fields["base"] = ti.Vector.field(2, real)
        builder.dense(ti.i, n).place(fields["base"])
        fields["span"] = ti.Matrix.field(springs.block, 2, real)
        builder.dense(ti.i, springs.blocks).place(fields["span"])
    fields["sums"] = ti.Matrix.field(SUMS, lanes, ti.f64)  # dissipated, absorbed... (see `stepping`)
    builder.dense(ti.i, 1).place(fields["sums"])
    if springs.chunks > 1:
        scalars("chunk_ends", springs.chunks, ti.i32)
        for name, rows, count in (("chunk_sums", 4, springs.chunks), ("latest", 3, 1)):
            fields[name] = ti.Matrix.field(rows, lanes, real)
            builder.dense(ti.i, count).place(fields[name])
    if physics.load != 0.0:
        per_lane("load")
    if physics.pulled:
        fields["hand"] = ti.Vector.field(5, real)  # see `hand`
        builder.dense(ti.i, 1).place(fields["hand"])
    if physics.dissipates:
        vectors("u", filled)  # velocities at step k, predicted (explicit) or solved for (implicit)
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
