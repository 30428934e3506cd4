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


def apexes(columns: Columns) -> list[int]:
    """Return the rows at which the centre of mass begins to fall, above the height of
    its start: one after each bounce under gravity."""
    v = columns["com_vy"]
    is_high = columns["com_y"] > columns["com_y"][0]
    falls = (v[:-1] > 0.0) & (v[1:] <= 0.0) & is_high[1:]
    return (np.flatnonzero(falls) + 1).tolist()


def flights(columns: Columns) -> list[int]:
    """Return one row of each flight: the first row, then the apexes; the last row if
    there is none."""
    return [0, *(apexes(columns) or [len(columns["t"]) - 1])]


def restitutions(
    columns: Columns, before: float, gravity: float, surface: float
) -> list[float]:
    """Return e of each bounce: the ratio of the speeds after and before it, without the
    wall, with the centre of mass at the height `surface` [R]; 0 if the disk stays on
    the wall. `before`: speed before the first bounce [c], unless it falls faster."""
    energy = 0.5 * columns["com_vy"] ** 2 + np.maximum(columns["wall"], 0.0)
    energy += gravity * (columns["com_y"] - surface)
    speeds = np.sqrt(2.0 * np.maximum(energy[flights(columns)], 0.0))
    if gravity:
        before = max(before, speeds[0])
        speeds[1:] *= bool(apexes(columns))
    speeds[0] = before
    return (speeds[1:] / speeds[:-1]).tolist()


class Contact:
    """The contact of wall and disk in the time series `columns` of a run; of several
    bounces that of the number `bounce`, from 0.

    Attributes:
        start, end: first and last time at which the wall's force crosses CONTACT_LEVEL
            of its peak [R/c], log-linear between samples. If no sample of a very short
            contact has a force, the times of the samples between which the disk turned
            back.
    """

    def __init__(self, columns: Columns, bounce: int = 0) -> None:
        before, after = flights(columns)[bounce : bounce + 2]
        columns = {name: values[before : after + 1] for name, values in columns.items()}
        self._columns = columns
        t = columns["t"]
        force = columns["wall_force"]
        level = CONTACT_LEVEL * force.max()
        self._touches = force >= level
        if not force.any():
            turned = np.argmax(columns["com_vy"] > 0.0)
            self.start = float(t[turned - 1])
            self.end = float(t[turned])
            return
        # above the level, as a logarithm
        height = np.log(np.maximum(force, 1e-300)) - np.log(level)

        def crossing(i: int) -> float:
            """Return the time between rows i and i + 1 at which the height is 0."""
            duration = t[i + 1] - t[i]
            return float(t[i] + duration * height[i] / (height[i] - height[i + 1]))

        inside = np.flatnonzero(self._touches)
        first, last = inside[[0, -1]]
        self.start = float(t[0])
        self.end = float(t[-1])
        if first > 0:
            self.start = crossing(first - 1)
        if last + 1 < len(t):
            self.end = crossing(last)

    @property
    def first_sample(self) -> float:
        """Time of the first sample in contact [R/c]."""
        return float(self._columns["t"][self._touches.argmax()])

    @property
    def greatest(self) -> float:
        """Time of the greatest compression [R/c], at which the elastic energy is
        largest during contact.

        If a spin stretches the disk before the contact, the time at which the centre of
        mass is lowest.
        """
        elastic = self._columns["elastic"]
        touches = self._touches
        stored = elastic * touches
        stored_before_contact = elastic[: touches.argmax()].max(initial=0.0)
        row = stored.argmax()
        if stored_before_contact > STRETCHED * stored.max():
            row = self._columns["com_y"].argmin()
        return float(self._columns["t"][row])

    # ---- what is measured at its end

    @property
    def results_time(self) -> float:
        """Time at which spin and vibration are measured [R/c]: the end of the last
        contact."""
        # Afterwards dashpots reduce both. Without losses, they are measured at the end
        # of the run, far from the wall.
        if self._columns["dissipated"][-1] or self._columns["absorbed"][-1]:
            return self.end
        return float(self._columns["t"][-1])

    @property
    def vibration_left(self) -> float:
        """Energy of the vibration at `results_time`, kinetic and elastic, over that of
        the flight at t = 0."""
        stored = self._vibration
        left = np.interp(self.results_time, self._columns["t"], stored) - stored[0]
        return float(left / self._columns["translation"][0])

    @property
    def vibration_change(self) -> float:
        """Change of the vibration's energy between the rows before and after
        `results_time`, over the flight's energy at t = 0."""
        stored = self._vibration
        after = np.searchsorted(self._columns["t"], self.results_time)
        change = abs(stored[after] - stored[after - 1])
        return float(change / self._columns["translation"][0])

    @property
    def _vibration(self) -> Array:
        """Kinetic and elastic energy of vibration (rows,) [M c^2]."""
        return self._columns["vibration"] + self._columns["elastic"]


def contacts_of(columns: Columns) -> list[Contact]:
    """Return the contact of each bounce."""
    return [Contact(columns, k) for k in range(len(flights(columns)) - 1)]


def energy_error(columns: Columns) -> float:
    """Return the energy that a finished run has gained or lost by its errors, over the
    flight's energy at t = 0."""
    total = columns["total"]
    return float(abs(total[-1] - total[0]) / columns["translation"][0])
