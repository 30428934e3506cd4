"""What is drawn beside the field, as triangles: outlines, the wall as a body, arrows of its push. NumPy only.

A potential has no edge. The wall is drawn solid up to where its force on one point is the largest that is known of the
run: there the disk visibly rests when it is squeezed most. Above that edge the wall fades as its force does, with
exp(-a distance): a hard wall ends sharply, a soft one in a haze. The elastic wall's potential is a skin on its surface.

GGUI smooths nothing, so lines fade to what is beside them over a pixel.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Array
from taichi_disk.render.palette import Colour, Theme

Shape = tuple[Array, Array]  # corners of triangles (3 k, 2) [R] and their colours (3 k, 3)

ARROW = 0.35  # length of the arrow of the full force [R]
_FADES = np.array([0.0, 0.4, 1.0, 1.8, 3.0, 5.0])  # decay lengths between which colours are mixed, 2 % off at most
NOTHING: Shape = np.zeros((0, 2)), np.zeros((0, 3))


def joined(*shapes: Shape) -> Shape:
    """Several shapes, drawn one after the other."""
    return np.concatenate([one[0] for one in shapes]), np.concatenate([one[1] for one in shapes])


def edge_height(wall: Any, force: float) -> float:
    """Height above the surface at which a wall pushes a point with `force` [M c^2/R]: its edge in pictures [R]."""
    return max(wall.height_of_force(force), 0.0) if wall is not None and force > 0.0 else 0.0


def wall_body(chain: Array, depth: float, edge: float, decay: float, theme: Theme) -> tuple[Shape, Shape]:
    """How a wall is drawn: its haze, which belongs below the disk, and its solid body, over the disk's outline.

    Args:
        chain: (k, 2) [R], the surface, ordered by x.
        depth, edge: the body reaches from so far below the surface to so far above it [R].
        decay: over which it fades above that, 1/a or what half a pixel covers [R].
    """
    share = np.exp(-_FADES)[:, None]
    share[-1] = 0.0
    ground, wall = np.asarray(theme.ground), np.asarray(theme.wall)
    haze = _strips(chain, edge + decay * _FADES, ground + share * (wall - ground))
    return haze, _strips(chain, np.array([-depth, edge]), np.array([wall, wall]))


def _strips(chain: Array, heights: Array, colours: Array) -> Shape:
    """Between `heights` (k,) above a chain, which have the `colours` (k, 3)."""
    ends = np.concatenate([chain[:1], chain, chain[-1:]])
    along = ends[2:] - ends[:-2]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    grid = chain + heights[:, None, None] * normal
    parts = (grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1])
    below, above = (np.repeat(ends, len(chain) - 1, axis=0) for ends in (colours[:-1], colours[1:]))
    return quads(*(part.reshape(-1, 2) for part in parts), below, below, above, above)


def quads(a: Array, b: Array, c: Array, d: Array, *colours: Array) -> Shape:
    """Quadrangles a, b, c, d (k, 2) with one colour, or (k, 3), for each of their corners."""
    each = [np.broadcast_to(colour, (len(a), 3)) for colour in colours]
    order = (0, 1, 2, 0, 2, 3)
    corners = np.stack([(a, b, c, d)[k] for k in order], axis=1)
    return corners.reshape(-1, 2), np.stack([each[k] for k in order], axis=1).reshape(-1, 3)


def outline(start: Array, end: Array, half: float, inside: NDArray[Any], ink: Colour, outside: Colour | Array) -> Shape:
    """Lines from `start` to `end` (k, 2), twice `half` [R] wide, that fade to either side.

    Args:
        inside: colours (k, 2, 3) at both ends of what lies to the left.
        outside: the colour of what lies to the right.
    """
    along = end - start
    along *= half / np.maximum(np.hypot(*along.T), 1e-300)[:, None]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1)
    start, end, middle = start - 0.3 * along, end + 0.3 * along, np.asarray(ink)
    outer = quads(start - left, end - left, end, start, *[np.asarray(outside)] * 2, middle, middle)
    inner = quads(start, end, end + left, start + left, middle, middle, inside[:, 1], inside[:, 0])
    return joined(outer, inner)


def arrows(feet: Array, forces: Array, head: float, width: float, rim: float, theme: Theme) -> Shape:
    """An arrow on each foot (k, 2) [R] along its force (k, 2), as long as ARROW where that is 1.

    Args:
        head, width, rim: half the width of the largest head; width of a shaft; of the ground's colour around both [R].
    """
    size = np.hypot(forces[:, 0], forces[:, 1])[:, None]
    along = forces / size
    across = np.stack([along[:, 1], -along[:, 0]], axis=1)
    wing = np.minimum(head, 0.3 * ARROW * size)
    tip = feet + ARROW * size * along
    neck, parts = tip - 2.0 * wing * along, []
    for colour, r in ((theme.ground, rim), (theme.arrow, 0.0)):
        w, h, foot, back = (0.5 * width + r) * across, (wing + 1.8 * r) * across, feet - r * along, neck - r * along
        shaft = [foot - w, foot + w, neck + w, foot - w, neck + w, neck - w]
        corners = [*shaft, back - h, back + h, tip + 2.5 * r * along]
        place = np.stack(corners, axis=1).reshape(-1, 2)
        parts.append((place, np.tile(np.asarray(colour), (len(place), 1))))
    return joined(*parts)
