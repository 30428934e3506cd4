"""Camera, and triangles of wall and outlines. NumPy only.

A potential has no edge. The wall is drawn solid up to the height at which it exerts the
largest force of the run on one point, so the disk visibly rests on it at the greatest
compression. Above that edge the wall fades like its force, with exp(-a distance). An
elastic wall has this layer on its surface.

GGUI has no antialiasing. Outlines fade to the adjacent colours over one pixel.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.triangles import quarter_turned
from taichi_disk.mechanics.statics.equilibrium import roll_angle, turned
from taichi_disk.pictures.render.palette import Colour, Theme, round_near

View = tuple[float, float, float, float]
# corners of triangles (3 k, 2) [R] and their colours (3 k, 3)
Shape = tuple[Array, Array]

# heights [decay lengths]; the haze is interpolated, within 2 %
_FADES = np.array([0.0, 0.4, 1.0, 1.8, 3.0, 5.0])
FLATTENING = 0.05  # flattening of the drawn disk at automatic magnification [R]
MAX_MAGNIFICATION = 20.0  # largest automatic one
NOTHING: Shape = np.zeros((0, 2)), np.zeros((0, 3))


@dataclass(frozen=True)
class Camera:
    """A view with equal scales in x and y. Pixels count from the canvas's upper left
    corner, rows downwards."""

    width: int  # width of the canvas [px]
    height: int  # height of the canvas [px]
    scale: float  # pixels per R
    look_at: tuple[float, float]  # point of the scene [R] that is shown at `middle`
    middle: tuple[float, float]  # (column, row) [px]

    @classmethod
    def fit(cls, view: View, width: int, height: int, viewport: View) -> Camera:
        """Return the camera that shows `view` (xmin, xmax, ymin, ymax) [R] as large as
        possible at the bottom of `viewport` (left, right, top, bottom) [px]."""
        xmin, xmax, ymin, ymax = view
        left, right, top, bottom = viewport
        across = (right - left) / (xmax - xmin)
        upwards = (bottom - top) / (ymax - ymin)
        scale = max(min(across, upwards), 1e-3)
        look_at = 0.5 * (xmin + xmax), ymin
        return cls(width, height, scale, look_at, (0.5 * (left + right), bottom))

    def to_scene(self, pixels: ArrayLike) -> Array:
        """Convert (column, row) (..., 2) [px] to points of the scene [R]; pixel k
        covers k to k + 1."""
        offset = (np.asarray(pixels) - self.middle) / self.scale
        return self.look_at + offset * [1.0, -1.0]

    def to_pixels(self, points: ArrayLike) -> Array:
        """Convert points (..., 2) of the scene [R] to (column, row) [px]."""
        offset = (np.asarray(points) - self.look_at) * self.scale
        return self.middle + offset * [1.0, -1.0]

    def cropped(self, rows: slice, columns: slice, factor: float) -> Camera:
        """Return the camera of a part of the canvas, magnified by `factor`."""
        width = round(factor * (columns.stop - columns.start))
        height = round(factor * (rows.stop - rows.start))
        column, row = self.middle
        return Camera(
            width=width,
            height=height,
            scale=factor * self.scale,
            look_at=self.look_at,
            middle=(factor * (column - columns.start), factor * (row - rows.start)),
        )

    def canvas_map(self) -> tuple[Array, Array]:
        """Return factor and shift (2,) with which factor * xy + shift are GGUI's
        coordinates (0 to 1, y upwards)."""
        size = np.array([self.width, self.height])
        factor = self.scale / size
        origin = np.array([self.middle[0], self.height - self.middle[1]]) / size
        return factor, origin - factor * np.asarray(self.look_at)


# ---- displacements


def placed(
    lattice: Lattice,
    x: Array,
    magnify: float,
    edge: float = -math.inf,
    ringing: float = 1.0,
) -> Array:
    """Return where points at `x` (n, 2) are drawn [R] if displacements are magnified.

    Displacements are taken relative to the initial lattice, rotated like the disk, with
    its lowest point at the same height; those of a `ringing`, which is shown so many
    times stronger, with its centre there. No point is drawn below the lowest one of `x`
    or the `edge` of a rigid wall [R], so that the wall stays impenetrable.
    """
    out = np.array(x, order="C")
    if magnify * ringing == 1.0:
        return out
    now = out[: lattice.disk_points]
    floor = min(now[:, 1].min(), edge)
    disk = _unloaded(lattice, x)
    across = now[:, 0].mean() - disk[:, 0].mean()
    up = now[:, 1].min() - disk[:, 1].min()
    disk += [across, up]
    now[:] = disk + magnify * (now - disk)
    disk += (now - disk).mean(axis=0)
    now[:] = disk + ringing * (now - disk)
    now[:, 1] = np.maximum(now[:, 1], floor)
    return out


def _unloaded(lattice: Lattice, x: Array) -> Array:
    """Return the points of the unloaded disk, rotated like the disk at `x`."""
    rest = lattice.positions[: lattice.disk_points]
    return turned(rest, roll_angle(rest, x[: lattice.disk_points]))


def flattening(lattice: Lattice, x: Array, flying: Array) -> float:
    """Return how much a contact has brought the lowest point of a disk at `x` (n, 2)
    closer to its centre [R]; `flying` (n, 2): the disk just before, which a spin may
    have stretched.

    Return 1 if displacements must not be magnified: with an elastic wall, because they
    would separate disk and dent, and if the spin stretches more than the contact
    flattens.
    """
    shortening = _shortening(lattice, x)
    if len(lattice.wall_surface) or shortening < 0.0:
        return 1.0
    return shortening + max(-_shortening(lattice, flying), 0.0)


def _shortening(lattice: Lattice, x: Array) -> float:
    """Return how much closer the lowest point of a disk at `x` is to its centre than in
    the unloaded disk [R]."""
    unloaded = _unloaded(lattice, x)[:, 1]
    now = x[: lattice.disk_points, 1]
    return float(unloaded.mean() - unloaded.min() - (now.mean() - now.min()))


def magnification(wanted: float | str, flattest: float) -> float:
    """Return the factor for displacements; "auto" makes the flattening `flattest` [R]
    look like FLATTENING, with a factor from 1 to MAX_MAGNIFICATION."""
    if wanted != "auto":
        return float(wanted)
    factor = FLATTENING / max(flattest, FLATTENING / MAX_MAGNIFICATION)
    return max(1.0, round_near(factor))


# ---- shapes


def joined(*shapes: Shape) -> Shape:
    points = np.concatenate([points for points, _ in shapes])
    return points, np.concatenate([colours for _, colours in shapes])


def edge_height(wall: Any, force: float) -> float:
    """Return the height of a wall's edge above its surface [R], where it exerts `force`
    [M c^2/R] on a point."""
    if force <= 0.0:
        return 0.0
    return max(wall.height_of_force(force), 0.0)


def wall_body(
    chain: Array, depth: float, edge: float, decay: float, theme: Theme
) -> tuple[Shape, Shape]:
    """Return a wall's haze, to be drawn before the disk, and its solid body, to be
    drawn after the disk's outline.

    Args:
        chain: (k, 2) the surface [R], ordered by x.
        depth, edge: extent of the solid body below and above the surface [R].
        decay: decay length of the haze [R], at least about half a pixel.
    """
    weight = np.exp(-_FADES)[:, None]
    weight[-1] = 0.0
    ground = np.asarray(theme.ground)
    wall = np.asarray(theme.wall)
    haze = _strips(chain, edge + decay * _FADES, ground + weight * (wall - ground))
    return haze, _strips(chain, np.array([-depth, edge]), np.array([wall, wall]))


def _strips(chain: Array, heights: Array, colours: Array) -> Shape:
    normal = _left(np.gradient(chain, axis=0))
    grid = chain + heights[:, None, None] * normal
    inks = np.repeat(colours[:, None], len(chain), axis=1)
    return quads(_cells(grid), _cells(inks))


def _cells(grid: Array) -> list[Array]:
    """Return the four corners of each cell of a grid."""
    return [grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]]


def quads(corners: Sequence[Array], colours: Sequence[Any]) -> Shape:
    """Return quadrangles with four corners (..., 2) and colours (..., 3) there."""
    order = [0, 1, 2, 0, 2, 3]
    points = np.stack(corners, axis=-2)[..., order, :].reshape(-1, 2)
    inks = np.empty((*corners[0].shape[:-1], 4, 3))
    for k, colour in enumerate(colours):
        inks[..., k, :] = colour
    return points, inks[..., order, :].reshape(-1, 3)


def _left(along: Array, length: float = 1.0) -> Array:
    """Return vectors of this length at the left of `along` (..., 2)."""
    size = np.maximum(np.hypot(along[..., 0], along[..., 1]), 1e-300)
    return length / size[..., None] * quarter_turned(along)


def outline(
    start: Array,
    end: Array,
    half: float,
    inside: NDArray[Any],
    ink: Colour,
    outside: Colour | Array,
) -> Shape:
    """Return lines from `start` to `end` (k, 2), 2 `half` [R] wide, which fade to the
    colours on both sides.

    `inside`: colours (k, 2, 3) on the left, at both ends; `outside`: colour on the
        right.
    """
    left = _left(end - start, half)
    beyond = 0.3 * _left(left, half)
    start = start + beyond
    end = end - beyond
    right = [start - left, end - left, end, start]
    outer = quads(right, [outside, outside, ink, ink])
    inner = quads(
        [start, end, end + left, start + left], [ink, ink, inside[:, 1], inside[:, 0]]
    )
    return joined(outer, inner)
