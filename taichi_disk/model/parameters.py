"""Numbers that a kernel gets as arguments, so that turning one needs no new compilation."""

from __future__ import annotations

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
)


def parameters(physics: Physics, mass: float, dt: float) -> Any:
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
    )
