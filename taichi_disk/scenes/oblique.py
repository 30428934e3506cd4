"""Tangential results of impacts at an angle, with a spin or with friction: restitution,
spin, impulses."""

from __future__ import annotations

from math import log, pi, sqrt, tan
from typing import Any

import numpy as np

from taichi_disk.computation.contact import results_time
from taichi_disk.config import sections
from taichi_disk.lattice import Array
from taichi_disk.simulation.observables import Columns

# Label, unit and definition of each result.
RESULTS = {
    "tangential_restitution": (
        "tangential restitution",
        "",
        (
            "-(v_t + omega R) of the disk's lowest point, after over before; v_t to the"
            " right, omega counter-clockwise"
        ),
    ),
    "spin_after": (
        "spin after",
        "c/R",
        (
            "angular momentum at the end of the last contact over the unloaded moment"
            " of inertia"
        ),
    ),
    "tangential_impulse": (
        "tangential impulse",
        "M c",
        "of the wall on the disk, to the right: change of v_t times M",
    ),
    "normal_impulse": (
        "normal impulse",
        "M c",
        "of the wall on the disk, upwards: change of v_n times M",
    ),
}
START_POTENTIAL = 1e-7  # wall potential at the start over the kinetic energy
# largest error along the wall, where friction jumps, over the error normal to it
TANGENTIAL_FACTOR = 10.0
# fraction of the speed: a slower lowest point has no tangential restitution
MIN_TANGENTIAL = 1e-9


def along_the_wall(columns: Columns, radius: float, inertia: float) -> dict[str, float]:
    """Return the numbers of RESULTS; a lowest point at rest has no tangential
    restitution.

    `columns` is the time series of a finished impact; `radius` [R] and `inertia` [M
    R^2] belong to the unloaded disk.
    """
    end, t = results_time(columns), columns["t"]
    vx, vy, spin = (
        columns[name][[0, -1]] for name in ("com_vx", "com_vy", "angular_momentum")
    )
    # After that time only the moment of the wall's tangential impulse changes the
    # rotation.
    spin[1] = np.interp(end, t, columns["angular_momentum"]) + radius * (
        vx[1] - np.interp(end, t, columns["com_vx"])
    )
    before, after = (vx + spin / inertia * radius).tolist()
    found = (
        {}
        if abs(before) <= MIN_TANGENTIAL * abs(vy[0])
        else {"tangential_restitution": -after / before}
    )
    return found | {
        "spin_after": float(spin[1] / inertia),
        "tangential_impulse": float(vx[1] - vx[0]),
        "normal_impulse": float(vy[1] - vy[0]),
    }


def scales_along_the_wall(
    columns: Columns, radius: float, inertia: float
) -> dict[str, float]:
    """Return the largest error of each of RESULTS if the normal impulse has a relative
    error of 1."""
    vx, vy, spin = (
        float(columns[name][0]) for name in ("com_vx", "com_vy", "angular_momentum")
    )
    turned, lowest = radius / inertia, abs(vx + spin / inertia * radius)
    scales = {
        "normal_impulse": 1.0,
        "tangential_impulse": TANGENTIAL_FACTOR,
        "spin_after": TANGENTIAL_FACTOR * turned,
    }
    if lowest:
        scales["tangential_restitution"] = (
            TANGENTIAL_FACTOR * (1.0 + turned * radius) / lowest
        )
    return {name: abs(vy) * scale for name, scale in scales.items()}


def start_gap(
    wall: sections.WallSection | sections.ElasticWallSection,
    impact: sections.ImpactSection,
    time: sections.TimeSection,
    heights: Array | float = 0.0,
    potential: float = START_POTENTIAL,
) -> float:
    """Return the distance of the lowest point from the wall at the start [R].

    With `impact.gap: auto` the wall's potential there is the kinetic energy times
    `potential`, or times `time.tolerance` if that is smaller; `heights` as for
    `wall.height_of`.
    """
    if impact.gap != "auto":
        return impact.gap
    if time.tolerance != "none":
        potential = min(potential, time.tolerance)
    return max(
        wall.height_of(potential * 0.5 * impact.towards**2, heights), wall.decay_length
    )


def least_width(
    wall: Any,
    impact: sections.ElasticImpactSection,
    time: sections.TimeSection,
    k_a: float,
) -> float:
    """Return the width [R] that an elastic wall needs to contain the whole contact; 0
    for an impact straight down."""
    # The middle of the contact moves with the disk for the contact time of Hertz's law.
    # The contact is half as wide as the chord at the depth v. `k_a` [M c^2/R^2]: spring
    # constant of the softer of disk and wall.
    if not impact.angle and impact.offset == "auto":
        return 0.0
    gap = start_gap(wall, impact, time)
    first = 0.0 if impact.offset == "auto" else impact.offset + gap * tan(impact.angle)
    strain = min(impact.towards / sqrt(k_a), 1.0)
    last = first + impact.along * pi * sqrt(log(4.0 / strain) / k_a)
    return 2.0 * (max(abs(first), abs(last)) + sqrt(2.0 * strain))
