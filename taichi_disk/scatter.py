"""Random points with a minimum distance: exact random sequential adsorption, in whole-array steps."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

Array = NDArray[np.float64]
Depth = Callable[[Array], Array]
"""Signed distance of points (n, 2) to the edge of a region, positive inside."""

# Random sequential adsorption jams where disks as wide as the minimum distance cover 0.547 of the plane,
# that is at 0.777 hexagonal spacings (Feder, J. Theor. Biol. 87, 237, 1980). Small bodies scatter about that.
MAX_SPACING = 0.75
_RESTARTS = 1000
_CROWDED = 0.04  # below this share of hits, darts are aimed at the uncovered part of the region only


def hexagonal_spacing(points: int) -> float:
    """Neighbour distance [R] of a triangular lattice with `points` points in the area of the unit circle."""
    return float(np.sqrt(2.0 * np.pi / (np.sqrt(3.0) * points)))


def scatter(
    rng: np.random.Generator, count: int, low: Array, high: Array, depth: Depth, spacing: float, fixed: Array
) -> Array:
    """`count` points, uniform in a region, at least `spacing` from one another and from the points `fixed`.

    The region is where `depth` is positive, within the box `low`..`high` (2,). Returns (count, 2) [R].
    Raises SimulationError if the region has no room for so many points.
    """
    if spacing == 0.0 or count == 0:
        return _uniform(rng, count, low, high, depth)
    for _ in range(_RESTARTS):
        points = _adsorb(rng, count, low, high, depth, spacing, fixed)
        if len(points) == count:
            return points
    raise SimulationError(f"no room for {count} points at a mutual distance of {spacing:.3g}: lower min_spacing")


def _uniform(rng: np.random.Generator, count: int, low: Array, high: Array, depth: Depth) -> Array:
    points = np.empty((0, 2))
    while len(points) < count:
        darts = low + (high - low) * rng.random((count + 16, 2))
        points = np.concatenate([points, darts[depth(darts) >= 0.0]])
    return points[:count]


def _adsorb(
    rng: np.random.Generator, count: int, low: Array, high: Array, depth: Depth, spacing: float, fixed: Array
) -> Array:
    """As `scatter`, but returns fewer points than asked where it has jammed.

    Darts are thrown into square cells of equal size. As the region fills up, cells that a single point
    covers wholly are dropped and the rest are quartered (Ebeida et al., ACM Trans. Graph. 30, 49, 2011).
    Each dart remains uniform in the free area: random sequential adsorption with few misses.
    """
    from scipy.spatial import cKDTree

    side = float(np.sqrt(np.prod(high - low) / (4 * count)))
    nx, ny = np.maximum(np.ceil((high - low) / side), 1).astype(int)
    cells = low + side * np.stack(np.meshgrid(np.arange(nx), np.arange(ny)), axis=-1).reshape(-1, 2)
    points = fixed
    total = len(fixed) + count
    while len(points) < total and len(cells):
        aimed = min(4 * count, 16 * (total - len(points)) + 16)
        darts = cells[rng.integers(len(cells), size=aimed)] + side * rng.random((aimed, 2))
        darts = darts[depth(darts) >= 0.0]
        if len(points):
            darts = darts[cKDTree(points).query(darts, distance_upper_bound=spacing)[0] >= spacing]
        darts = _first_come(darts, spacing)
        points = np.concatenate([points, darts[: total - len(points)]])
        if len(darts) < _CROWDED * aimed:
            cells = _uncovered(cells, side, depth, spacing, points)
            side /= 2
            quarters = np.array([[0.0, 0.0], [side, 0.0], [0.0, side], [side, side]])
            cells = (cells[:, None, :] + quarters).reshape(-1, 2)
    return points[len(fixed) :]


def _uncovered(cells: Array, side: float, depth: Depth, spacing: float, points: Array) -> Array:
    """The cells of which some part may lie in the region and `spacing` away from every point."""
    from scipy.spatial import cKDTree

    half_diagonal = side * np.sqrt(0.5)
    reach = max(spacing - half_diagonal, 0.0)
    cells = cells[depth(cells + side / 2) >= -half_diagonal]
    return cells[cKDTree(points).query(cells + side / 2, distance_upper_bound=reach)[0] >= reach]


def _first_come(darts: Array, spacing: float) -> Array:
    """The darts that remain when each, in turn, is dropped if too close to one that remained before it."""
    from scipy.spatial import cKDTree

    pairs = np.sort(cKDTree(darts).query_pairs(spacing, output_type="ndarray"), axis=1)
    dropped = np.zeros(len(darts), dtype=bool)
    while len(pairs):
        waiting = np.zeros(len(darts), dtype=bool)
        waiting[pairs[:, 1]] = True
        dropped[pairs[~waiting[pairs[:, 0]], 1]] = True
        pairs = pairs[~dropped[pairs].any(axis=1)]
    return darts[~dropped]
