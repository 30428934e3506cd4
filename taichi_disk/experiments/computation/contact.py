"""The contact of wall and disk: its duration, and the quantities measured at its
end."""

from __future__ import annotations

import numpy as np

from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.simulation.observables import Columns

# contact lasts while the wall's force exceeds this fraction of its peak
CONTACT_LEVEL = 0.01
# a disk that stores more than this fraction of its contact energy in flight is
# stretched
STRETCHED = 0.1


def contact_interval(columns: Columns) -> tuple[float, float]:
    """Return the first and last times at which the wall's force crosses CONTACT_LEVEL
    of its peak, log-linear between samples.

    If no sample of a very short contact has a force, return the sample times between
    which the disk turned back.
    """
    t = columns["t"]
    force = columns["wall_force"]
    if not force.any():
        turned = int(np.argmax(columns["com_vy"] > 0.0))
        return float(t[turned - 1]), float(t[turned])
    level = CONTACT_LEVEL * force.max()
    # above the level, as a logarithm
    height = np.log(np.maximum(force, 1e-300)) - np.log(level)

    def crossing(i: int) -> float:
        """Return the time between rows i and i + 1 at which the height is 0."""
        duration = t[i + 1] - t[i]
        return float(t[i] + duration * height[i] / (height[i] - height[i + 1]))

    inside = np.flatnonzero(force >= level)
    first = int(inside[0])
    last = int(inside[-1])
    start = float(t[0])
    end = float(t[-1])
    if first > 0:
        start = crossing(first - 1)
    if last + 1 < len(t):
        end = crossing(last)
    return start, end


def results_time(columns: Columns) -> float:
    """Return the time at which spin and vibration are measured [R/c]: the end of the
    last contact."""
    # Afterwards dashpots reduce both. Without losses, they are measured at the end of
    # the run, far from the wall.
    t = columns["t"]
    if not (columns["dissipated"][-1] or columns["absorbed"][-1]):
        return float(t[-1])
    return contact_interval(columns)[1]


def vibration_left(columns: Columns) -> float:
    """Return the vibration's energy at `results_time`, kinetic and elastic, over the
    flight's energy at t = 0."""
    stored = _of_vibration(columns)
    left = np.interp(results_time(columns), columns["t"], stored) - stored[0]
    return float(left / columns["translation"][0])


def vibration_change(columns: Columns) -> float:
    """Return the change of the vibration's energy between the rows before and after
    `results_time`, over the flight's energy at t = 0."""
    stored = _of_vibration(columns)
    after = np.searchsorted(columns["t"], results_time(columns))
    return float(abs(stored[after] - stored[after - 1]) / columns["translation"][0])


def energy_error(columns: Columns) -> float:
    """Return the energy that a finished run has gained or lost by its errors, over the
    flight's energy at t = 0."""
    total = columns["total"]
    return float(abs(total[-1] - total[0]) / columns["translation"][0])


def _of_vibration(columns: Columns) -> Array:
    """Return the kinetic and elastic energy of vibration (rows,) [M c^2]."""
    return columns["vibration"] + columns["elastic"]


def greatest_compression(columns: Columns) -> float:
    """Return the time at which the elastic energy is largest during contact [R/c].

    If a spin stretches the disk before the contact, return the time at which the centre
    of mass is lowest.
    """
    force = columns["wall_force"]
    elastic = columns["elastic"]
    touches = force >= CONTACT_LEVEL * force.max()
    stored = elastic * touches
    stored_before_contact = elastic[: int(touches.argmax())].max(initial=0.0)
    row = stored.argmax()
    if stored_before_contact > STRETCHED * stored.max():
        row = columns["com_y"].argmin()
    return float(columns["t"][int(row)])
