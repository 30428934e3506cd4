"""The curves below the disk: the energies of the hit that is seen, the force of the wall, the motion of the centre."""

from __future__ import annotations

from typing import Any

import numpy as np

from taichi_disk.lattice import Array, disk_of
from taichi_disk.simulation.observables import BLUE, BY_NAME, INDEX, PINK, of_kind, split
from taichi_disk.window.sandbox import Sandbox

POINTS = 400  # of a curve, at most
# Graph, name and colour of each curve; the last one's name depends on the scene.
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
    """Curves of `sandbox`: all of a hit at once, and the values of one moment more."""

    def __init__(self, sandbox: Sandbox) -> None:
        self._sandbox = sandbox
        self._start, self._inertia, self._scenario = 0, 1.0, sandbox.segment.scenario
        self._lost_before = 0.0  # the present segment, since the hit began [M c^2]

    def message(self) -> dict[str, Any]:
        """Return times since the hit began [R/c] and the values of CURVES, at most POINTS of each."""
        sandbox = self._sandbox
        if sandbox.starts != self._start:
            disk = disk_of(sandbox.start.body)
            arm = disk.positions - disk.mean(disk.positions)
            self._start, self._inertia = sandbox.starts, float(disk.mean((arm**2).sum(axis=1)))
        segments = sandbox.time.of_hit(sandbox.seen.segment.hit)
        self._scenario = segments[0].scenario
        times, parts, before = [], [], 0.0
        for one in segments:
            self._lost_before = before
            rows = np.vstack([one.rows, one.row])
            parts.append(self.values(rows))
            times.append(np.append(one.began + np.arange(one.count) * one.interval, one.now))
            before = float(parts[-1][-1, _LOST_CURVE])
        t, values = np.concatenate(times) - segments[0].began, np.concatenate(parts)
        chosen = np.unique(np.linspace(0, len(t) - 1, POINTS).astype(int))
        shown = np.column_stack([t, values])[chosen].T
        curves = [[float(f"{value:.5g}") for value in curve] for curve in shown]
        motion = self._scenario.momentary_label
        return {"t": curves[0], "values": curves[1:], "motion": motion, "began": segments[0].began}

    def values(self, rows: Array) -> Array:
        """Return energies [M c^2], force [M c^2/R], velocity [c] or ξ [R] (rows, CURVES) of observables (rows, k)."""
        of = split(dict(zip(INDEX, rows.T, strict=True)), self._inertia)
        lost = rows[:, _LOST].sum(axis=1) + self._lost_before
        motion = self._scenario.momentary_motion(of)
        curves = *(of[name] for name in of_kind("part")), of["elastic"] + of["wall"], lost, of["wall_force"], motion
        return np.stack(curves, axis=1)
