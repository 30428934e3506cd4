"""Why a state was lost: what the last good step and the first bad one say, in NumPy, once, when it has happened.

Also what is looked for while a scene against the elastic wall runs: a disk that has got through the wall, which the
contact force, looking for the spring below a point, cannot know.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import TaichiDiskError
from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import spectrum, step_limit

Array = NDArray[np.float64]

CRUSHED = 0.5  # strain beyond which a spring is no longer one of an elastic body


@dataclass(frozen=True)
class Diagnosis:
    """Likely cause and remedy; `stubborn`: a shorter step seldom mends it."""

    cause: str
    remedy: str
    stubborn: bool = False


def contacts(lattice: Lattice, physics: Physics, x: Array) -> tuple[NDArray[np.int64], Array, Array]:
    """Which wall each surface point of the disk feels: number of the wall's surface spring (-1: none), potential
    [M c^2] and force [M c^2/R]; against a rigid wall the number is 0. `x` is (n, 2) [R]."""
    point = x[lattice.disk_surface]
    with np.errstate(over="ignore", invalid="ignore"):
        if physics.wall != "elastic":
            energy = physics.V0 * np.exp(-physics.a * point[:, 1]) if physics.wall == "rigid" else 0.0 * point[:, 1]
            return np.zeros(len(point), int), energy, physics.a * energy
        chain = x[lattice.wall_surface]
        start, along = chain[:-1], np.diff(chain, axis=0)
        ahead = point[:, None, 0] - start[:, 0]
        over = (ahead >= 0.0) & (ahead < along[:, 0])
        spring = np.where(over.any(axis=1), over.argmax(axis=1), -1)
        a, t = start[spring], along[spring]
        gap = (t[:, 0] * (point - a)[:, 1] - t[:, 1] * (point - a)[:, 0]) / np.hypot(*t.T)
        spring = np.where(gap < physics.threshold, spring, -1)
        energy = np.where(spring >= 0, physics.V0 * np.exp(-physics.a * gap), 0.0)
    return spring, energy, physics.a * energy


def gone_through(lattice: Lattice, physics: Physics, x: Array, energy: float) -> Diagnosis | None:
    """Whether the disk has got into the elastic wall or past its ends, with the `energy` [M c^2] that there is."""
    if physics.wall != "elastic":
        return None
    n, chain = lattice.disk_points, x[lattice.wall_surface]
    disk = x[:n]
    centre, left, right = disk[:, 0].mean(), chain[:, 0].min(), chain[:, 0].max()
    if not left <= centre <= right and disk[:, 1].min() < min(chain[0, 1], chain[-1, 1]):
        return Diagnosis(
            f"the disk has slipped off the end of the wall (its centre of mass is at x = {centre:.3g} R, the wall ends "
            f"at {left:.3g} and {right:.3g} R)",
            "a wider wall (wall.width) holds it",
            stubborn=True,
        )
    # A force that is the gradient of V0 exp(-a l) lets a point of this energy no deeper than this.
    allowed = 2.0 * max(np.log(energy / physics.V0), 0.0) / physics.a if energy > 0.0 else 0.0
    near = np.flatnonzero((disk[:, 1] < chain[:, 1].max()) & (disk[:, 0] > left) & (disk[:, 0] < right))
    outline = np.concatenate([x[lattice.wall_boundary], chain[-2:0:-1]])
    inside = near[_within(disk[near], outline)]
    if not len(inside):
        return None
    depth = _distance(disk[inside], chain)
    worst = int(depth.argmax())
    if depth[worst] <= allowed:
        return None
    i = int(inside[worst])
    kind = "on" if i in lattice.disk_surface else "inside"
    return Diagnosis(
        f"the disk has gone through the wall's surface: its point {i}, {kind} its outline, is {depth[worst]:.3g} R "
        "below it",
        "disk and wall are too soft for this impact: lower impact.velocity or raise material.k_a",
        stubborn=True,
    )


def _within(points: Array, polygon: Array) -> NDArray[np.bool_]:
    """Which `points` (k, 2) lie inside the closed `polygon`: an upward ray crosses its sides an odd number of times."""
    a, b = polygon, np.roll(polygon, -1, axis=0)
    px, py = points[:, None, 0], points[:, None, 1]
    astride = (a[:, 0] <= px) != (b[:, 0] <= px)
    with np.errstate(divide="ignore", invalid="ignore"):
        height = a[:, 1] + (px - a[:, 0]) / (b[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    return np.asarray((astride & (height > py)).sum(axis=1) % 2 == 1)


def _distance(points: Array, chain: Array) -> Array:
    """Distance (k,) of each point from the nearest segment of `chain`."""
    start, along = chain[:-1], np.diff(chain, axis=0)
    offset = points[:, None, :] - start
    part = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.hypot(*np.moveaxis(offset - part[..., None] * along, 2, 0)).min(axis=1))


def diagnose(
    lattice: Lattice, physics: Physics, dt: float, limit: float, before: Array, after: Array, gained: float
) -> Diagnosis:
    """The likely cause of a blow-up between two steps.

    Args:
        physics: with the integrator of the run.
        dt, limit: the step and the stability limit it was chosen by [R/c].
        before, after: positions (n, 2) at the last good step and the next [R].
        gained: change of the energy from the one to the other, what sliding took or gave included [M c^2].
    """
    if dt > limit:
        return Diagnosis(f"the step {dt:.4g} R/c is beyond the stability limit {limit:.4g} R/c", "set time.dt: auto")
    if physics.wall == "elastic" and (slide := _slide(lattice, physics, before, after, gained)):
        return slide
    force = contacts(lattice, physics, before)[2]
    # A point that got deep into the wall in one step would have needed the force that stops it alone, a m v^2/2.
    surface = lattice.disk_surface
    alone = 0.5 * lattice.masses[0] * (((after - before)[surface] / dt) ** 2).sum(axis=1)
    deep = contacts(lattice, physics, after)[1] > alone
    force = np.where(deep & (alone < np.inf), np.maximum(force, physics.a * alone), force)
    i = int(force.argmax())
    try:
        now = step_limit(spectrum(replace(lattice, positions=before), physics), physics, float(force[i]))
    except TaichiDiskError:
        now = limit
    if dt > now:
        pushed = step_limit(spectrum(lattice, physics), physics, float(force[i]))
        why = (
            f"where the wall pushes point {lattice.disk_surface[i]} with {force[i]:.3g} M c^2/R"
            if physics.wall != "none" and pushed < 1.5 * now
            else "by the springs' strain"
        )
        text = f"the stability limit has fallen from {limit:.3g} to {now:.3g} R/c, {why}, and the step is {dt:.3g} R/c"
        return Diagnosis(text, f"set time.dt below {now:.2g}; a lower speed or a softer wall helps too")
    strain = np.abs(np.hypot(*(before[lattice.bonds[:, 0]] - before[lattice.bonds[:, 1]]).T) / lattice.rest_lengths - 1)
    if strain.max() > CRUSHED:
        many = int((strain > CRUSHED).sum())
        return Diagnosis(
            f"the body is crushed: {many} of {len(strain)} springs are strained by more than {CRUSHED:.0%}",
            "lower impact.velocity or compression.pressure, or raise material.k_a",
        )
    return Diagnosis(f"none is plain: the step is {dt / now:.2f} of the stability limit", "try a smaller time.safety")


def _slide(lattice: Lattice, physics: Physics, before: Array, after: Array, gained: float) -> Diagnosis | None:
    """The point that has passed from one surface spring to another, if that made most of the energy's change."""
    spring0, energy0, _ = contacts(lattice, physics, before)
    spring1, energy1, _ = contacts(lattice, physics, after)
    jump = np.where(spring0 != spring1, energy1 - energy0, 0.0)
    k = int(np.abs(jump).argmax())
    if (np.isfinite(gained) and abs(jump[k]) < 0.3 * abs(gained)) or spring0[k] == spring1[k]:
        return None
    i, found = lattice.disk_surface[k], f"its contact potential is {energy1[k]:.3g} instead of {energy0[k]:.3g} M c^2"
    if -1 in (spring0[k], spring1[k]):
        return Diagnosis(
            f"point {i} got over or under the wall's surface from beside it, or away: {found}",
            "a wider wall (wall.width), or a lower impact.velocity",
            stubborn=True,
        )
    chain = before[lattice.wall_surface]
    slope = np.degrees(np.arctan2(np.diff(chain[:, 1]), np.diff(chain[:, 0])))
    return Diagnosis(
        f"point {i} slid from the wall's surface spring {spring0[k]} to {spring1[k]}, where {found}: the wall is "
        f"dented until its surface stands at {np.abs(slope).max():.0f} degrees",
        "lower impact.velocity or raise material.k_a",
        stubborn=True,
    )
