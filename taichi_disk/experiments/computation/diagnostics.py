"""Check a run: its energy balance, points that went through the wall, and messages
about what is wrong."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_disk.base.errors import SimulationError
from taichi_disk.experiments.computation.contact import Contact, apexes
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.computation.words import Numbers
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.triangles import double_area
from taichi_disk.mechanics.physics import ElasticWall
from taichi_disk.mechanics.simulation.observables import (
    BY_NAME,
    INDEX,
    Columns,
    of_kind,
    total_energy,
)

# largest imbalance at the end and at any time without a shorter step
MAX_CLOSING = 2e-5
MAX_WORST = 1e-4
# largest imbalance at the end of a valid run; more would show in the third digit of e
MAX_IMBALANCE = 1e-3
# smallest angular momentum of a disk that spins, over 1 R times the momentum of its
# flight
MIN_SPIN = 1e-3
MAX_SPIN_LOSS = 0.01  # fraction that may be lost in flight without a warning
BLOW_UP = 0.1  # imbalance over the largest energy so far at which a run is ended


def relative_imbalance(scenario: Scenario, columns: Columns) -> tuple[float, float]:
    """Return the signed imbalance at the end and the largest absolute one, divided by
    the scenario's energy scale."""
    lost = (columns["total"] - columns["total"][0]) / scenario.energy_scale(columns)
    return float(lost[-1]), float(np.abs(lost).max())


def summary(scenario: Scenario, columns: Columns) -> dict[str, Any]:
    names = of_kind("energy", "loss", "part")
    found = {name: float(columns[name][-1]) for name in names}
    if columns["translation"][0]:
        found["vibration_left"] = Contact(columns).vibration_left
    closing, worst = relative_imbalance(scenario, columns)
    found["scale"] = scenario.energy_scale(columns)
    found["closing_imbalance"] = closing
    found["worst_imbalance"] = worst
    return found


def unacceptable(scenario: Scenario, columns: Columns) -> str:
    lost, _ = relative_imbalance(scenario, columns)
    tolerance = scenario.scene.time.tolerance
    allowed = MAX_IMBALANCE if tolerance == "none" else max(MAX_IMBALANCE, tolerance)
    if abs(lost) <= allowed:
        return ""
    return (
        f"the energy imbalance at the end is {lost:+.2g}, more than {allowed:g}: the"
        " step is too long for this motion; set time.dt: auto, with time.safety: 0.1"
        " if that is not enough, or a shorter time.dt"
    )


def warnings(scenario: Scenario, columns: Columns) -> list[str]:
    candidates = [
        inside_out(columns),
        unacceptable(scenario, columns),
        _sliding(scenario, columns),
        _rotation_lost(scenario, columns),
        _at_rest(scenario, columns),
    ]
    return [text for text in candidates if text]


def inside_out(columns: Columns) -> str:
    count = int(columns["inverted"].max())
    if not count:
        return ""
    return (
        f"{count} of the lattice's triangles turned inside out: springs have crossed"
        " there, and the result is meaningless; lower the speed or the pressure, or"
        " take fewer points"
    )


def _sliding(scenario: Scenario, columns: Columns) -> str:
    loss = np.abs(columns["sliding"]).max()
    fraction = loss / scenario.energy_scale(columns)
    if fraction <= MAX_IMBALANCE:
        return ""
    return (
        "points of the disk slid from spring to spring of the dented wall, which"
        f" changed the energy by {fraction:.2g} of the kinetic energy: the contact law"
        " does this at any time step, and it limits the accuracy of e; write"
        " wall.contact: smooth, which has no such jumps, or a lower"
        " impact.velocity or a higher material.k_a"
    )


