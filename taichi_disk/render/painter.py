"""The drawing routine: springs coloured by strain, points and the rigid wall, on any GGUI canvas.

It does not know whether the canvas belongs to a window on the screen or to a headless one behind a film.
"""

from typing import Any

import numpy as np
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.render.arrows import FAR, LINES, arrow_lines
from taichi_disk.render.camera import Camera
from taichi_disk.render.colours import CONTACT, FAINT_INK, GROUND, INK, amount_colours, strain_colours
from taichi_disk.render.picture import Subject
from taichi_disk.scene import Show

_TABLE = 256  # intervals of the colour table
_HATCHES = 200  # lines below the rigid wall: enough for a picture three times as wide as high
_HATCH = 11.0  # pixels (in a picture of 720) between the hatching lines below the rigid wall, and their depth

_NOTHING = np.zeros(0, dtype=np.intp), np.zeros((0, 2))
_Pair = ti.types.vector(2, ti.f64)


@ti.data_oriented
class Painter:
    """Draws one lattice through one camera. `ti.init` must have been called; `destroy` frees the fields."""

    def __init__(self, subject: Subject, camera: Camera, unit: float) -> None:
        """`unit`: size in pixels of what is one pixel in a picture of 720; line widths grow with it."""
        lattice = subject.lattice
        self._bonds, self._rest_lengths = lattice.bonds, lattice.rest_lengths
        self._limit = subject.limit
        places = np.linspace(-1.0, 1.0, _TABLE + 1)
        self._tables = [colours(places, 1.0).astype(np.float32) for colours in (amount_colours, strain_colours)]
        degree = np.bincount(lattice.bonds.ravel(), minlength=len(lattice.positions))
        self._share = 1.0 / np.maximum(degree, 1)
        self._spacing = float(np.median(lattice.rest_lengths))
        # More than half of the rim never touches the wall.
        self._arrows = max(len(lattice.disk_surface) // 2, 8) if subject.full_force else 0
        self._make_fields(len(lattice.positions), len(lattice.bonds), _HATCHES + 1 if subject.rigid_wall else 0)
        self.aim(camera, unit)

    def aim(self, camera: Camera, unit: float) -> None:
        """Look through another camera from now on."""
        factor, shift = camera.canvas_map()
        self._factor, self._shift = _Pair(factor), _Pair(shift)
        spacing = self._spacing * camera.scale
        # Few springs need not be thick to be seen; a line below about a pixel vanishes.
        self._line = max(min(0.15 * spacing, 2.5 * unit), 1.1) / camera.height
        # In a lattice so fine that points would touch, the springs alone show more.
        self._point = min(0.11 * spacing, 6.0 * unit) / camera.height if spacing > 5.0 else 0.0
        self._any_point = max(min(0.25 * spacing, 6.0 * unit), 1.0) / camera.height
        if self._wall:
            step = _HATCH * unit
            self._place_wall(self._shift, step / camera.width, step / camera.height)

    def _make_fields(self, points: int, springs: int, wall: int) -> None:
        """Two line ends for each spring, then two for each line of the rigid wall, then those of the arrows."""
        self._springs, self._wall = springs, wall
        self._ends, self._colours = ti.Vector.field(2, ti.f32), ti.Vector.field(3, ti.f32)
        self._points, self._point_colours = ti.Vector.field(2, ti.f32), ti.Vector.field(3, ti.f32)
        self._point_places = ti.field(ti.f64)
        builder = ti.FieldsBuilder()
        lines = springs + wall + LINES * self._arrows
        builder.dense(ti.i, 2 * lines).place(self._ends, self._colours)
        builder.dense(ti.i, points).place(self._points, self._point_colours, self._point_places)
        self._tree = builder.finalize()

    @ti.kernel
    def _place_wall(self, shift: _Pair, across: ti.f64, down: ti.f64):  # type: ignore[valid-type]
        """A line at y = 0 and short lines that lean to it from below, in canvas coordinates."""
        for k in range(self._wall):
            i = 2 * (self._springs + k)
            height = shift[1]  # type: ignore[index]
            foot, top = ti.Vector([0.0, height]), ti.Vector([1.0, height])
            colour = ti.Vector([INK[0], INK[1], INK[2]])
            if k > 0:
                top[0] = (k - 1) * across
                foot = top - ti.Vector([across, down])
                colour = ti.Vector([FAINT_INK[0], FAINT_INK[1], FAINT_INK[2]])
            self._ends[i], self._ends[i + 1] = ti.cast(foot, ti.f32), ti.cast(top, ti.f32)
            self._colours[i], self._colours[i + 1] = ti.cast(colour, ti.f32), ti.cast(colour, ti.f32)

    @ti.kernel
    def _place_arrows(self, ends: ti.types.ndarray(dtype=ti.f64, ndim=2), factor: _Pair, shift: _Pair):  # type: ignore[valid-type]
        ti.loop_config(serialize=True)
        for k in range(2 * LINES * self._arrows):
            i = 2 * (self._springs + self._wall) + k
            self._ends[i] = ti.cast(factor * ti.Vector([ends[k, 0], ends[k, 1]]) + shift, ti.f32)
            self._colours[i] = ti.Vector([CONTACT[0], CONTACT[1], CONTACT[2]])

    @ti.kernel
    def _place(
        self,
        x: ti.types.ndarray(dtype=ti.f64, ndim=2),  # type: ignore[valid-type]
        bonds: ti.types.ndarray(dtype=ti.i32, ndim=2),  # type: ignore[valid-type]
        rest_lengths: ti.types.ndarray(dtype=ti.f64, ndim=1),  # type: ignore[valid-type]
        table: ti.types.ndarray(dtype=ti.types.vector(3, ti.f32), ndim=1),  # type: ignore[valid-type]
        values: ti.types.ndarray(dtype=ti.f64, ndim=1),  # type: ignore[valid-type]
        share: ti.types.ndarray(dtype=ti.f64, ndim=1),  # type: ignore[valid-type]
        by_strain: ti.template(),  # type: ignore[valid-type]
        hidden: ti.template(),  # type: ignore[valid-type]
        factor: _Pair,  # type: ignore[valid-type]
        shift: _Pair,  # type: ignore[valid-type]
    ):
        # Serial, here and below: a thousand light iterations cost less than waking a second thread.
        ti.loop_config(serialize=True)
        for b in range(self._springs):
            i, j = bonds[b, 0], bonds[b, 1]
            p, q = ti.Vector([x[i, 0], x[i, 1]]), ti.Vector([x[j, 0], x[j, 1]])
            value = values[b] if ti.static(not by_strain) else ((p - q).norm() / rest_lengths[b] - 1.0) / self._limit
            value = ti.math.clamp(value, -1.0, 1.0)
            colour = self._colour(table, value)
            if ti.static(hidden):
                self._point_places[i] += value * share[i]
                self._point_places[j] += value * share[j]
                p, q = _Pair(FAR, FAR), _Pair(FAR, FAR - 1.0)
            self._ends[2 * b] = ti.cast(factor * p + shift, ti.f32)
            self._ends[2 * b + 1] = ti.cast(factor * q + shift, ti.f32)
            self._colours[2 * b] = colour
            self._colours[2 * b + 1] = colour
        ti.loop_config(serialize=True)
        for i in self._points:
            p = ti.Vector([x[i, 0], x[i, 1]])
            self._points[i] = ti.cast(factor * p + shift, ti.f32)
            if ti.static(hidden):
                self._point_colours[i] = self._colour(table, self._point_places[i])
                self._point_places[i] = 0.0

    @ti.func
    def _colour(self, table: ti.template(), value: ti.f64):  # type: ignore[valid-type]
        place = (value + 1.0) * (_TABLE / 2)
        k = ti.min(ti.cast(place, ti.i32), _TABLE - 1)
        return ti.math.mix(table[k], table[k + 1], ti.cast(place - k, ti.f32))

    def paint(
        self,
        canvas: Any,
        positions: NDArray[np.float64],
        values: NDArray[np.float64] | None = None,
        show: Show = "both",
        signed: bool = True,
        pushed: tuple[NDArray[np.intp], NDArray[np.float64]] | None = None,
    ) -> None:
        """Draw the state with `positions` (n, 2) [R] on a `ti.ui.Canvas` as large as the camera's stage.

        `values` (springs,): places in the scale of colours, -1 to 1 where they are `signed`, else 0 to 1; by
        default the strain over its limit. Points without springs take the mean of theirs.
        `pushed`: if the subject has a full force, the points (k,) that the wall pushes and how hard, (k, 2), as
        parts of it; arrows show them.
        """
        x, by_strain = np.ascontiguousarray(positions), values is None
        given = np.zeros(1) if values is None else np.ascontiguousarray(values)
        springs = (self._bonds, self._rest_lengths, self._tables[signed], given, self._share)
        self._place(x, *springs, by_strain, show == "points", self._factor, self._shift)
        if self._arrows:
            arrows = arrow_lines(positions, *(pushed or _NOTHING), self._spacing, self._arrows)
            self._place_arrows(arrows.reshape(-1, 2), self._factor, self._shift)
        canvas.set_background_color(GROUND)
        # Hidden springs lie far outside, so that the wall beside them in the same field is still drawn.
        canvas.lines(self._ends, width=self._line, per_vertex_color=self._colours)
        if show == "points":
            canvas.circles(self._points, radius=self._any_point, per_vertex_color=self._point_colours)
        elif self._point and show == "both":
            canvas.circles(self._points, radius=self._point, color=INK)

    def destroy(self) -> None:
        """Free the fields; the painter cannot be used afterwards."""
        self._tree.destroy()
