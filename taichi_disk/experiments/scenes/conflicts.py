"""Conflicts between keys that are valid by themselves, with advice."""

from __future__ import annotations

from typing import Any, TypeAlias

from taichi_disk.experiments.config.sections import (
    ImpactSection,
    MaterialSection,
    TimeSection,
)
from taichi_disk.mechanics.integrators import INTEGRATORS
from taichi_disk.mechanics.potential import ExponentialPotential

Conflicts: TypeAlias = list[tuple[str, str]]  # (dotted key, message)


def time_conflicts(
    time: TimeSection, material: MaterialSection, wall: Any
) -> Conflicts:
    """Return the conflicts of the section `time`; `wall`: its section, if there is
    one."""
    conflicts = []
    if time.tolerance != "none" and time.dt != "auto":
        text = f"chooses the time step itself: write time.dt: auto, not {time.dt:g}"
        conflicts.append(("time.tolerance", text))
    name = time.integrator
    if name == "auto":
        return conflicts
    integrator = INTEGRATORS[name]
    is_implicit = integrator.dashpots == "implicit"
    dashpot, eta = material.dashpots
    friction = getattr(wall, "friction", 0.0)
    boundary = getattr(wall, "boundary", "")
    damping = {
        "wall.boundary = dashpot": boundary == "dashpot",
        f"material.{dashpot} = {eta:g}": eta,
        f"wall.friction = {friction:g}": friction,
    }
    forces = [name for name, value in damping.items() if value]
    limits = []
    if integrator.dashpots == "none" and forces:
        limits.append(
            f"cannot integrate velocity-dependent forces ({forces[0]}): write auto or"
            " velocity_verlet"
        )
    if integrator.correction and boundary == "reset":
        limits.append("has only order 2 with wall.boundary = reset: write auto")
    if is_implicit and friction:
        limits.append("has only order 1 with friction: write auto or velocity_verlet")
    if is_implicit and eta and material.dashpot == "axial":
        limits.append(
            "needs a constant damping matrix, which axial dashpots do not have: write"
            " auto"
        )
    return conflicts + [("time.integrator", f"{name} {limit}") for limit in limits]


def gap_conflicts(wall: ExponentialPotential, impact: ImpactSection) -> Conflicts:
    least = wall.height_of(1e-3 * 0.5 * impact.towards**2)  # M = 1
    if impact.gap == "auto" or impact.gap >= least:
        return []
    reason = (
        f"at {impact.gap:g} R the wall potential exceeds 1e-3 of the kinetic energy, so"
        " that e would be wrong"
    )
    return [("impact.gap", f"{reason}: write at least {rounded_up(least)} R, or auto")]


def least_threshold(wall: ExponentialPotential, velocity: float) -> float:
    """Return the smallest allowed cut-off distance of the contact [R], where its
    potential is 1e-5 of v^2/2.

    `velocity`: velocity component towards the wall [c].
    """
    return wall.height_of(1e-5 * 0.5 * velocity**2)


def rounded_up(value: float) -> str:
    return f"{value * 1.001:.4g}"
