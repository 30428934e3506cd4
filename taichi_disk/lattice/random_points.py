"""Mass points at random, in the unit circle for the disk, in a rectangle for the elastic wall.

Points with a minimum distance come by random sequential adsorption, exactly, in whole-array steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice.triangles import Array

MIN_POINTS, MAX_POINTS = 3, 2_000_000
MIN_ROWS = 3  # of springs across a wall or a ring, below which it is a truss rather than a lattice
MIN_EDGE = 6  # points on the edge of a hole
Depth = Callable[[Array], Array]
"""Signed distance of points (n, 2) to the edge of a region, positive inside."""

# Random sequential adsorption jams where disks as wide as the minimum distance cover 0.547 of the plane,
# that is at 0.777 hexagonal spacings (Feder, J. Theor. Biol. 87, 237, 1980). Small bodies scatter about that.
MAX_SPACING = 0.75
_RESTARTS = 1000
_CROWDED = 0.04  # below this share of hits, darts are aimed at the uncovered part of the region only


def circle_points(points: int, seed: int, rim: bool, min_spacing: float, hole: float = 0.0, core: float = 0.0) -> Array:
    """The points (points, 2) [R] of `Lattice.disk`, with its arguments. Raises what it raises, but for meshing."""
    if not MIN_POINTS <= points <= MAX_POINTS:
        raise InputError(f"lattice.points must be between {MIN_POINTS} and {MAX_POINTS}, not {points}")
    for key, fault in circle_faults(points, hole, core):
        raise InputError(f"lattice.{key}: {fault}")
    spacing = least_distance(points, min_spacing) * math.sqrt(1.0 - hole**2)
    rng = np.random.default_rng(seed)
    circle: Array = np.empty((0, 2))
    radius = 1.0
    count = rim_points(points, hole)
    if rim:
        circle = _unit_circle((np.arange(count) + rng.random()) / count)
        apothem = float(_unit_circle(np.array([0.5 / count]))[0, 0])
        # No triangle on a rim chord is flatter than an equilateral one. (Four points have no room for so much.)
        radius = max(apothem - spacing * np.sqrt(0.75), 0.2 * apothem)
    corner = np.full(2, radius)
    # So far from other circles, or not all of their chords would be springs.
    clear = max(spacing * np.sqrt(0.75), 1.1 * np.pi / count)
    for inner in filter(None, (hole, core)):
        turns = np.arange(round(inner * count)) + rng.random()
        circle = np.concatenate([circle, inner * _unit_circle(turns / round(inner * count))])

    def depth(p: Array) -> Array:
        r = np.sqrt(p[:, 0] ** 2 + p[:, 1] ** 2)
        found = radius - r
        if hole:
            found = np.minimum(found, r - hole - clear)
        return np.minimum(found, np.abs(r - core) - clear) if core else found

    inside = scatter(rng, points - len(circle), -corner, corner, depth, spacing, circle)
    return np.concatenate([circle, inside])


def rim_points(points: int, hole: float = 0.0) -> int:
    """How many of a disk's points lie on its rim: so many that their spacing is that of the points inside.

    A point on the rim owns half the area of one inside, so the points stand for n = points - rim/2 whole
    ones; hexagonal_spacing(n) = 2 pi/rim is a quadratic equation for rim. At least one point stays inside.
    With a `hole` [R] the rim and its edge together own the half.
    """
    k = 2.0 * np.pi * np.sqrt(3.0) * (1.0 + hole) / (1.0 - hole)
    even = round(float(np.sqrt(k * points + k * k / 16.0) - k / 4.0) / (1.0 + hole))
    return min(even, points - 1) if points > 3 else 3


def circle_faults(points: int, hole: float, core: float) -> list[tuple[str, str]]:
    """(key, what is wrong) of a hole or a core [R] that so many points cannot make."""
    row = 2.0 * np.pi / rim_points(points, min(hole, 0.99))
    least, faults = MIN_EDGE * row / (2.0 * np.pi), []
    limits = {"hole": (hole, least, 1.0 - MIN_ROWS * row), "core_radius": (core, max(least, hole + row), 1.0 - row)}
    for key, (radius, low, high) in limits.items():
        if radius and not low <= radius <= high:
            beside = f" and a hole of {hole:g} R" if hole and key != "hole" else ""
            bound = f"at least {low:.3g}" if radius < low else f"at most {high:.3g}"
            need = f"{MIN_EDGE} springs round it and {MIN_ROWS if key == 'hole' else 1} between it and the rim"
            text = f"must be {bound}, about, with {points} points{beside}, not {radius:g}: there have to be {need}"
            faults.append((key, f"{text}, so write another, or more lattice.points"))
    return faults


def _unit_circle(turns: Array) -> Array:
    """(cos, sin) of 2 pi `turns`, turns in [0, 1), by Taylor's series in sums and products alone.

    These round alike everywhere, whereas the last bit of NumPy's cos and sin depends on the processor.
    """
    angle = np.pi * (2.0 * turns - 1.0)
    square = angle * angle
    c, s = np.ones_like(angle), np.ones_like(angle)
    for k in range(32, 0, -2):
        c = 1.0 - square / ((k - 1) * k) * c
        s = 1.0 - square / (k * (k + 1)) * s
    xy = -np.stack([c, angle * s], axis=1)
    return xy / np.sqrt(xy[:, :1] ** 2 + xy[:, 1:] ** 2)


def hexagonal_spacing(points: int) -> float:
    """Neighbour distance [R] of a triangular lattice with `points` points in the area of the unit circle."""
    return float(np.sqrt(2.0 * np.pi / (np.sqrt(3.0) * points)))


def least_distance(points: int, min_spacing: float) -> float:
    """`min_spacing` hexagonal spacings [R]. Raises InputError if random points cannot keep that distance."""
    if not 0.0 <= min_spacing <= MAX_SPACING:
        raise InputError(f"lattice.min_spacing must be between 0 and {MAX_SPACING}, not {min_spacing}")
    return min_spacing * hexagonal_spacing(points)


def scatter(
    rng: np.random.Generator, count: int, low: Array, high: Array, depth: Depth, spacing: float, fixed: Array
) -> Array:
    """(count, 2) points [R], uniform in a region, at least `spacing` from one another and from the points `fixed`.

    The region is where `depth` is positive, within the box `low`..`high` (2,).
    Raises SimulationError if the region has no room for so many points.
    """
    if spacing == 0.0 or count == 0:
        points: Array = np.empty((0, 2))
        while len(points) < count:
            darts = low + (high - low) * rng.random((count + 16, 2))
            points = np.concatenate([points, darts[depth(darts) >= 0.0]])
        return points[:count]
    for _ in range(_RESTARTS):
        points = _adsorb(rng, count, low, high, depth, spacing, fixed)
        if len(points) == count:
            return points
    raise SimulationError(f"no room for {count} points at a mutual distance of {spacing:.3g}: lower min_spacing")


def _adsorb(
    rng: np.random.Generator, count: int, low: Array, high: Array, depth: Depth, spacing: float, fixed: Array
) -> Array:
    """As `scatter`, but returns fewer points than asked where it has jammed.

    Darts are thrown into square cells of equal size. As the region fills up, cells that a single point
    covers wholly are dropped and the rest are quartered (Ebeida et al., ACM Trans. Graph. 30, 49, 2011).
    Each dart remains uniform in the free area: random sequential adsorption with few misses.
    """
    from taichi_disk.lattice.spatial import cKDTree

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
            # Only cells remain of which some part may lie in the region and `spacing` away from every point.
            half_diagonal = side * np.sqrt(0.5)
            reach = max(spacing - half_diagonal, 0.0)
            cells = cells[depth(cells + side / 2) >= -half_diagonal]
            cells = cells[cKDTree(points).query(cells + side / 2, distance_upper_bound=reach)[0] >= reach]
            side /= 2
            quarters = np.array([[0.0, 0.0], [side, 0.0], [0.0, side], [side, side]])
            cells = (cells[:, None, :] + quarters).reshape(-1, 2)
    return points[len(fixed) :]


def _first_come(darts: Array, spacing: float) -> Array:
    """The darts that remain when each, in turn, is dropped if too close to one that remained before it."""
    from taichi_disk.lattice.spatial import cKDTree

    pairs = np.sort(cKDTree(darts).query_pairs(spacing, output_type="ndarray"), axis=1)
    dropped = np.zeros(len(darts), dtype=bool)
    while len(pairs):
        waiting = np.zeros(len(darts), dtype=bool)
        waiting[pairs[:, 1]] = True
        dropped[pairs[~waiting[pairs[:, 0]], 1]] = True
        pairs = pairs[~dropped[pairs].any(axis=1)]
    return darts[~dropped]


def rectangle_points(
    rng: np.random.Generator, points: int, low: Array, high: Array, row: float, spacing: float
) -> Array:
    """`points` points (points, 2) in the box `low`..`high`, at least `spacing` apart.

    They include evenly spaced rows, about `row` apart, along the four sides; none if `row` is infinite.
    Raises InputError if the rows alone take all the points.
    """
    frame: Array = np.empty((0, 2))
    clear = 0.0
    if math.isfinite(row):
        nx, ny = (max(round(float(s) / row), 1) for s in high - low)
        x, y = np.linspace(low[0], high[0], nx + 1), np.linspace(low[1], high[1], ny + 1)[1:-1]
        rows = [np.stack([x, np.full_like(x, level)], axis=1) for level in (low[1], high[1])]  # bottom, top
        frame = np.concatenate(rows + [np.stack([np.full_like(y, at), y], axis=1) for at in (low[0], high[0])])
        clear = spacing * math.sqrt(0.75)
    if points <= len(frame):
        raise InputError(f"{points} points are too few for the rows along the sides of a rectangle: widen it")
    low, high = low + clear, high - clear

    def depth(p: Array) -> Array:
        return np.minimum(p - low, high - p).min(axis=1)

    return np.concatenate([frame, scatter(rng, points - len(frame), low, high, depth, spacing, frame)])
