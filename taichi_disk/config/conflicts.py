"""Conflicts between keys that are valid by themselves, with advice."""

from __future__ import annotations

from typing import TypeAlias

from taichi_disk.config.sections import (
    CORRECTED,
    DASHPOTS,
    ElasticWallSection,
    ImpactSection,
    MaterialSection,
    TimeSection,
    WallSection,
)

Conflicts: TypeAlias = list[tuple[str, str]]  # (dotted key, message)


def time_conflicts(
    time: TimeSection, material: MaterialSection, *others: str, friction: float = 0.0, resets: bool = False
) -> Conflicts:
    """Return the conflicts of the section `time`; `others`: further keys, with values, of velocity-dependent forces.

    `resets`: whether the wall's boundary is stopped again and again.
    """
    conflicts, damping = [], [*dashpots(material), *others, *[f"wall.friction = {friction:g}"] * bool(friction)]
    if time.tolerance != "none" and time.dt != "auto":
        conflicts.append(("time.tolerance", f"determines the step: write time.dt: auto, not {time.dt:g}"))
    name, treatment = time.integrator, DASHPOTS.get(time.integrator)
    if treatment == "none" and damping:
        text = f"{name} cannot integrate velocity-dependent forces ({damping[0]}): write auto or velocity_verlet"
        conflicts.append(("time.integrator", text))
    if name in CORRECTED and resets:
        text = f"{name} has errors of order 2 beside wall.boundary = reset: write auto, or vefrl for order 4"
        conflicts.append(("time.integrator", text))
    if treatment == "implicit" and friction:
        text = f"{name} is only of order 1 with friction: write auto or velocity_verlet"
        conflicts.append(("time.integrator", text))
    if treatment == "implicit" and material.dashpot == "axial" and dashpots(material):
        text = f"{name} needs a constant damping matrix, which axial dashpots do not have: write auto"
        conflicts.append(("time.integrator", text))
    return conflicts


def dashpots(material: MaterialSection) -> list[str]:
    """Return the key of the dashpots with its value; empty without dashpots."""
    name, value = material.dashpots
    return [f"material.{name} = {value:g}"] if value else []


def gap_conflicts(wall: WallSection | ElasticWallSection, impact: ImpactSection) -> Conflicts:
    """Return the conflict of a start too close to the wall, whose potential energy would make e > 1."""
    least = wall.height_of(1e-3 * 0.5 * impact.towards**2)  # M = 1
    if impact.gap == "auto" or impact.gap >= least:
        return []
    reason = f"at {impact.gap:g} R the wall potential exceeds 1e-3 of the kinetic energy"
    return [("impact.gap", f"{reason}: write at least {rounded_up(least)} R, or auto")]


def least_threshold(wall: ElasticWallSection, velocity: float) -> float:
    """Return the smallest allowed cut-off distance of the contact [R], where its potential is 1e-5 of v^2/2.

    `velocity`: velocity component towards the wall [c].
    """
    return wall.height_of(1e-5 * 0.5 * velocity**2)


def rounded_up(value: float) -> str:
    """Format `value` with four digits, rounded up."""
    return f"{value * 1.001:.4g}"
