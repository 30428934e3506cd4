"""The drawing routine: springs coloured by strain, points and the rigid wall, on any GGUI canvas.

It does not know whether the canvas belongs to a window on the screen or to a headless one behind a film.
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.render.camera import Camera
from taichi_disk.render.colours import FAINT_INK, GROUND, INK, strain_colours
from taichi_disk.render.picture import Subject

_TABLE = 256  # intervals of the colour table
_HATCH = 11.0  # pixels (at a picture of 720) between the hatching lines below the rigid wall, and their depth


@ti.data_oriented
class Painter:
    """Draws one lattice through one camera. `ti.init` must have been called; `destroy` frees the fields."""

    def __init__(self, subject: Subject, camera: Camera, unit: float) -> None:
        """`unit`: size in pixels of what is one pixel in a picture of 720; line widths grow with it."""
        self._camera, self._unit = camera, unit
        self._rigid_wall = subject.rigid_wall
        spacing = float(np.median(subject.lattice.rest_lengths)) * camera.scale
        # A line below about a pixel vanishes; one of more than 4 units is coarse, however few there are.
        self._line = float(np.clip(0.15 * spacing, 1.1 * unit, 4.0 * unit)) / camera.height
        # In a lattice so fine that points would touch, the springs alone show more.
        self._point = min(0.12 * spacing, 6.0 * unit) / camera.height if spacing > 5.0 else 0.0
        self._build_fields(subject)

    def _build_fields(self, subject: Subject) -> None:
        lattice, limit = subject.lattice, subject.strain_limit
        n, m = len(lattice.positions), len(lattice.bonds)
        factor, shift = self._camera.canvas_map()
        self._factor, self._shift, self._limit = ti.Vector(factor), ti.Vector(shift), limit
        self._bonds = ti.Vector.field(2, ti.i32)
        self._rest = ti.field(ti.f64)
        self._table = ti.Vector.field(3, ti.f32)
        self._ends = ti.Vector.field(2, ti.f32)  # two for each spring
        self._colours = ti.Vector.field(3, ti.f32)
        self._points = ti.Vector.field(2, ti.f32)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, m).place(self._bonds, self._rest)
        builder.dense(ti.i, 2 * m).place(self._ends, self._colours)
        builder.dense(ti.i, n).place(self._points)
        builder.dense(ti.i, _TABLE + 1).place(self._table)
        if self._rigid_wall:
            wall = self._wall_lines()
            self._wall, self._wall_colours = ti.Vector.field(2, ti.f32), ti.Vector.field(3, ti.f32)
            builder.dense(ti.i, len(wall)).place(self._wall, self._wall_colours)
        self._tree = builder.finalize()
        self._bonds.from_numpy(lattice.bonds)
        self._rest.from_numpy(lattice.rest_lengths)
        self._table.from_numpy(strain_colours(np.linspace(-1.0, 1.0, _TABLE + 1), 1.0).astype(np.float32))
        if self._rigid_wall:
            self._wall.from_numpy(wall)
            inks = np.array([INK, INK] + [FAINT_INK] * (len(wall) - 2), dtype=np.float32)
            self._wall_colours.from_numpy(inks)

    def _wall_lines(self) -> NDArray[np.float32]:
        """End points, in canvas coordinates, of the wall's line at y = 0, then of the hatching below it."""
        camera, step = self._camera, _HATCH * self._unit
        y = float(camera.canvas_map()[1][1])
        count = int(np.ceil(camera.width / step)) + 2
        top = np.stack([np.arange(count) * step / camera.width, np.full(count, y)], axis=1)
        foot = top - [step / camera.width, step / camera.height]
        hatching = np.stack([top, foot], axis=1).reshape(-1, 2)
        return np.concatenate([[[0.0, y], [1.0, y]], hatching]).astype(np.float32)

    @ti.kernel
    def _place(self, x: ti.types.ndarray(dtype=ti.f64, ndim=2)):  # type: ignore[valid-type]
        # Serial, here and below: a thousand light iterations cost less than waking a second thread.
        ti.loop_config(serialize=True)
        for b in self._bonds:
            i, j = self._bonds[b][0], self._bonds[b][1]
            p, q = ti.Vector([x[i, 0], x[i, 1]]), ti.Vector([x[j, 0], x[j, 1]])
            strain = (p - q).norm() / self._rest[b] - 1.0
            place = (ti.math.clamp(strain / self._limit, -1.0, 1.0) + 1.0) * (_TABLE / 2)
            k = ti.min(ti.cast(place, ti.i32), _TABLE - 1)
            colour = ti.math.mix(self._table[k], self._table[k + 1], ti.cast(place - k, ti.f32))
            self._ends[2 * b] = ti.cast(self._factor * p + self._shift, ti.f32)
            self._ends[2 * b + 1] = ti.cast(self._factor * q + self._shift, ti.f32)
            self._colours[2 * b] = colour
            self._colours[2 * b + 1] = colour
        ti.loop_config(serialize=True)
        for i in self._points:
            p = ti.Vector([x[i, 0], x[i, 1]])
            self._points[i] = ti.cast(self._factor * p + self._shift, ti.f32)

    def paint(self, canvas: Any, positions: NDArray[np.float64]) -> None:
        """Draw the state with `positions` (n, 2) [R] on a `ti.ui.Canvas` as large as the camera's stage."""
        pixel = self._unit / self._camera.height
        canvas.set_background_color(GROUND)
        if self._rigid_wall:
            canvas.lines(self._wall, width=1.7 * pixel, per_vertex_color=self._wall_colours)
        self._place(np.ascontiguousarray(positions))
        canvas.lines(self._ends, width=self._line, per_vertex_color=self._colours)
        if self._point:
            canvas.circles(self._points, radius=self._point, color=INK)

    def destroy(self) -> None:
        """Free the fields; the painter cannot be used afterwards."""
        self._tree.destroy()