def energy_gained(scenario: Scenario, columns: Columns, error: float | None) -> Numbers:
    """Return from where an impact with e above 1 took energy, and where it lost energy
    (negative), by name, as fractions of the energy of the flight towards the wall. They
    add up to e^2 - 1. Empty if e is not above 1 by more than
    its `error` (None: unknown)."""
    if not scenario.is_thrown:
        return {}
    _, restitution = scenario.primary(columns)
    if error is None:
        error = MAX_IMBALANCE
    if restitution <= 1.0 + error:
        return {}
    flight = 0.5 * columns["com_vy"][0] ** 2  # the mass is 1 M
    stored = {
        "spin": columns["rotation"],
        "flight along the wall": 0.5 * columns["com_vx"] ** 2,
        "vibration": columns["vibration"] + columns["elastic"],
    }
    for name in of_kind("loss"):
        if columns[name].any():
            stored[BY_NAME[name].label] = columns[name]
    return {name: (energy[0] - energy[-1]) / flight for name, energy in stored.items()}


def parts_text(gained: Numbers) -> str:
    parts = {name: round(part, 6) + 0.0 for name, part in gained.items()}  # no "-0"
    return ", ".join(f"{part:+.3g} from {name}" for name, part in parts.items())


def faster_than_before(gained: Numbers) -> str:
    """Return a warning about energy that became flight away from the wall."""
    source = max(gained, key=lambda name: gained[name])
    remedy = {
        "spin": "with a smaller spin",
        "flight along the wall": "with a smaller impact.angle",
        "vibration": "without vibration at the start",
    }[source]
    return (
        "e exceeds one because the impact turned other energy into flight away from the"
        " wall. In units of the energy of the flight towards it this was"
        f" {parts_text(gained)}; {remedy} e measures the flight alone"
    )


def _at_rest(scenario: Scenario, columns: Columns) -> str:
    if not scenario.falls_back:
        return ""
    made = len(apexes(columns))
    asked = scenario.scene.impact.bounces
    if made >= asked:
        return ""
    return (
        f"{made} of {asked} bounces: then the energy of the disk did not suffice to"
        " lift it to the height of its start; a lower bounce does not count, and its e"
        " is 0, in means and curves, too"
    )


def _rotation_lost(scenario: Scenario, columns: Columns) -> str:
    if not scenario.model.springs.damped:
        return ""
    t = columns["t"]
    spin = columns["angular_momentum"]
    flight_speed = np.hypot(columns["com_vx"][0], columns["com_vy"][0])
    least = MIN_SPIN * flight_speed  # the mass is 1 M
    contact = Contact(columns)
    flights = {"before the contact": (t[0], contact.start)}
    if "spin_after" in scenario.result(columns):
        when = "after the contact, at the end of which results are measured"
        flights[when] = contact.results_time, t[-1]
    lost = []
    for when, flight in flights.items():
        first, last = np.interp(flight, t, spin)
        if abs(first) > least and abs(last - first) > MAX_SPIN_LOSS * abs(first):
            lost.append(f"{1.0 - last / first:.0%} of the angular momentum {when}")
    if not lost:
        return ""
    remedy = (
        "the paper's dashpots also resist rotation; with material.dashpot: axial they"
        " do not"
    )
    return f"dashpots took {' and '.join(lost)}: {remedy}"


