"""Numbers that a kernel gets as arguments, so that turning one needs no new compilation.

The sizes of a lattice are among them: a kernel is compiled for the room in its fields, and serves every lattice that
finds room there with the same bytes and at the same speed as one compiled for it alone.
"""

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import taichi as ti

from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.physics import Physics

Parameters = ti.types.struct(
    h=ti.f64,  # time step
    g=ti.f64,  # h/m
    closing=ti.f64,  # what the force at a step gets in that step's last kick, over m: h/(2 m) in leapfrog
    m=ti.f64,  # mass of a point
    k_a=ti.f64,
    k_b=ti.f64,
    a=ti.f64,
    V0=ti.f64,
    reach=ti.f64,
    threshold=ti.f64,
    V0_at_threshold=ti.f64,
    reset_steps=ti.i32,  # steps between two resets of the wall's boundary
    n=ti.i32,  # and the other `Sizes`
    n_disk=ti.i32,
    n_disk_surface=ti.i32,
    n_wall_surface=ti.i32,
    n_boundary=ti.i32,
    n_free=ti.i32,
    blocks=ti.i32,
    chunk_points=ti.i32,
)

Rounded = ti.types.struct(**{name: ti.i32 if kind is ti.i32 else ti.f32 for name, kind in Parameters.members.items()})


@ti.func
def rounded(q: ti.template()):  # type: ignore[valid-type]
    """The parameters in single precision: one number in double would turn all it meets into double."""
    return Rounded(
        h=q.h,
        g=q.g,
        closing=q.closing,
        m=q.m,
        k_a=q.k_a,
        k_b=q.k_b,
        a=q.a,
        V0=q.V0,
        reach=q.reach,
        threshold=q.threshold,
        V0_at_threshold=q.V0_at_threshold,
        reset_steps=q.reset_steps,
        n=q.n,
        n_disk=q.n_disk,
        n_disk_surface=q.n_disk_surface,
        n_wall_surface=q.n_wall_surface,
        n_boundary=q.n_boundary,
        n_free=q.n_free,
        blocks=q.blocks,
        chunk_points=q.chunk_points,
    )


@dataclass(frozen=True)
class Sizes:
    """How many there are: points, those of the disk, on its surface and on the wall's, points of the wall's boundary,
    points that a solve moves, blocks of springs (see `ordering`), points of a chunk."""

    n: int
    n_disk: int
    n_disk_surface: int
    n_wall_surface: int
    n_boundary: int
    n_free: int
    blocks: int
    chunk_points: int


def parameters(physics: Physics, mass: float, dt: float, sizes: Sizes) -> Any:
    return Parameters(
        h=dt,
        g=dt / mass,
        closing=SPLITTINGS[physics.integrator].kicks[-1] * (dt / mass),
        m=mass,
        k_a=physics.k_a,
        k_b=physics.k_b,
        a=physics.a,
        V0=physics.V0,
        reach=physics.reach,
        threshold=physics.threshold,
        V0_at_threshold=physics.V0 * float(np.exp(-physics.a * physics.threshold)),
        reset_steps=max(1, round(physics.reset_interval / dt)),
        **asdict(sizes),
    )
