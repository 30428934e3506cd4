"""The Taichi fields of one world, made by one factory: only what its physics needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import taichi as ti

from taichi_disk.model.factor import Factor
from taichi_disk.model.ordering import Arrangement
from taichi_disk.model.physics import Physics
from taichi_disk.model.sums import SUMS

_LEAST = 12_000  # numbers of one kind that there is room for: kernels of one size serve all lattices of usual size
_SPRINGS = 3  # for each point: a triangulation has fewer
_ENTRIES = 27  # of the factor for each point, enough up to some 12,000 points


@dataclass(frozen=True)
class Room:
    """How many points, blocks of springs and entries of the factor the fields have room for."""

    points: int
    blocks: int
    entries: int

    def holds(self, points: int, springs: Arrangement, factor: Factor | None) -> bool:
        """Whether such a lattice finds room."""
        entries = len(factor.row) if factor else 0
        return points <= self.points and springs.blocks <= self.blocks and entries <= self.entries


def room_for(points: int, springs: Arrangement, factor: Factor | None, lanes: int) -> Room:
    """Room for such a lattice, and for many others. The lanes share it, so that memory does not grow with them."""
    least = _LEAST // lanes
    return Room(
        points=_doubled(least, points),
        blocks=_doubled(_SPRINGS * least // springs.block, springs.blocks),
        entries=_doubled(_ENTRIES * least, len(factor.row) if factor else 0),
    )


def _doubled(least: int, count: int) -> int:
    while least < count:
        least *= 2
    return least


def make_fields(
    physics: Physics, springs: Arrangement, room: Room, lanes: int, sweeps: int, neighbours: int, real: Any
) -> tuple[dict[str, Any], Any]:
    """Allocate the fields for `lanes` replicas of a lattice in one SNode tree, `real` numbers in f64 or f32.

    One field per quantity; a point's x and y stand side by side (2 x lanes matrix per point), which the
    vectoriser turns into packed loads (30 % faster than separate x and y fields).

    Returns the fields by name and the tree, whose `destroy()` gives the memory back.
    """
    n = room.points
    filled = n + 2 * springs.chunks
    builder = ti.FieldsBuilder()
    fields: dict[str, Any] = {}

    def scalars(name: str, count: int, kind: Any = real) -> None:
        fields[name] = ti.field(kind)
        builder.dense(ti.i, count).place(fields[name])

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
        builder.dense(ti.i, room.blocks).place(fields[name])
    if real is ti.f32:
        fields["base"] = ti.Vector.field(2, real)
        builder.dense(ti.i, n).place(fields["base"])
        fields["span"] = ti.Matrix.field(springs.block, 2, real)
        builder.dense(ti.i, room.blocks).place(fields["span"])
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
    if physics.implicit_dashpot and sweeps:
        vectors("z", 2 * n)
        fields["neighbours"] = ti.Vector.field(neighbours, ti.i32)
        builder.dense(ti.i, n).place(fields["neighbours"])
        scalars("iteration", sweeps + 2)
        if physics.boundary == "dashpot":
            fields["outer"] = ti.Vector.field(2, real)
            builder.dense(ti.i, n).place(fields["outer"])
    elif physics.implicit_dashpot:
        vectors("z", n)
        scalars("order", n, ti.i32)
        scalars("column", n + 1, ti.i32)
        scalars("row", room.entries, ti.i32)
        components = 2 if physics.boundary == "dashpot" else 1
        for name, count in (("factor", room.entries), ("inverse_diagonal", n)):
            fields[name] = ti.Vector.field(components, real)
            builder.dense(ti.i, count).place(fields[name])
    if physics.wall == "elastic":
        scalars("disk_surface", n, ti.i32)
        scalars("wall_surface", n, ti.i32)
    if physics.boundary != "none":
        scalars("boundary", n, ti.i32)
    if physics.boundary == "dashpot":
        fields["impedance"] = ti.Vector.field(2, real)
        builder.dense(ti.i, n).place(fields["impedance"])
    return fields, builder.finalize()
