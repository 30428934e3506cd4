"""Disagreements between keys of a scene that are valid by themselves, and what would mend them."""

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

Conflicts: TypeAlias = list[tuple[str, str]]  # (dotted key, what is wrong with it)


def time_conflicts(
    time: TimeSection, material: MaterialSection, *others: str, friction: float = 0.0, resets: bool = False
) -> Conflicts:
    """Those of the section `time`; `others` are keys, with values, that make forces depend on velocity, too.

    `resets`: whether the wall's boundary is stopped again and again.
    """
    conflicts, damping = [], [*dashpots(material), *others, *[f"wall.friction = {friction:g}"] * bool(friction)]
    if time.tolerance != "none" and time.dt != "auto":
        conflicts.append(("time.tolerance", f"finds the step itself: write time.dt: auto, not {time.dt:g}"))
    name, way = time.integrator, DASHPOTS.get(time.integrator)
    if way == "none" and damping:
        text = f"{name} cannot take forces that depend on velocity ({damping[0]}): write auto, or velocity_verlet"
        conflicts.append(("time.integrator", text))
    if name in CORRECTED and resets:
        text = f"{name} has errors of order 2 beside wall.boundary = reset: write auto, or vefrl for order 4"
        conflicts.append(("time.integrator", text))
    if way == "implicit" and friction:
        text = f"{name} has errors of order 1 beside friction: write auto, or velocity_verlet"
        conflicts.append(("time.integrator", text))
    if way == "implicit" and material.dashpot == "axial" and dashpots(material):
        text = f"{name} solves for dashpots whose matrix stays the same, not for axial ones: write auto"
        conflicts.append(("time.integrator", text))
    return conflicts


def dashpots(material: MaterialSection) -> list[str]:
    """The key, with its value, that makes the springs' forces depend on velocity; empty where none does."""
    name, value = material.dashpots
    return [f"material.{name} = {value:g}"] if value else []


def gap_conflicts(wall: WallSection | ElasticWallSection, impact: ImpactSection) -> Conflicts:
    """A start within the wall's reach: the disk would be shot away by potential energy to spare, e > 1."""
    least = wall.height_of(1e-3 * 0.5 * impact.towards**2)  # M = 1
    if impact.gap == "auto" or impact.gap >= least:
        return []
    what = f"at {impact.gap:g} R the wall's potential exceeds 1e-3 of the kinetic energy"
    return [("impact.gap", f"{what}: start at {rounded_up(least)} R or farther, or write auto")]


def least_threshold(wall: ElasticWallSection, velocity: float) -> float:
    """Distance at which the contact may be cut off: farther away its potential is 1e-5 of v^2/2 or less [R].

    `velocity` is that towards the wall.
    """
    return wall.height_of(1e-5 * 0.5 * velocity**2)


def rounded_up(value: float) -> str:
    """Four digits, above the value."""
    return f"{value * 1.001:.4g}"
