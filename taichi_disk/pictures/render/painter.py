"""Draw field, springs or points, wall and arrows on a GGUI canvas, for films and
stills."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.engine import internals, ti
from taichi_disk.mechanics.fields import QUANTITIES, Triangles, at_points, own_values
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.triangles import double_area
from taichi_disk.mechanics.physics import Springs
from taichi_disk.pictures.render import geometry, marks
from taichi_disk.pictures.render.geometry import Camera
from taichi_disk.pictures.render.marks import Mark
from taichi_disk.pictures.render.palette import (
    LEVELS,
    THEMES,
    colour_map,
    ink,
    map_kind,
)

Vertices = NDArray[np.float32]
get_field_info = internals.field_info(ti)

ARROW = 0.35  # length of the arrow of `full_force` [R]
VELOCITY_ARROW = 0.7  # length of the arrow of the speed before an impact [R]
# length of a GGUI vertex: position (3), normal (3), texture (2), colour (4)
VERTEX = 12
HAS_COLOURS = True  # each vertex has a colour of its own, in the place of BLACK
BLACK = (0.0, 0.0, 0.0)
# Sizes are [px] in a picture of 720 pixels.
# half the width of a spring on the field, and the smallest one
_SPRING = 0.65
_MIN_SPRING = 0.55
_OUTLINE = 1.9  # half the width of an outline
# arrows of forces and of the velocity: width of the shaft, half the width of the head
FORCE_ARROW = 4.5, 8.0
_VELOCITY_ARROW = 13.0, 25.0
_FORCE_RIM = 1.6
_RIM = 3.0  # of the velocity's arrow, and of the dot at its foot
_DOT = 9.0  # radius of the dot
_NEXT = 20.0  # distance of two force arrows
# springs on the field fade in between these distances of points
_FINE = 5.0
_COARSE = 14.0
# forces and velocities below these fractions of `full_force` and `full_speed` have no
# arrow
_WEAK = 0.1
_SLOW = 0.02
_SEEN = 0.25  # largest opacity of springs on the field
# smallest number of triangles for fringes
_FRINGE_PARTS = 8_000


@dataclass
class Painter:
    """Draws states of one lattice: positions `x` (n, 2) [R] and velocities `v` (n, 2)
    [c] in the lattice's order, all of them finite. `ti.init` must have been called.

    Attributes:
        colour: the coloured quantity, a name of `fields.QUANTITIES`.
        draw: "field" (triangles), "both" (also faint springs, if points are far enough
            apart, except on fringes), "springs" or "points". On the field a line
            separates triangles of different stiffness.
        theme: "light" or "dark".
        limit: end of the colour scale, which starts at -limit for signed quantities,
            else at 0; for fringes, the stress difference of one fringe. In units of the
            quantity.
        full_force: force whose arrow has the length ARROW [M c^2/R]; 0: no
            arrows.
        full_speed: speed of the centre of mass whose arrow has the length
            VELOCITY_ARROW [c]; 0: no arrow.
        edge: height of the wall's edge above its surface [R], see
            `geometry.edge_height`.
        spoke: point to which a line is drawn from the disk's centre; -1: none.
        magnify: factor by which displacements are magnified, see `placed`.
    """

    lattice: Lattice
    springs: Springs
    wall: Any = None
    colour: str = "shear"
    draw: str = "both"
    theme: str = "light"
    limit: float = 1.0
    full_force: float = 0.0
    full_speed: float = 0.0
    edge: float = 0.0
    spoke: int = -1
    magnify: float = 1.0

    def __post_init__(self) -> None:
        self.triangles = Triangles(self.lattice)
        self._spacing = float(np.median(self.lattice.rest_lengths))

    # ---- values

    def values(self, x: Array, v: Array, ringing: float = 1.0) -> Array:
        """Return the coloured quantity (n,) at the points, or about that of a vibration
        that is `ringing` times as strong."""
        values = at_points(self.colour, self.triangles, self.springs, x, v)
        return ringing ** QUANTITIES[self.colour].power * values

    @property
    def has_elastic_wall(self) -> bool:
        return len(self.lattice.wall_surface) > 0

    @property
    def remarks(self) -> list[str]:
        remarks = []
        if self.magnify > 1.0:
            remarks.append(f"displacements × {self.magnify:g}")
        if self.has_elastic_wall:
            remarks.append("grey: range of the contact force")
        return remarks

    @property
    def signed(self) -> bool:
        return QUANTITIES[self.colour].signed

    def normalised(self, values: Array) -> Array:
        """Return `values` as positions 0 to 1 in the colour map; for fringes, the
        fringe order."""
        parts = values / self.limit
        if self.signed:
            parts = 0.5 + 0.5 * parts
        return parts

    def colours(self, normalised: Array) -> NDArray[np.float32]:
        if self.colour == "fringes":
            normalised = np.sin(np.pi * normalised) ** 2
        is_bare = self.draw in ("springs", "points")
        table = colour_map(self.theme, map_kind(self.colour), is_bare)
        levels = np.clip(normalised, 0.0, 1.0) * (LEVELS - 1) + 0.5
        return table[levels.astype(np.intp)]

    def _fringes(
        self, placed: Array, orders: Array
    ) -> tuple[Array, NDArray[np.float32]]:
        """Return the corners (t, 3, 2) of triangles into which those of the lattice are
        divided, so that fringes are smooth, and their colours (3 t, 3)."""
        corners = self.triangles.triangles
        points = placed[corners]
        values = orders[corners]
        while len(points) < _FRINGE_PARTS:
            points = _quartered(points)
            values = _quartered(values)
        return points, self.colours(values.ravel())

    # ---- drawing

    def placed(self, x: Array, ringing: float = 1.0) -> Array:
        """Return where points at `x` (n, 2) are drawn [R]: see `geometry.placed`."""
        return geometry.placed(self.lattice, x, self.magnify, self.edge, ringing)

    def paint(
        self,
        canvas: Any,
        camera: Camera,
        x: Array,
        v: Array,
        placed: Array,
        unit: float = 1.0,
        is_soft: bool = False,
        ringing: float = 1.0,
    ) -> None:
        """Draw the state on a `ti.ui.Canvas`.

        Args:
            placed: where its points are drawn, see `placed`.
            unit: factor for the widths of lines, 1 in a picture of 720 pixels.
            is_soft: whether the window has this package's shaders, see
                `offscreen.Window`.
            ringing: factor by which colours are shown stronger.
        """
        theme = THEMES[self.theme]
        pixel = 1.0 / camera.scale
        values = self.normalised(self.values(x, v, ringing))
        colours = self.colours(values)
        half = max(_OUTLINE * unit, 1.0) * pixel  # of an outline
        above = [geometry.NOTHING]
        canvas.set_background_color(tuple(theme.ground))
        if self.wall:
            haze, solid = self._wall_shapes(camera, placed, half)
            draw_triangles(canvas, _put(camera, *haze))
        if self.draw in ("field", "both"):
            self._draw_field(canvas, camera, placed, values, unit, is_soft)
            above += self._outlines(placed, colours, half)
        elif self.draw == "springs":
            # Thin lines suffice if there are few springs, but a line thinner than about
            # a pixel vanishes.
            width = max(min(0.15 * self._spacing * camera.scale, 2.5 * unit), 1.1)
            of_springs = self.colours(self._of_springs(x, v, values, ringing))
            of_ends = np.repeat(of_springs, 2, axis=0)
            _lines(canvas, camera, placed[self.lattice.bonds], of_ends, width)
        if self.wall:
            above.append(solid)
        shapes = geometry.joined(*above)
        if len(shapes[0]):
            draw_triangles(canvas, _put(camera, *shapes))
        if self.draw == "points":
            radius = max(min(0.3 * self._spacing * camera.scale, 6.0 * unit), 1.0)
            _circles(canvas, camera, placed, colours, radius)

    def _wall_shapes(
        self, camera: Camera, placed: Array, half: float
    ) -> tuple[geometry.Shape, geometry.Shape]:
        pixel = 1.0 / camera.scale
        if self.has_elastic_wall:
            # the solid body covers the outline of the wall
            chain = placed[self.lattice.wall_surface]
            depth = half
        else:  # across the visible part of the scene
            left, bottom = camera.to_scene((0.0, camera.height))
            right, _ = camera.to_scene((camera.width, 0.0))
            chain = np.array([(left - pixel, 0.0), (right + pixel, 0.0)])
            depth = max(pixel - bottom, -self.edge)
        decay = max(self.wall.decay_length, 0.4 * pixel)
        theme = THEMES[self.theme]
        return geometry.wall_body(chain, depth, self.edge, decay, theme)

    def _draw_field(
        self,
        canvas: Any,
        camera: Camera,
        placed: Array,
        values: Array,
        unit: float,
        is_soft: bool,
    ) -> None:
        spacing = self._spacing * camera.scale / max(unit, 0.7)
        ink = _SEEN * min(max((spacing - _FINE) / (_COARSE - _FINE), 0.0), 1.0)
        if self.draw != "both" or self.colour == "fringes":
            ink = 0.0
        width = 2.0 * max(_SPRING * unit, _MIN_SPRING)
        corners = self.triangles.triangles
        colours = self.colours(values)
        lines = self.lattice.bonds
        if self.colour == "fringes":
            points, inks = self._fringes(placed, values)
            draw_triangles(canvas, _put(camera, points.reshape(-1, 2), inks))
        elif ink and is_soft:
            # `take` gathers pairs ten times faster than an index does.
            each = corners.ravel()
            points = placed.take(each, axis=0)
            out = _put(camera, points, colours.take(each, axis=0))
            pixels = camera.scale * points.reshape(-1, 3, 2)
            out[:, 3:6] = _darkness(pixels, ink, width)
            draw_triangles(canvas, out)
            lines = self.triangles.crossing
        else:
            draw_triangles(canvas, _put(camera, placed, colours), corners)
        if ink and len(lines):
            shade = (1.0 - ink) * colours[lines.ravel()]
            _lines(canvas, camera, placed[lines], shade, width)

    def _outlines(
        self, placed: Array, colours: NDArray[np.float32], half: float
    ) -> list[geometry.Shape]:
        theme = THEMES[self.theme]
        shapes = []
        for sides in (self.triangles.outline, self.triangles.interfaces):
            if not len(sides):
                continue
            inside = colours[sides]
            outside: Any = inside.mean(axis=1)
            if sides is self.triangles.outline:
                outside = theme.ground
            start, end = placed[sides.T]
            shapes.append(
                geometry.outline(start, end, half, inside, theme.ink, outside)
            )
        return shapes

    def marks(
        self, camera: Camera, x: Array, v: Array, placed: Array, unit: float
    ) -> list[Mark]:
        """Return the marks above the disk: the spoke, arrows of forces, and the arrow
        of the velocity of the centre of mass with a dot at its foot."""
        theme = THEMES[self.theme]
        foot = self.lattice.mean(placed)
        centre = camera.to_pixels(foot)
        found = []
        if self.spoke >= 0:
            end = camera.to_pixels(placed[self.spoke])
            half = max(_OUTLINE * unit, 1.0)
            found.append(Mark(marks.line(centre, end, half), ink(theme.ink), half))
        if self.full_force and self.wall:
            distance = max(_NEXT * unit, 9.0) / camera.scale
            feet, forces = self.pushes(x, v, placed, distance)
            if len(feet):
                corners = _arrows(camera, feet, ARROW * forces, FORCE_ARROW, unit)
                found.append(Mark(corners, ink(theme.arrow), _FORCE_RIM * unit))
        if self.full_speed:
            colour = ink(theme.velocity)
            velocity = self.lattice.mean(v)[None] / self.full_speed
            if np.hypot(*velocity.T) > _SLOW:
                vectors = VELOCITY_ARROW * velocity
                corners = _arrows(camera, foot[None], vectors, _VELOCITY_ARROW, unit)
                found.append(Mark(corners, colour, _RIM * unit))
            found.append(Mark(marks.dot(centre, _DOT * unit), colour, _RIM * unit))
        return found

    def pushes(
        self, x: Array, v: Array, placed: Array, distance: float
    ) -> tuple[Array, Array]:
        """Return the starts (k, 2) [R] of arrows and their forces (k, 2) over
        `full_force`."""
        # If points are closer than `distance` [R], one arrow shows the mean force of
        # all points within that distance.
        points, forces = self.wall.contact_forces(self.lattice, x, v, self.springs)
        forces = forces / self.full_force
        strong = np.hypot(*forces.T) > _WEAK
        feet = placed[points[strong]]
        forces = forces[strong]
        chain = np.zeros((1, 2))
        if self.has_elastic_wall:
            chain = placed[self.lattice.wall_surface]
        # Magnified displacements may move points into the wall, which would hide their
        # arrows.
        surface = np.interp(feet[:, 0], *chain.T)
        feet[:, 1] = np.maximum(feet[:, 1], surface + self.edge)
        cells = np.floor(feet[:, 0] / distance)
        _, group = np.unique(cells, return_inverse=True)
        return _means(feet, group), _means(forces, group)

    def _of_springs(self, x: Array, v: Array, values: Array, ringing: float) -> Array:
        if QUANTITIES[self.colour].on != "springs":
            return values[self.lattice.bonds].mean(axis=1)
        own = own_values(self.colour, self.triangles, self.springs, x, v)
        return self.normalised(ringing * own)


def _lines(
    canvas: Any, camera: Camera, ends: Array, colours: NDArray[Any], width: float
) -> None:
    """Draw lines `width` [px] wide. `ends` (k, 2, 2) [R]; `colours` (2 k, 3)."""
    out = _put(camera, ends.reshape(-1, 2), colours)
    info = get_field_info(out), get_field_info(None)
    canvas.canvas.lines(*info, HAS_COLOURS, BLACK, width / camera.height)


def _circles(
    canvas: Any, camera: Camera, centres: Array, colours: NDArray[Any], radius: float
) -> None:
    """Draw circles of a radius [px]. `centres` (k, 2) [R]; `colours` (k, 3)."""
    out = _put(camera, centres, colours)  # which stays alive while GGUI reads it
    info = get_field_info(out)
    has_radii = False
    canvas.canvas.circles(info, HAS_COLOURS, has_radii, BLACK, radius / camera.height)


def _means(vectors: Array, group: NDArray[np.intp]) -> Array:
    """Return the mean vector (g, 2) of each group. `group` (k,): number of the group of
    each of `vectors` (k, 2)."""
    sums = [np.bincount(group, part) for part in vectors.T]
    return np.stack(sums, axis=1) / np.bincount(group)[:, None]


def _arrows(
    camera: Camera, feet: Array, vectors: Array, sizes: tuple[float, float], unit: float
) -> Array:
    """Return the corners [px] of arrows from `feet` along `vectors` (k, 2) [R]."""
    shaft, head = sizes
    upwards = camera.scale * np.array([1.0, -1.0])
    return marks.arrows(
        camera.to_pixels(feet), upwards * vectors, unit * shaft, unit * head
    )


def _put(camera: Camera, points: Array, colours: NDArray[Any]) -> Vertices:
    """Return GGUI's vertices with `colours` (k, 3)."""
    out = np.zeros((len(points), VERTEX), dtype=np.float32)
    factor, shift = camera.canvas_map()
    out[:, :2] = factor * points + shift
    out[:, 8:11] = colours
    out[:, 11] = 1.0
    return out


