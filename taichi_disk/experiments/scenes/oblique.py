"""Tangential results of impacts at an angle, with a spin or with friction: restitution,
spin, impulses."""

from __future__ import annotations

from math import cos, log, pi, sin, sqrt, tan
from typing import Any

import numpy as np

from taichi_disk.experiments.computation.contact import Contact
from taichi_disk.experiments.computation.words import Numbers
from taichi_disk.experiments.config import sections
from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.potential import ExponentialPotential
from taichi_disk.mechanics.simulation.observables import Columns

LABELS = {
    "tangential_restitution": ("tangential restitution", ""),
    "spin_after": ("spin after", "c/R"),
    "tangential_impulse": ("tangential impulse", "M c"),
    "normal_impulse": ("normal impulse", "M c"),
}
MEASURED = {
    "tangential_restitution": (
        "-(v_t + omega h), after over before; v_t to the right, omega"
        " counter-clockwise, h: height of the centre of mass above the lowest point"
        " of the unloaded body, turned as it meets the wall"
    ),
    "spin_after": (
        "angular momentum at the end of the last contact over the unloaded moment"
        " of inertia"
    ),
    "tangential_impulse": (
        "of the wall on the disk, to the right: change of v_t times M"
    ),
    "normal_impulse": "of the wall on the disk, upwards: change of v_n times M",
}
START_POTENTIAL = 1e-7  # wall potential at the start over the kinetic energy
# largest error along the wall, where friction jumps, over the error normal to it
TANGENTIAL_FACTOR = 10.0
# Fraction of the speed. The tangential restitution divides by the lowest point's speed
# along the wall: at 1e-3 of the speed of the flight it was 6.6.
MIN_TANGENTIAL = 0.01


def along_the_wall(columns: Columns, outline: Array, inertia: float) -> Numbers:
    """Return the numbers of LABELS; a lowest point almost at rest has no tangential
    restitution.

    `columns` is the time series of a finished impact. `outline` (k, 2) [R]: surface
    points of the unloaded disk at t = 0, from its centre of mass. `inertia` [M R^2]: of
    the unloaded disk.
    """
    end = Contact(columns).results_time
    t = columns["t"]
    vx = columns["com_vx"]
    vy = columns["com_vy"]
    spin = columns["angular_momentum"]
    # After the last contact only the moment of the wall's tangential impulse changes
    # the rotation.
    late_impulse = vx[-1] - np.interp(end, t, vx)
    arm = np.interp(end, t, columns["com_y"] - columns["lowest_y"])
    spin_before = spin[0] / inertia
    spin_after = (np.interp(end, t, spin) + arm * late_impulse) / inertia
    found = {}
    height = _height_at_contact(columns, outline, inertia)
    before = vx[0] + spin_before * height
    if abs(before) > MIN_TANGENTIAL * np.hypot(vx[0], vy[0]):
        after = vx[-1] + spin_after * height
        found["tangential_restitution"] = -after / before
    found["spin_after"] = spin_after
    found["tangential_impulse"] = vx[-1] - vx[0]
    found["normal_impulse"] = vy[-1] - vy[0]
    return {name: float(number) for name, number in found.items()}


def _height_at_contact(columns: Columns, outline: Array, inertia: float) -> float:
    """Return the height of the centre of mass above the lowest point of the unloaded
    body [R], turned as the body is when it meets the wall."""
    t = columns["t"]
    start = Contact(columns).start
    mean_spin = columns["angular_momentum"][t <= start].mean() / inertia
    angle = mean_spin * start
    x, y = outline.T
    return -(sin(angle) * x + cos(angle) * y).min()


def scales_along_the_wall(columns: Columns, outline: Array, inertia: float) -> Numbers:
    """Return the largest error of each of LABELS if the normal impulse has a relative
    error of 1. Arguments as for `along_the_wall`."""
    vx, vy, spin = (
        columns[name][0] for name in ("com_vx", "com_vy", "angular_momentum")
    )
    height = _height_at_contact(columns, outline, inertia)
    spin_per_impulse = height / inertia
    tangential_speed = abs(vx + spin * spin_per_impulse)
    scales = {
        "normal_impulse": 1.0,
        "tangential_impulse": TANGENTIAL_FACTOR,
        "spin_after": TANGENTIAL_FACTOR * spin_per_impulse,
    }
    if tangential_speed:
        scales["tangential_restitution"] = (
            TANGENTIAL_FACTOR * (1.0 + spin_per_impulse * height) / tangential_speed
        )
    return {name: float(abs(vy) * scale) for name, scale in scales.items()}


def start_gap(
    wall: ExponentialPotential,
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
    for an impact straight down. `k_a` [M c^2/R^2]: spring constant of the softer of
    disk and wall."""
    if not impact.angle and impact.offset == "auto":
        return 0.0
    # The middle of the contact moves along the wall for the contact time of Hertz's
    # law.
    start = 0.0
    if impact.offset != "auto":
        gap = start_gap(wall, impact, time)
        start = impact.offset + gap * tan(impact.angle)
    depth = min(impact.towards / sqrt(k_a), 1.0)  # [R], speed over that of waves
    end = start + impact.along * pi * sqrt(log(4.0 / depth) / k_a)
    # By Hertz's law the contact is half as wide as the chord at this depth. Room is
    # left for twice as much.
    half_chord = sqrt(2.0 * depth)
    return 2.0 * (max(abs(start), abs(end)) + half_chord)
