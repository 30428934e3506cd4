"""What an impact at an angle, with a spin or with friction, gives beside e: what happened along the wall."""

from __future__ import annotations

from math import log, pi, sqrt, tan

import numpy as np

from taichi_disk.computation.contact import results_time
from taichi_disk.config.sections import (
    ElasticImpactSection,
    ElasticWallSection,
    ImpactSection,
    TimeSection,
    WallSection,
)
from taichi_disk.lattice import Array
from taichi_disk.simulation.observables import Columns

# Results, each with its name, its unit and how it is measured.
RESULTS = {
    "tangential_restitution": (
        "tangential restitution",
        "",
        "-(v_t + omega R) after over before, of the disk's lowest point; v_t to the right, omega counter-clockwise",
    ),
    "spin_after": (
        "spin after",
        "c/R",
        "angular momentum at the end of the last contact over the unloaded moment of inertia",
    ),
    "tangential_impulse": ("tangential impulse", "M c", "of the wall on the disk, to the right: change of v_t times M"),
    "normal_impulse": ("normal impulse", "M c", "of the wall on the disk, upwards: change of v_n times M"),
}
START_POTENTIAL = 1e-7  # of the wall at the start, as a fraction of the kinetic energy
ALONG = 10.0  # errors along the wall, where friction jumps, over those away from it, at most, about
STILL = 1e-9  # of the speed: a slower lowest point has no restitution


def along_the_wall(columns: Columns, radius: float, inertia: float) -> dict[str, float]:
    """The numbers of RESULTS; no restitution of a lowest point that was at rest.

    Args:
        columns: the time series of an ended impact.
        radius, inertia: of the unloaded disk [R], [M R^2].
    """
    end, t = results_time(columns), columns["t"]
    vx, vy, spin = (columns[name][[0, -1]] for name in ("com_vx", "com_vy", "angular_momentum"))
    # What the wall still does to the rotation afterwards is the moment of its tangential impulse.
    spin[1] = np.interp(end, t, columns["angular_momentum"]) + radius * (vx[1] - np.interp(end, t, columns["com_vx"]))
    before, after = (vx + spin / inertia * radius).tolist()
    found = {} if abs(before) <= STILL * abs(vy[0]) else {"tangential_restitution": -after / before}
    return found | {
        "spin_after": float(spin[1] / inertia),
        "tangential_impulse": float(vx[1] - vx[0]),
        "normal_impulse": float(vy[1] - vy[0]),
    }


def scales_along_the_wall(columns: Columns, radius: float, inertia: float) -> dict[str, float]:
    """By how much each of RESULTS is off if the normal impulse is off by the momentum of the flight to the wall."""
    vx, vy, spin = (float(columns[name][0]) for name in ("com_vx", "com_vy", "angular_momentum"))
    turned, lowest = radius / inertia, abs(vx + spin / inertia * radius)
    scales = {"normal_impulse": 1.0, "tangential_impulse": ALONG, "spin_after": ALONG * turned}
    if lowest:
        scales["tangential_restitution"] = ALONG * (1.0 + turned * radius) / lowest
    return {name: abs(vy) * scale for name, scale in scales.items()}


def start_gap(
    wall: WallSection | ElasticWallSection,
    impact: ImpactSection,
    time: TimeSection,
    heights: Array | float = 0.0,
    potential: float = START_POTENTIAL,
) -> float:
    """Return the distance of the lowest point from the wall at the start [R].

    With `impact.gap: auto` the wall's potential there is `potential` times the kinetic energy, or `time.tolerance`
    times if that is less; `heights` as for `wall.height_of`.
    """
    if impact.gap != "auto":
        return impact.gap
    if time.tolerance != "none":
        potential = min(potential, time.tolerance)
    return max(wall.height_of(potential * 0.5 * impact.towards**2, heights), wall.decay_length)


def least_width(wall: ElasticWallSection, impact: ElasticImpactSection, time: TimeSection, k_a: float) -> float:
    """Width [R] with which an elastic wall ends nowhere in the contact of a disk that is thrown so; 0 if straight down.

    The middle of the contact moves along with the disk for its time, that of Hertz's law, and the contact is half as
    wide as the chord at the depth v. `k_a`: of the softer of the two [M c^2/R^2].
    """
    if not impact.angle and impact.offset == "auto":
        return 0.0
    gap = start_gap(wall, impact, time)
    first = 0.0 if impact.offset == "auto" else impact.offset + gap * tan(impact.angle)
    strain = min(impact.towards / sqrt(k_a), 1.0)
    last = first + impact.along * pi * sqrt(log(4.0 / strain) / k_a)
    return 2.0 * (max(abs(first), abs(last)) + sqrt(2.0 * strain))
