"""Draw field, springs or points, wall and arrows on a GGUI canvas, for films, stills
and the window."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.engine import ti
from taichi_disk.fields import QUANTITIES, Triangles, at_points, own_values
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Springs
from taichi_disk.render import geometry
from taichi_disk.render.geometry import Camera
from taichi_disk.render.kernels import VERTEX
from taichi_disk.render.palette import THEMES, colour_map, full_scale, map_kind
from taichi_disk.statics.equilibrium import roll_angle, turned

Vertices = NDArray[np.float32]
get_field_info = import_module(f"{ti.__name__}.ui.utils").get_field_info

# Sizes are [px] in a picture of 720 pixels.
# half the widths of a spring on the field and of an outline
_SPRING, _OUTLINE = 0.65, 1.3
# widths of an arrow's shaft, half head and rim; distance of arrows
_ARROW, _HEAD, _RIM, _NEXT = 1.8, 4.5, 1.0, 10.0
# springs on the field fade in between these distances of points
_FINE, _COARSE = 5.0, 14.0
_WEAK = 0.02  # a force below this fraction of `full_force` has no arrow
_SEEN = 0.25  # largest opacity of springs on the field
# approximate number of small triangles into which a coarse lattice is divided for
# fringes
_FRINGE_PARTS = 20_000


class Painter:
    """Draws one lattice. `ti.init` must have been called. A window, or a film, does
    this with each state:

        painter = Painter(lattice, model.springs, model.wall)
        painter.limit = painter.scale(painter.values(x, v))           # once, or
        whenever the colour scale shall change painter.paint(window.get_canvas(),
        camera, x, v)

    `x` (n, 2) [R] and `v` (n, 2) [c] are in the lattice's order; all values must be
    finite.

    Attributes, all of which may be changed at any time:
        colour: the coloured quantity, a name of `fields.QUANTITIES`.
        draw: "field" (triangles), "both" (also faint springs, if points are far enough
            apart, except on fringes), "springs" or "points". On the field a line
            separates triangles of different stiffness.
        theme: "light" or "dark".
        limit: end of the colour scale, which starts at -limit for signed quantities,
            else at 0; for fringes, the stress difference of one fringe. In units of the
            quantity.
        full_force: force whose arrow has the length `geometry.ARROW` [M c^2/R]; 0: no
            arrows.
        edge: height of the wall's edge above its surface [R], see
            `geometry.edge_height`.
        spoke: point to which a line is drawn from the disk's centre; -1: none.
        magnify: factor by which displacements are magnified, see `placed`.
        shown: (n,) values in the last picture.
    """

    shown: Array

    def __init__(self, lattice: Lattice, springs: Springs, wall: Any = None) -> None:
        self.lattice, self.springs, self.wall = lattice, springs, wall
        self.colour, self.draw, self.theme = "shear", "both", "light"
        self.limit, self.full_force, self.edge, self.spoke, self.magnify = (
            1.0,
            0.0,
            0.0,
            -1,
            1.0,
        )
        self.triangles, self._spacing = (
            Triangles(lattice),
            float(np.median(lattice.rest_lengths)),
        )

    # ---- values

    def values(self, x: Array, v: Array) -> Array:
        """Return the coloured quantity (n,) at the points."""
        return at_points(self.colour, self.triangles, self.springs, x, v)

    def scale(self, values: Array) -> float:
        """Return a round `limit` for `values` (n,), using the disk's points only."""
        return full_scale(values[: self.lattice.disk_points], self.colour)

    @property
    def remarks(self) -> list[str]:
        elastic = self.wall is not None and len(self.lattice.wall_surface) > 0
        grown = [f"displacements × {self.magnify:g}"] * (self.magnify > 1.0)
        return grown + ["grey: range of the contact force"] * elastic

    @property
    def signed(self) -> bool:
        return QUANTITIES[self.colour].signed

    @property
    def map(self) -> NDArray[np.float32]:
        """Colour map (LEVELS, 3) from the lowest value to the highest; for fringes,
        from dark to bright."""
        return colour_map(
            self.theme, map_kind(self.colour), self.draw in ("springs", "points")
        )

    def normalised(self, values: Array) -> Array:
        """Return `values` as positions 0 to 1 in the colour map; for fringes, the
        fringe order."""
        return np.asarray(
            0.5 + 0.5 * values / self.limit if self.signed else values / self.limit
        )

    def colours(self, normalised: Array) -> NDArray[np.float32]:
        if self.colour == "fringes":
            normalised = np.sin(np.pi * normalised) ** 2
        table = self.map
        return table[
            (np.clip(normalised, 0.0, 1.0) * (len(table) - 1) + 0.5).astype(np.intp)
        ]

    def mesh(
        self, x: Array, normalised: Array
    ) -> tuple[Array, Array, NDArray[np.int32]]:
        """Return points (k, 2), normalised values (k,) and triangles (t, 3), in which
        colours vary linearly.

        `x` (n, 2), `normalised` (n,): of the lattice's points. For fringes each
            triangle of the lattice is subdivided.
        """
        corners = self.triangles.triangles
        if self.colour != "fringes":
            return x, normalised, corners
        parts = min(max(round(np.sqrt(_FRINGE_PARTS / max(len(corners), 1))), 1), 6)
        weights, cells = subdivision(parts)
        each = (
            len(weights) * np.arange(len(corners), dtype=np.int32)[:, None, None]
            + cells
        )
        return (
            (weights @ x[corners]).reshape(-1, 2),
            (normalised[corners] @ weights.T).ravel(),
            each.reshape(-1, 3),
        )

    # ---- drawing

    def placed(self, x: Array) -> Array:
        """Return where points at `x` (n, 2) are drawn [R].

        Displacements are taken relative to the initial lattice, rotated like the disk,
        with its lowest point at the same height. Points near a contact may be drawn
        inside the wall, which hides them.
        """
        out, n = np.array(x, order="C"), self.lattice.disk_points
        if self.magnify != 1.0:
            rest = self.lattice.positions[:n]
            disk = turned(rest, roll_angle(rest, x[:n]))
            disk += [
                x[:n, 0].mean() - disk[:, 0].mean(),
                x[:n, 1].min() - disk[:, 1].min(),
            ]
            out[:n] = disk + self.magnify * (x[:n] - disk)
        return out

    def paint(
        self, canvas: Any, camera: Camera, x: Array, v: Array, unit: float = 1.0
    ) -> None:
        """Draw the state on a `ti.ui.Canvas`. `unit`: factor for the widths of lines, 1
        in a picture of 720 pixels."""
        placed = self.placed(x)
        theme, pixel = THEMES[self.theme], 1.0 / camera.scale
        self.shown = self.values(x, v)
        values = self.normalised(self.shown)
        colours = self.colours(values)
        above, half = [geometry.NOTHING], max(_OUTLINE * unit, 1.0) * pixel
        canvas.set_background_color(theme.ground)
        if self.wall is not None:
            left, right, bottom, _ = camera.seen
            if len(self.lattice.wall_surface):
                # the solid body covers the outline of the wall
                chain, depth = placed[self.lattice.wall_surface], half
            else:  # across the visible part of the scene
                chain, depth = (
                    np.array([(left - pixel, 0.0), (right + pixel, 0.0)]),
                    max(pixel - bottom, -self.edge),
                )
            decay = max(self.wall.decay_length, 0.4 * pixel)
            haze, solid = geometry.wall_body(chain, depth, self.edge, decay, theme)
            self.draw_shape(canvas, haze, camera)
        if self.draw in ("field", "both"):
            points, each, corners = self.mesh(placed, values)
            draw_triangles(canvas, _put(camera, points, self.colours(each)), corners)
            spacing = self._spacing * camera.scale / max(unit, 0.7)
            ink = _SEEN * min(max((spacing - _FINE) / (_COARSE - _FINE), 0.0), 1.0)
            if ink and self.draw == "both" and self.colour != "fringes":
                shade = (1.0 - ink) * colours[self.lattice.bonds.ravel()]
                self._springs(
                    canvas, camera, placed, shade, 2.0 * max(_SPRING * unit, 0.55)
                )
            for sides in (self.triangles.outline, self.triangles.interfaces):
                inside = colours[sides]
                outside = (
                    theme.ground
                    if sides is self.triangles.outline
                    else inside.mean(axis=1)
                )
                start, end = placed[sides.T]
                above.append(
                    geometry.outline(start, end, half, inside, theme.ink, outside)
                )
        elif self.draw == "springs":
            # Thin lines suffice if there are few springs, but a line thinner than about
            # a pixel vanishes.
            width = max(min(0.15 * self._spacing * camera.scale, 2.5 * unit), 1.1)
            each = np.repeat(self.colours(self._of_springs(x, v, values)), 2, axis=0)
            self._springs(canvas, camera, placed, each, width)
        if self.spoke >= 0:
            ends = self.lattice.mean(placed)[None], placed[[self.spoke]]
            for colour, wide in ((theme.ground, 2.0 * half), (theme.ink, half)):
                above.append(
                    geometry.outline(
                        *ends, wide, np.broadcast_to(colour, (1, 2, 3)), colour, colour
                    )
                )
        if self.wall is not None:
            above.append(solid)
        if self.full_force and self.wall is not None:
            sizes = (
                _HEAD * unit * pixel,
                max(_ARROW * unit, 1.0) * pixel,
                _RIM * unit * pixel,
            )
            above.append(
                geometry.arrows(
                    *self.pushes(x, v, max(_NEXT * unit, 9.0) * pixel), *sizes, theme
                )
            )
        self.draw_shape(canvas, geometry.joined(*above), camera)
        if self.draw == "points":
            radius = (
                max(min(0.3 * self._spacing * camera.scale, 6.0 * unit), 1.0)
                / camera.height
            )
            # keep this array alive: GGUI reads its memory
            out = _put(camera, placed, colours)
            canvas.canvas.circles(
                get_field_info(out), True, False, (0.0, 0.0, 0.0), radius
            )

    def pushes(self, x: Array, v: Array, distance: float) -> tuple[Array, Array]:
        """Return the starts (k, 2) [R] of arrows and their forces (k, 2) over
        `full_force`."""
        # If points are closer than `distance` [R], one arrow shows the mean force of
        # all points within that distance.
        points, forces = self.wall.contact_forces(self.lattice, x, v, self.springs)
        forces = forces / self.full_force
        strong = np.hypot(*forces.T) > _WEAK
        placed = self.placed(x)
        feet, forces = placed[points[strong]], forces[strong]
        chain = (
            placed[self.lattice.wall_surface]
            if len(self.lattice.wall_surface)
            else np.zeros((1, 2))
        )
        # Magnified displacements may move points into the wall, which would hide their
        # arrows.
        feet[:, 1] = np.maximum(feet[:, 1], np.interp(feet[:, 0], *chain.T) + self.edge)
        if self._spacing > 0.8 * distance and self._spacing > self.wall.decay_length:
            return feet, forces
        _, group = np.unique(np.floor(feet[:, 0] / distance), return_inverse=True)
        count = np.bincount(group)
        mean = [np.bincount(group, part) / count for part in (*feet.T, *forces.T)]
        return np.stack(mean[:2], axis=1), np.stack(mean[2:], axis=1)

    def _of_springs(self, x: Array, v: Array, values: Array) -> Array:
        if QUANTITIES[self.colour].on != "springs":
            return np.asarray(values[self.lattice.bonds].mean(axis=1))
        return self.normalised(
            own_values(self.colour, self.triangles, self.springs, x, v)
        )

    def _springs(
        self, canvas: Any, camera: Camera, x: Array, colours: NDArray[Any], width: float
    ) -> None:
        out = _put(camera, x[self.lattice.bonds.ravel()], colours)
        canvas.canvas.lines(
            get_field_info(out),
            get_field_info(None),
            True,
            (0.0, 0.0, 0.0),
            width / camera.height,
        )

    def draw_shape(self, canvas: Any, shape: geometry.Shape, camera: Camera) -> None:
        if len(shape[0]):
            draw_triangles(canvas, _put(camera, *shape))


