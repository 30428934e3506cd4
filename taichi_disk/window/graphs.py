"""The curves below the disk: energies of the hit on display, force of the wall, motion of the centre of mass."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_disk.lattice import Array, disk_of
from taichi_disk.simulation.observables import BLUE, BY_NAME, INDEX, PINK, of_kind, split
from taichi_disk.window.sandbox import Sandbox

POINTS = 400  # of a curve at most
# Graph, name and colour of each curve. The name of the last curve depends on the scene.
CURVES = (
    *(("energy", BY_NAME[name].label, BY_NAME[name].colour) for name in ("translation", "rotation", "vibration")),
    ("energy", "elastic and wall", BY_NAME["elastic"].colour),
    ("energy", "lost", BY_NAME["dissipated"].colour),
    ("force", "force of the wall", PINK),
    ("motion", "motion", BLUE),
)
_LOST_CURVE = [name for _, name, _ in CURVES].index("lost")
_LOST = [INDEX[name] for name in of_kind("loss")]


class Graphs:
    """Curves of `sandbox`: a whole hit in `message`, and single moments of the same hit in `values`."""

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox

    def message(self) -> dict[str, Any]:
        """Return times since the hit began [R/c] and the values of CURVES, at most POINTS of each."""
        disk, segments = disk_of(self._sandbox.start.body), self._sandbox.time.hit_segments
        arm = disk.positions - disk.mean(disk.positions)
        self._inertia, self._scenario = float(disk.mean((arm**2).sum(axis=1))), segments[0].scenario
        times, parts, lost = [], [], 0.0
        for segment in segments:
            self._lost_before = lost  # in earlier segments of the hit [M c^2]
            parts.append(self.values(np.vstack([segment.rows, segment.row])))
            times.append(np.append(segment.began + np.arange(segment.count) * segment.interval, segment.now))
            lost = float(parts[-1][-1, _LOST_CURVE])
        t, values = np.concatenate(times) - segments[0].began, np.concatenate(parts)
        chosen = np.unique(np.linspace(0, len(t) - 1, POINTS).astype(int))
        shown = np.column_stack([t, values])[chosen].T
        curves = [[float(f"{value:.5g}") for value in curve] for curve in shown]
        motion = self._scenario.momentary_label
        return {"t": curves[0], "values": curves[1:], "motion": motion, "began": segments[0].began}

    def values(self, rows: Array) -> Array:
        """Return CURVES (rows, curves) of observables (rows, k): energies [M c^2], force [M c^2/R], velocity or ξ."""
        columns = split(dict(zip(INDEX, rows.T, strict=True)), self._inertia)
        lost = rows[:, _LOST].sum(axis=1) + self._lost_before
        stored, motion = columns["elastic"] + columns["wall"], self._scenario.momentary_motion(columns)
        return np.stack([*(columns[name] for name in of_kind("part")), stored, lost, columns["wall_force"], motion], 1)
