"""Camera, and triangles of wall, outlines and arrows. NumPy only.

A potential has no edge. The wall is drawn solid up to the height at which it exerts the
largest force of the run on one point, so the disk visibly rests on it at the greatest
compression. Above that edge the wall fades like its force, with exp(-a distance). An
elastic wall has this layer on its surface.

GGUI has no antialiasing, so lines fade to the adjacent colours over one pixel.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.lattice import Array, Lattice
from taichi_disk.render.palette import Colour, Theme, round_near
from taichi_disk.statics.equilibrium import roll_angle, turned

View = tuple[float, float, float, float]
# corners of triangles (3 k, 2) [R] and their colours (3 k, 3)
Shape = tuple[Array, Array]

ARROW = 0.35  # length of the arrow of `full_force` [R]
# heights [decay lengths]; the haze is interpolated, within 2 %
_FADES = np.array([0.0, 0.4, 1.0, 1.8, 3.0, 5.0])
FLATTENING = 0.05  # flattening of the drawn disk at automatic magnification [R]
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
    # (left, right, top, bottom) [px], the part of the canvas for the scene
    viewport: View

    @classmethod
    def fit(
        cls,
        view: View,
        width: int,
        height: int,
        margin: float = 0.0,
        viewport: View | None = None,
    ) -> Camera:
        """Return the camera that shows `view` (xmin, xmax, ymin, ymax) [R] as large as
        possible in `viewport`."""
        xmin, xmax, ymin, ymax = view
        left, right, top, bottom = viewport = viewport or (
            0.0,
            float(width),
            0.0,
            float(height),
        )
        room = right - left - 2.0 * margin, bottom - top - 2.0 * margin
        scale = max(min(room[0] / (xmax - xmin), room[1] / (ymax - ymin)), 1e-3)
        middle = (left + right) / 2.0, (top + bottom) / 2.0
        return cls(
            width,
            height,
            scale,
            ((xmin + xmax) / 2.0, (ymin + ymax) / 2.0),
            middle,
            viewport,
        )

    def to_scene(self, pixels: ArrayLike) -> Array:
        """Convert (column, row) (..., 2) [px] to points of the scene [R]; pixel k
        covers k to k + 1."""
        offset = (np.asarray(pixels, dtype=np.float64) - self.middle) / self.scale
        return np.stack(
            [self.look_at[0] + offset[..., 0], self.look_at[1] - offset[..., 1]],
            axis=-1,
        )

    def zoomed(self, factor: float, at: tuple[float, float]) -> Camera:
        """Return a camera magnified by `factor` about the pixel `at` (column, row)."""
        (x, y), (column, row) = self.middle, at
        middle = column + factor * (x - column), row + factor * (y - row)
        return replace(self, scale=self.scale * factor, middle=middle)

    def panned(self, columns: float, rows: float) -> Camera:
        return replace(self, middle=(self.middle[0] + columns, self.middle[1] + rows))

    @property
    def seen(self) -> View:
        """The part of the scene in the viewport: (xmin, xmax, ymin, ymax) [R]."""
        left, right, top, bottom = self.viewport
        (xmin, ymin), (xmax, ymax) = self.to_scene([(left, bottom), (right, top)])
        return float(xmin), float(xmax), float(ymin), float(ymax)

    def canvas_map(self) -> tuple[Array, Array]:
        """Return factor and shift (2,) with which factor * xy + shift are GGUI's
        coordinates (0 to 1, y upwards)."""
        size = np.array([self.width, self.height])
        factor = self.scale / size
        origin = np.array([self.middle[0], self.height - self.middle[1]]) / size
        return factor, origin - factor * np.asarray(self.look_at)


# ---- displacements


def flattening(lattice: Lattice, x: Array) -> float:
    """Return how much the lowest point of a disk at `x` (n, 2) has approached its
    centre [R]."""
    # Return 1 on an elastic wall, because magnified displacements would separate disk
    # and dent.
    if len(lattice.wall_surface):
        return 1.0
    rest, now = lattice.positions[: lattice.disk_points], x[: lattice.disk_points]
    unloaded = turned(rest, roll_angle(rest, now))
    return float(
        np.ptp([unloaded[:, 1].mean(), unloaded[:, 1].min()])
        - np.ptp([now[:, 1].mean(), now[:, 1].min()])
    )


def magnification(wanted: float | str, flattest: float) -> float:
    """Return the factor for displacements; "auto" makes the flattening `flattest` [R]
    look like FLATTENING."""
    return (
        max(1.0, round_near(FLATTENING / max(flattest, 1e-9)))
        if wanted == "auto"
        else float(wanted)
    )


# ---- shapes


def joined(*shapes: Shape) -> Shape:
    return np.concatenate([one[0] for one in shapes]), np.concatenate(
        [one[1] for one in shapes]
    )


def edge_height(wall: Any, force: float) -> float:
    """Return the height of a wall's edge above its surface [R], where it exerts `force`
    [M c^2/R] on a point."""
    return (
        max(wall.height_of_force(force), 0.0)
        if wall is not None and force > 0.0
        else 0.0
    )


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
    ground, wall = np.asarray(theme.ground), np.asarray(theme.wall)
    haze = _strips(chain, edge + decay * _FADES, ground + weight * (wall - ground))
    return haze, _strips(chain, np.array([-depth, edge]), np.array([wall, wall]))


def _strips(chain: Array, heights: Array, colours: Array) -> Shape:
    ends = np.concatenate([chain[:1], chain, chain[-1:]])
    along = ends[2:] - ends[:-2]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    grid = chain + heights[:, None, None] * normal
    parts = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    below, above = (
        np.repeat(ends, len(chain) - 1, axis=0) for ends in (colours[:-1], colours[1:])
    )
    return quads(*(part.reshape(-1, 2) for part in parts), below, below, above, above)


def quads(a: Array, b: Array, c: Array, d: Array, *colours: Array) -> Shape:
    """Return quadrangles a, b, c, d (k, 2); `colours`: of each corner, (3,) or (k,
    3)."""
    each = [np.broadcast_to(colour, (len(a), 3)) for colour in colours]
    order = (0, 1, 2, 0, 2, 3)
    corners = np.stack([(a, b, c, d)[k] for k in order], axis=1)
    return corners.reshape(-1, 2), np.stack([each[k] for k in order], axis=1).reshape(
        -1, 3
    )


def _left(start: Array, end: Array, half: float) -> Array:
    along = end - start
    along *= half / np.maximum(np.hypot(*along.T), 1e-300)[:, None]
    return np.stack([-along[:, 1], along[:, 0]], axis=1)


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
    left = _left(start, end, half)
    along = np.stack([left[:, 1], -left[:, 0]], axis=1)
    start, end, middle = start - 0.3 * along, end + 0.3 * along, np.asarray(ink)
    outer = quads(
        start - left, end - left, end, start, *[np.asarray(outside)] * 2, middle, middle
    )
    inner = quads(
        start, end, end + left, start + left, middle, middle, inside[:, 1], inside[:, 0]
    )
    return joined(outer, inner)


def arrows(
    feet: Array, forces: Array, head: float, width: float, rim: float, theme: Theme
) -> Shape:
    """Return arrows that start at `feet` (k, 2) [R], along `forces` (k, 2); a force of
    1 has the length ARROW.

    `head`, `width`, `rim`: half the width of the largest head, width of the shaft,
        width of the rim around both [R].
    """
    size = np.hypot(forces[:, 0], forces[:, 1])[:, None]
    along = forces / size
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    wing = np.minimum(head, 0.3 * ARROW * size)
    tip = feet + ARROW * size * along
    neck, parts = tip - 2.0 * wing * along, []
    for colour, r in ((theme.ground, rim), (theme.arrow, 0.0)):
        w, h, foot, back = (
            (0.5 * width + r) * across,
            (wing + 1.8 * r) * across,
            feet - r * along,
            neck - r * along,
        )
        shaft = [foot - w, foot + w, neck + w, foot - w, neck + w, neck - w]
        corners = [*shaft, back - h, back + h, tip + 2.5 * r * along]
        points = np.stack(corners, axis=1).reshape(-1, 2)
        parts.append((points, np.tile(np.asarray(colour), (len(points), 1))))
    return joined(*parts)