def _darkness(corners: Array, ink: float, width: float) -> Array:
    """Return the darkness (3 t, 3) of the three sides at the corners of triangles.

    On a side it is `ink`, and it falls to 0 at the distance `width` [px], so that two
    adjacent triangles draw a line as heavy as a hard one of this width. `corners`:
    (t, 3, 2) [px].
    """
    opposite = np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1)
    length = np.maximum(np.hypot(opposite[..., 0], opposite[..., 1]), 1e-9)
    height = np.abs(double_area(corners))[:, None] / length
    darkness = np.full((len(corners), 3, 3), ink)
    # A corner lies on two sides, and off the side that is opposite to it.
    corner = np.arange(3)
    darkness[:, corner, corner] = ink * (1.0 - height / width)
    return darkness.reshape(-1, 3)


def draw_triangles(
    canvas: Any, vertices: Vertices, corners: NDArray[np.int32] | None = None
) -> None:
    """Draw triangles from arrays. `corners` (k, 3): vertices of each triangle; by
    default three consecutive ones."""
    # `Canvas.triangles` of Taichi 1.7.4 first copies fields into such arrays, with a
    # kernel for each lattice (0.3 s).
    indices = get_field_info(None if corners is None else corners.ravel())
    canvas.canvas.triangles(get_field_info(vertices), indices, HAS_COLOURS, BLACK)


def _quartered(corners: Array) -> Array:
    """Divide triangles (t, 3, ...) into four equal ones each (4 t, 3, ...)."""
    a, b, c = np.moveaxis(corners, 1, 0)
    ab = 0.5 * (a + b)
    bc = 0.5 * (b + c)
    ca = 0.5 * (c + a)
    parts = (ab, bc, ca), (a, ab, ca), (b, bc, ab), (c, ca, bc)
    return np.concatenate([np.stack(part, axis=1) for part in parts])
