"""Curves of the hit on display, and the scales of its pictures: the values of full
colour and of the longest arrow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.mechanics.fields import QUANTITIES
from taichi_disk.mechanics.lattice import Array
from taichi_disk.mechanics.simulation.observables import INDEX, of_kind, split
from taichi_disk.pictures.curves import LOOKS
from taichi_disk.pictures.render.palette import full_scale, round_near
from taichi_disk.pictures.web.drawing import Message
from taichi_disk.sandbox.history import LOSSES, Segment, Timeline
from taichi_disk.sandbox.sandbox import Sandbox, load_key, value_of

MAX_CURVE_POINTS = 400  # most points of a curve
_ENERGIES = [*of_kind("part"), "elastic", "wall", *of_kind("loss")]
# Graph and name of each curve, and its colours, which are those of films. The names
# "flight" and "motion" depend on the scene.
CURVES = [
    *(("energy", LOOKS[name].name, *LOOKS[name].colours) for name in _ENERGIES),
    ("energy", "height", *LOOKS["load"].colours),
    ("force", "force of the wall", *LOOKS["wall_force"].colours),
    ("motion", "motion", *LOOKS["com_vy"].colours),
]


def graphs(time: Timeline) -> Message:
    """Return times since the hit on display began [R/c] and the values of CURVES, at
    most MAX_CURVE_POINTS of each."""
    inertia = time.start.body.inertia
    parts = []
    for segment in time.hit_segments:
        stored = segment.began + np.arange(segment.count) * segment.interval
        times = np.append(stored, segment.now) - segment.hit_began
        rows = np.vstack([segment.rows, segment.row])
        parts.append(np.column_stack([times, curve_values(segment, rows, inertia)]))
    known = np.concatenate(parts)
    chosen = np.unique(np.linspace(0, len(known) - 1, MAX_CURVE_POINTS).astype(int))
    t, *values = [_five_digits(curve) for curve in known[chosen].T]
    scenario = time.segment.scenario
    return {
        "t": t,
        "values": values,
        "motion": scenario.words.momentary,
        "flight": "flight" if scenario.is_thrown else "motion",
    }


def curve_values(segment: Segment, rows: Array, inertia: float) -> Array:
    """Return CURVES (rows, curves) of observables (rows, k) of a segment: energies [M
    c^2], force [M c^2/R], velocity or ξ. `inertia` [M R^2]: of the unloaded disk."""
    rows = rows.copy()
    rows[:, LOSSES] += segment.lost_before
    columns = split(dict(zip(INDEX, rows.T, strict=True)), inertia)
    scenario: Any = segment.scenario
    curves = [columns[name] for name in _ENERGIES]
    height = np.zeros(len(rows))
    if scenario.falls_back:
        height = scenario.scene.impact.gravity * scenario.motion(columns)
    curves += [height, columns["wall_force"], scenario.momentary_motion(columns)]
    return np.stack(curves, axis=1)


def _five_digits(curve: Array) -> list[float]:
    return [float(f"{value:.5g}") for value in curve]


# A load P is like an impact at this speed times P^0.7 (measured in the same way).
_SPEED_OF_LOAD = 0.75
_USUAL_POINTS = 1100  # points of the disks for which "force" above holds
_GROWTH = 2.0  # factor by which a scale grows
# ratio of a value to its scale from which on the scale grows; colours end before that
_EXCESS = 1.5
# smallest ratio of a scale to its estimate; smaller values are rounding errors
_SMALLEST = 1e-6


class ScaleMaxima:
    """Scales of colours and arrows. They are estimated before a throw and stay; if they
    must grow, they double.

    Attributes:
        colour: value of full colour, in units of the quantity; for fringes the stress
            from one fringe to the next.
        force: force of the wall on one point at the longest arrow [M c^2/R].
        note: text for the user if the colour scale has grown since the last start.
    """

    colour = force = 1.0
    note = ""
    _estimate = 1.0
    _key: tuple[int, float, str] | None = None

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox

    def update(self, values: NDArray[Any], forces: NDArray[Any], quantity: str) -> None:
        """Enlarge the scales to hold the disk's `values` (N,) of a quantity, and the
        wall's `forces` (k, 3): point, fx, fy."""
        segment = self._sandbox.time.display.segment
        key = self._sandbox.starts, segment.hit_began, quantity
        if key != self._key:
            self._key = key
            self.note = ""
            self._estimate = estimate_full(segment.scenario, quantity)
            self.colour = self._estimate
            self.force = round_near(segment.scenario.point_force)
        # a percentile takes longer than a maximum
        if np.abs(values).max() >= self.colour:
            self._fit(full_scale(values.astype(np.float64), quantity))
        greatest = float(np.hypot(forces[:, 1], forces[:, 2]).max(initial=0.0))
        self.force = _grown(self.force, greatest)

    def _fit(self, largest: float) -> None:
        if self.colour == 0.0:
            is_noise = largest < _SMALLEST * self._estimate
            self.colour = self._estimate if is_noise else largest
        before = self.colour
        self.colour = _grown(self.colour, largest)
        if self.colour > before:
            self.note = f"the colour scale has grown: it ends at {self.colour:g}"

    def rescale(self) -> None:
        """Fit the colour scale to the next picture alone; to the estimate if that
        picture shows rounding errors only."""
        self.colour = 0.0
        self.note = ""


def estimate_full(scenario: Scenario, quantity: str) -> float:
    """Return the round value of full colour that suits the greatest compression, in the
    quantity's unit."""
    scene = scenario.scene
    load = value_of(scene, load_key(scene))
    speed = load if scenario.is_thrown else _SPEED_OF_LOAD * load**0.7
    points = scenario.lattice.disk_points
    full = QUANTITIES[quantity].full * speed
    if quantity in ("speed", "kinetic"):
        spin = value_of(scene, "impact.spin") or 0.0
        full = max(full, abs(spin))
    if quantity == "kinetic":
        full = 0.5 * full**2 / points
    if quantity == "force":
        full *= (_USUAL_POINTS / points) ** 0.5
    return round_near(full)


def _grown(scale: float, value: float) -> float:
    """Return `scale`, doubled until `value` exceeds it by less than _EXCESS."""
    while value > _EXCESS * scale:
        scale *= _GROWTH
    return scale