class EnergyBalance:
    """The energy balance of a run, checked while its rows are computed, and whether the
    disk is still above its wall.

    `start`: the first row; `elastic`: the elastic wall, if there is one. `total`:
    energy without errors [M c^2].
    """

    def __init__(self, start: Array, elastic: ElasticWall | None) -> None:
        self.total = float(total_energy(start[None])[0])
        self._max_depth = np.inf
        if elastic is not None:
            # twice the depth that the potential permits
            potential = max(self.total, elastic.V0)
            self._max_depth = elastic.corner_depth - 2.0 * elastic.height_of(potential)
        self._load = start[INDEX["load"]]
        self._largest = self._size(start[None])[0]

    def first_lost(self, rows: Array) -> int | None:
        """Return the index of the first invalid row of the new `rows` (rows, columns),
        or None."""
        with np.errstate(invalid="ignore"):
            largest = np.maximum.accumulate(np.append(self._largest, self._size(rows)))
            imbalance = np.abs(self.imbalance(rows))
            lost = np.maximum(imbalance, np.abs(rows[:, INDEX["sliding"]]))
            allowed = BLOW_UP * largest[1:] + 1e-300
            # infinite: deep inside a wall
            is_valid = (lost <= allowed) & (lost < np.inf)
            is_valid &= rows[:, INDEX["depth"]] <= self._max_depth
        if not is_valid.all():
            return int(is_valid.argmin())
        self._largest = largest[-1]
        return None

    def _size(self, rows: Array) -> Array:
        """Return the energy scale of each row, against which the imbalance is judged,
        (rows,) [M c^2]."""
        names = ("kinetic", "elastic", "wall")
        stored = np.abs(rows[:, [INDEX[name] for name in names]]).sum(axis=1)
        work = np.abs(rows[:, INDEX["load"]] - self._load)
        return stored + work

    def give(self, energy: float) -> None:
        """Count energy [M c^2] that entered through `load` from outside, so that it is
        not an imbalance."""
        self.total += energy
        self._load += energy

    def imbalance(self, rows: Array) -> Array:
        """Return the deviation of the total energy from `total`, (rows,) [M c^2]."""
        return total_energy(rows) - self.total

    def loss(self, bad: Array) -> str:
        if not np.isfinite(bad).all():
            return "a number is no longer finite"
        if bad[INDEX["depth"]] > self._max_depth:
            return "the disk has gone through the surface of the wall"
        off = max(self.imbalance(bad[None])[0], bad[INDEX["sliding"]], key=abs)
        return f"the energy balance is off by {off:+.2g} of {self.total:.2g} M c^2"


# ---- a state that has become meaningless


class BlowUp(SimulationError):
    """The state became meaningless. `last_good`: positions and velocities (n, 2) and
    the time of the last valid row."""

    # pickle passes only `message`
    def __init__(self, message: str, last_good: dict[str, Array] | None = None) -> None:
        super().__init__(message)
        self.last_good = last_good or {}


class LostBalance(SimulationError):
    """The run came to its end, but its energy imbalance is too large for a result."""


def inverted_triangles(lattice: Lattice, x: Array) -> int:
    """Return how many triangles are turned inside out at the positions `x` (n, 2)."""
    return int((double_area(x[lattice.triangles]) < 0.0).sum())


def explained(scenario: Scenario, dt: float, part: float, x: Array, lost: str) -> str:
    """Return a message on what was `lost` after the last valid row, with advice.

    `dt` [R/c]: the step; `part`: `dt` as a fraction of the stability limit; `x` (n, 2)
    [R]: positions at that row.
    """
    lattice = scenario.lattice
    strain = scenario.model.springs.strain(lattice, x)
    worst = np.abs(strain).argmax()
    i, j = lattice.bonds[worst]
    auto = ""
    if scenario.scene.time.dt != "auto":
        auto = "set time.dt: auto; if that fails too, "
    if auto and part > 1.0:
        cause = "the step is beyond the stability limit: set time.dt: auto"
    elif scenario.model.elastic:
        cause = (
            "the disk may have dented the wall, gone through it or slipped off its"
            f" end: {auto}lower impact.velocity, raise material.k_a, or write a larger"
            " wall.width"
        )
    else:
        cause = (
            "the body may be crushed, or pushed harder than the step was chosen for:"
            f" {auto}lower impact.velocity or compression.pressure, raise material.k_a,"
            " or try a smaller time.safety"
        )
    return (
        f"{lost}; before that spring {worst} between points {i} and {j} was strained"
        f" most, by {strain[worst]:+.2g}; the step {dt:.4g} R/c is {part:.3g} of the"
        f" stability limit that the wall's force leaves; {cause}"
    )