def _put(camera: Camera, points: Array, colours: NDArray[Any]) -> Vertices:
    out = np.zeros((len(points), VERTEX), dtype=np.float32)
    factor, shift = camera.canvas_map()
    out[:, :2], out[:, 8:11], out[:, 11] = factor * points + shift, colours, 1.0
    return out


def draw_triangles(
    canvas: Any, vertices: Vertices, corners: NDArray[np.int32] | None = None
) -> None:
    """Draw triangles from arrays. `corners` (k, 3): vertices of each triangle; by
    default three consecutive ones."""
    # `Canvas.triangles` of Taichi 1.7.4 first copies fields into such arrays, with a
    # kernel for each lattice (0.3 s).
    indices = get_field_info(None if corners is None else corners.ravel())
    canvas.canvas.triangles(get_field_info(vertices), indices, True, (0.0, 0.0, 0.0))


def subdivision(parts: int) -> tuple[Array, NDArray[np.int32]]:
    """Return the points and triangles of a triangle that is divided into parts x parts
    smaller ones.

    Points are weights (q, 3) of the corners, triangles are indices (parts^2, 3) of
    points.
    """
    places = [(m, n) for m in range(parts + 1) for n in range(parts + 1 - m)]
    number = {place: k for k, place in enumerate(places)}
    upright = [[(m, n), (m + 1, n), (m, n + 1)] for m, n in places if m + n < parts]
    turned = [
        [(m + 1, n), (m + 1, n + 1), (m, n + 1)] for m, n in places if m + n < parts - 1
    ]
    u, w = np.array(places, dtype=float).T / parts
    corners = [[number[place] for place in triangle] for triangle in upright + turned]
    return np.column_stack([1.0 - u - w, u, w]), np.array(corners, dtype=np.int32)
