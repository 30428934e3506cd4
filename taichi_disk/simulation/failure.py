"""Why a state was lost: what the last good step and the first bad one say, in NumPy, once, when it has happened."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from taichi_disk.errors import SimulationError, TaichiDiskError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import ElasticWall, Model
from taichi_disk.simulation.error_estimate import TimeStep
from taichi_disk.simulation.stability import spectrum, step_limit


@dataclass(frozen=True)
class Diagnosis:
    """Likely cause and remedy; where it is `step_independent`, a shorter step seldom mends it."""

    cause: str
    remedy: str
    step_independent: bool = False


class BlowUp(SimulationError):
    """The state became meaningless.

    Attributes:
        last_good: positions and velocities (n, 2) and the time of the last state that was still good.
    """

    def __init__(self, message: str, last_good: dict[str, Array]) -> None:
        super().__init__(message)
        self.last_good = last_good


def gone_through(lattice: Lattice, model: Model, x: Array, energy: float) -> Diagnosis | None:
    """Whether the disk has got into the elastic wall or past its ends, with the `energy` [M c^2] that there is.

    The contact force, looking for the spring below a point, cannot know.
    """
    wall = model.elastic
    if wall is None:
        return None
    disk, chain = x[: lattice.disk_points], x[lattice.wall_surface]
    centre, left, right = disk[:, 0].mean(), chain[:, 0].min(), chain[:, 0].max()
    if not left <= centre <= right and disk[:, 1].min() < min(chain[0, 1], chain[-1, 1]):
        return Diagnosis(
            f"the disk has slipped off the end of the wall (its centre of mass is at x = {centre:.3g} R, the wall ends "
            f"at {left:.3g} and {right:.3g} R)",
            "a wider wall (wall.width) holds it",
            step_independent=True,
        )
    near = np.flatnonzero((disk[:, 1] < chain[:, 1].max()) & (disk[:, 0] > left) & (disk[:, 0] < right))
    depth = _depth(disk[near], np.concatenate([x[lattice.wall_boundary], chain[-2:0:-1]]), chain)
    # A force that is the gradient of V0 exp(-a l) lets a point of this energy no deeper than this.
    allowed = 2.0 * max(np.log(energy / wall.V0), 0.0) / wall.a if energy > 0.0 else 0.0
    if depth.max(initial=0.0) <= allowed:
        return None
    return Diagnosis(
        f"the disk has gone through the wall's surface: point {near[depth.argmax()]} is {depth.max():.3g} R below it",
        "disk and wall are too soft for this impact: lower impact.velocity or raise material.k_a",
        step_independent=True,
    )


def _depth(points: Array, outline: Array, chain: Array) -> Array:
    """Distance (k,) of each point within the closed `outline` from the nearest segment of `chain`; 0 outside it."""
    a, b = outline, np.roll(outline, -1, axis=0)
    x, y = points[:, None, 0], points[:, None, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        height = a[:, 1] + (x - a[:, 0]) / (b[:, 0] - a[:, 0]) * (b[:, 1] - a[:, 1])
    crossed = ((a[:, 0] <= x) != (b[:, 0] <= x)) & (height > y)  # by a ray upwards: from within an odd number of times
    start, along = chain[:-1], np.diff(chain, axis=0)
    offset = points[:, None, :] - start
    part = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    distance = np.linalg.norm(offset - part[..., None] * along, axis=2).min(axis=1)
    return np.where(crossed.sum(axis=1) % 2 == 1, distance, 0.0)


def diagnose(lattice: Lattice, model: Model, step: TimeStep, before: Array, after: Array, gained: float) -> Diagnosis:
    """The likely cause of a blow-up between two steps.

    Args:
        before, after: positions (n, 2) at the last good step and the next [R].
        gained: change of the energy from the one to the other, what sliding took or gave included [M c^2].
    """
    if step.dt > step.limit:
        text = f"the step {step.dt:.4g} R/c is beyond the stability limit {step.limit:.4g} R/c"
        return Diagnosis(text, "set time.dt: auto")
    if model.elastic and (slide := _slide(lattice, model.elastic, before, after, gained)):
        return slide
    point, force = _hardest_push(lattice, model, step, before, after)
    try:
        now = step_limit(spectrum(replace(lattice, positions=before), model), model, step.integrator, force)
    except TaichiDiskError:
        now = step.limit
    if step.dt > now:
        pushed = step_limit(spectrum(lattice, model), model, step.integrator, force)
        why = "by the springs' strain"
        if model.wall and pushed < 1.5 * now:
            why = f"where the wall pushes point {point} with {force:.3g} M c^2/R"
        return Diagnosis(
            f"the stability limit has fallen from {step.limit:.3g} to {now:.3g} R/c, {why}, and the step is "
            f"{step.dt:.3g} R/c",
            f"set time.dt below {now:.2g}; a lower speed or a softer wall helps too",
        )
    strain = np.abs(model.springs.strain(lattice, before)).max()
    return Diagnosis(
        f"the body may be crushed: springs are strained by up to {strain:.0%}; the step is {step.dt / now:.2f} of the "
        "stability limit",
        "lower impact.velocity or compression.pressure, raise material.k_a, or try a smaller time.safety",
    )


def _hardest_push(lattice: Lattice, model: Model, step: TimeStep, before: Array, after: Array) -> tuple[int, float]:
    """The point that the wall pushes hardest, and how hard [M c^2/R].

    A point that got deep into the wall in one step would have needed the force that stops it alone, a m v^2/2.
    """
    wall = model.wall
    if wall is None:
        return 0, 0.0

    def push(x: Array) -> Array:
        force = np.zeros(len(x))
        points, forces = wall.contact_forces(lattice, x)
        force[points] = np.hypot(*forces.T)
        return force

    stopping = 0.5 * wall.a * lattice.masses[0] * (((after - before) / step.dt) ** 2).sum(axis=1)
    force = np.fmax(push(before), np.fmin(push(after), stopping))
    point = int(force.argmax())
    return point, float(force[point])


def _slide(lattice: Lattice, wall: ElasticWall, before: Array, after: Array, gained: float) -> Diagnosis | None:
    """The point that has passed from one surface spring to another, if that made most of the energy's change."""
    springs, energies = np.full((2, lattice.disk_points), -1), np.zeros((2, lattice.disk_points))
    for k, x in enumerate((before, after)):
        found = wall.contacts(lattice, x)
        springs[k, found.points], energies[k, found.points] = found.springs, found.energy
    jump = np.where(springs[0] != springs[1], energies[1] - energies[0], 0.0)
    i = int(np.abs(jump).argmax())
    if jump[i] == 0.0 or (np.isfinite(gained) and abs(jump[i]) < 0.3 * abs(gained)):
        return None
    (left, reached), (old, new) = springs[:, i], energies[:, i]
    way = "over or under the wall's surface from beside it, or away"
    if min(left, reached) >= 0:
        way = f"from the wall's surface spring {left} to {reached}"
    return Diagnosis(
        f"point {i} slid {way}: its contact potential is {new:.3g} instead of {old:.3g} M c^2",
        "lower impact.velocity or raise material.k_a; at the wall's end, a wider one (wall.width)",
        step_independent=True,
    )


def worst_place(model: Model, lattice: Lattice, x: Array) -> str:
    """The point or spring in which the state is worst, in words."""
    lost = np.flatnonzero(~np.isfinite(x).all(axis=1))
    if len(lost):
        return f"{len(lost)} of {len(x)} points have no position, among them point {lost[0]}"
    strain = model.springs.strain(lattice, x)
    worst = int(np.abs(strain).argmax())
    i, j = lattice.bonds[worst]
    return f"spring {worst} between points {i} and {j} strained by {strain[worst]:+.3g}"
