"""Curves of the hit on display, and the scales of its pictures: the values of full
colour and of the longest arrow."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Array
from taichi_disk.render.palette import full_scale, round_near
from taichi_disk.simulation.observables import (
    BLUE,
    BY_NAME,
    INDEX,
    PINK,
    of_kind,
    split,
)
from taichi_disk.window.sandbox import Sandbox, load_key, value_of

MAX_CURVE_POINTS = 400  # most points of a curve
# Graph, name and colour of each curve. The name of the last curve depends on the scene.
CURVES = (
    *(
        ("energy", BY_NAME[name].label, BY_NAME[name].colour)
        for name in ("translation", "rotation", "vibration")
    ),
    ("energy", "elastic and wall", BY_NAME["elastic"].colour),
    ("energy", "lost", BY_NAME["dissipated"].colour),
    ("force", "force of the wall", PINK),
    ("motion", "motion", BLUE),
)
_LOSSES = [INDEX[name] for name in of_kind("loss")]


class Graphs:
    """Curves of `sandbox`: a whole hit in `message`, and single moments of the same hit
    in `values`."""

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox

    def message(self) -> dict[str, Any]:
        """Return times since the hit began [R/c] and the values of CURVES, at most
        MAX_CURVE_POINTS of each."""
        body, segments = self._sandbox.time.body, self._sandbox.time.hit_segments
        self._inertia, self._scenario = body.inertia, segments[0].scenario
        began, parts = segments[0].hit_began, []
        for k, segment in enumerate(segments):
            self._lost_before = float(
                sum(one.row[_LOSSES].sum() for one in segments[:k])
            )
            times = (
                np.append(
                    segment.began + np.arange(segment.count) * segment.interval,
                    segment.now,
                )
                - began
            )
            parts.append(
                np.column_stack(
                    [times, self.values(np.vstack([segment.rows, segment.row]))]
                )
            )
        known = np.concatenate(parts)
        chosen = np.unique(np.linspace(0, len(known) - 1, MAX_CURVE_POINTS).astype(int))
        t, *values = [
            [float(f"{value:.5g}") for value in curve] for curve in known[chosen].T
        ]
        return {
            "t": t,
            "values": values,
            "motion": self._scenario.momentary_label,
            "began": began,
        }

    def values(self, rows: Array) -> Array:
        """Return CURVES (rows, curves) of observables (rows, k): energies [M c^2],
        force [M c^2/R], velocity or ξ."""
        columns = split(dict(zip(INDEX, rows.T, strict=True)), self._inertia)
        lost = rows[:, _LOSSES].sum(axis=1) + self._lost_before
        stored, motion = (
            columns["elastic"] + columns["wall"],
            self._scenario.momentary_motion(columns),
        )
        return np.stack(
            [
                *(columns[name] for name in of_kind("part")),
                stored,
                lost,
                columns["wall_force"],
                motion,
            ],
            1,
        )


class Scales:
    """Scales of colours and arrows. They grow with the values shown, and start anew
    with each hit and quantity.

    Attributes:
        colour: value of full colour, in units of the quantity; for fringes the stress
            from one fringe to the next.
        force: force of the wall on one point at the longest arrow [M c^2/R].
    """

    colour = force = 1.0
    _key: tuple[int, float, str] | None = None

    def __init__(self, sandbox: Sandbox, quantity: str = "") -> None:
        """`quantity`: the quantity that the colours show, "" for that of the scene."""
        self._sandbox = sandbox
        self._quantity = quantity

    def update(self, values: NDArray[Any], forces: NDArray[Any]) -> None:
        """Enlarge the scales to hold the disk's `values` (N,) and the wall's `forces`
        (k, 3): point, fx, fy."""
        sandbox = self._sandbox
        scenario = sandbox.time.display.segment.scenario
        name = self._quantity or sandbox.scene.video.colour
        key = sandbox.starts, sandbox.time.display.segment.hit_began, name
        if key != self._key:  # a guess, before anything is known
            self._key, load = key, value_of(scenario.scene, load_key(scenario.scene))
            self.colour = round_near(
                0.25 * load**2 / len(values) if name == "kinetic" else 0.05 * load
            )
            self.force = round_near(0.5 * scenario.point_force)
        self.colour = max(self.colour, full_scale(values.astype(np.float64), name))
        largest = float(np.hypot(forces[:, 1], forces[:, 2]).max(initial=0.0))
        if largest > self.force:
            self.force = round_near(1.2 * largest)

    def rescale(self) -> None:
        """Fit the colour scale to the next picture alone."""
        self.colour = 0.0
