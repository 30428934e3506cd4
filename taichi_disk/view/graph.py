"""The running graph: v_cm(t) and where the energy is, as lines on the window's canvas."""

from __future__ import annotations

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.render.colours import FAINT_INK, Colour
from taichi_disk.view.sandbox import Sandbox

_SAMPLES = 160  # segments of a curve
_LEAST = 5.0  # shortest time shown [R/c]
# What is drawn, from -1 to 1: name for the legend, colour.
CURVES: tuple[tuple[str, Colour], ...] = (
    ("v_cm", (0.35, 0.35, 0.38)),
    ("kinetic energy", (0.10, 0.45, 0.80)),
    ("elastic energy", (0.80, 0.25, 0.15)),
    ("lost to dashpots, boundary", (0.10, 0.55, 0.25)),
    ("contact force", (0.60, 0.35, 0.70)),
)


def curves(sandbox: Sandbox) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Times (samples + 1,) [R/c] and values (curves, samples + 1), each curve within -1..1.

    v_cm is divided by the largest |v_cm| seen, energies by the largest sum of them, the force by its peak.
    """
    history = list(sandbox.motion.ledger.history)
    history = history[:: max(1, len(history) // (4 * _SAMPLES))]
    t = np.array([moment for moment, _ in history])

    def column(name: str) -> NDArray[np.float64]:
        return np.array([row[name] for _, row in history])

    kinetic, elastic, lost = column("kinetic"), column("elastic"), column("dissipated") + column("absorbed")
    energy = max(float((kinetic + elastic + lost).max()), 1e-300)
    velocity, force = column("com_vy"), column("wall_force")
    values = [
        velocity / max(float(np.abs(velocity).max()), 1e-300),
        kinetic / energy,
        elastic / energy,
        lost / energy,
        force / max(float(force.max()), 1e-12),
    ]
    times = np.linspace(t[0], max(t[-1], t[0] + _LEAST), _SAMPLES + 1)
    return times, np.array([np.interp(np.minimum(times, t[-1]), t, np.clip(value, -1.0, 1.0)) for value in values])


class Graph:
    """Draws it into a rectangle of the window. `ti.init` must have been called."""

    def __init__(self) -> None:
        lines = len(CURVES) * _SAMPLES + 2
        self._ends, self._colours = ti.Vector.field(2, ti.f32), ti.Vector.field(3, ti.f32)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, 2 * lines).place(self._ends, self._colours)
        self._tree = builder.finalize()
        colours = np.empty((lines, 2, 3), dtype=np.float32)
        colours[:2] = FAINT_INK
        for k, (_, colour) in enumerate(CURVES):
            colours[2 + k * _SAMPLES : 2 + (k + 1) * _SAMPLES] = colour
        self._colours.from_numpy(colours.reshape(-1, 3))

    def paint(self, canvas: Any, sandbox: Sandbox, box: tuple[float, float, float, float], line: float) -> None:
        """`box`: left, right, bottom, top on the canvas (0..1); `line`: width of a line, in parts of the height."""
        left, right, bottom, top = box
        times, values = curves(sandbox)
        x = left + (right - left) * (times - times[0]) / (times[-1] - times[0])
        y = bottom + (top - bottom) * 0.5 * (values + 1.0)
        ends = np.empty((len(CURVES) * _SAMPLES + 2, 2, 2), dtype=np.float32)
        ends[0] = (left, bottom), (left, top)
        ends[1] = (left, 0.5 * (bottom + top)), (right, 0.5 * (bottom + top))
        x = np.broadcast_to(x, y.shape)
        curve = np.stack([x, y], axis=-1)
        ends[2:] = np.stack([curve[:, :-1], curve[:, 1:]], axis=2).reshape(-1, 2, 2)
        # What has not come yet is not drawn.
        later = np.tile(times[1:] > sandbox.motion.ledger.t, len(CURVES))
        ends[2:][later] = 0.0
        self._ends.from_numpy(ends.reshape(-1, 2))
        canvas.lines(self._ends, width=line, per_vertex_color=self._colours)
