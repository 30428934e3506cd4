"""Random mass points with a minimum distance: in the unit circle for the disk, in a
rectangle for the elastic wall.

They are placed by exact random sequential adsorption, in array operations.
"""

from __future__ import annotations

from collections.abc import Callable
from math import isfinite, pi, sqrt

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.base.errors import InputError, SimulationError, whole_number
from taichi_disk.mechanics.lattice.triangles import Array, norms

MIN_POINTS = 3
MAX_POINTS = 2_000_000
# rows of springs across a wall or a ring; with fewer it is a truss rather than a
# lattice
MIN_ROWS = 3
MIN_EDGE = 6  # smallest number of points on the edge of a hole
Depth = Callable[[Array], Array]
"""Signed distance of points (n, 2) to the edge of a region, positive inside."""

# Random sequential adsorption jams at a minimum distance of 0.777 hexagonal spacings,
# when disks of that diameter cover 0.547 of the plane (Feder, J. Theor. Biol. 87, 237,
# 1980). In small bodies the limit scatters.
MAX_SPACING = 0.75
_MAX_ATTEMPTS = 1000
# at a lower rate of hits, covered cells are removed and the others quartered
_MIN_HIT_RATE = 0.04


def circle_points(
    points: int,
    seed: int,
    rim: bool,
    min_spacing: float,
    hole: float,
    core: float,
) -> Array:
    """Return the points (points, 2) [R] of `Lattice.disk`. Raises InputError or
    SimulationError as it does."""
    check_counts(points, seed)
    for key, fault in circle_faults(points, hole, core):
        raise InputError(f"lattice.{key}: {fault}")
    spacing = least_distance(points, min_spacing) * sqrt(1.0 - hole**2)
    rng = np.random.default_rng(seed)
    on_rim = rim_points(points, hole)
    height = spacing * sqrt(0.75)  # of an equilateral triangle
    circles = [np.empty((0, 2))]
    radius = 1.0  # of the region of the inner points
    if rim:
        circles.append(_ring(rng, on_rim))
        apothem = _unit_circle(np.array([0.5 / on_rim]))[0, 0]
        # Triangles on a chord of the rim are at least as high as equilateral ones. The
        # minimum is for four points.
        radius = max(apothem - height, 0.1)
    for edge in (hole, core):
        if edge:
            circles.append(edge * _ring(rng, round(edge * on_rim)))
    # If points were closer, some chords of the inner circles would not become springs.
    clear = max(height, 1.1 * np.pi / on_rim)

    def depth(p: Array) -> Array:
        r = norms(p.T)
        distance = radius - r
        if hole:
            distance = np.minimum(distance, r - hole - clear)
        if core:
            distance = np.minimum(distance, np.abs(r - core) - clear)
        return distance

    fixed = np.concatenate(circles)
    corner = np.full(2, radius)
    rest = points - len(fixed)
    inside = scatter(rng, rest, -corner, corner, depth, spacing, fixed)
    return np.concatenate([fixed, inside])


def check_counts(points: int, seed: int) -> None:
    whole_number(points, "lattice.points", MAX_POINTS, MIN_POINTS)
    whole_number(seed, "lattice.seed", 2**63, 0)


def rim_points(points: int, hole: float = 0.0) -> int:
    """Return the number of points on the rim for which their spacing equals that of the
    inner points."""
    if points <= 3:
        return 3
    edges = 2.0 * pi * (1.0 + hole)
    spacing = edge_spacing(points, edges, pi * (1.0 - hole**2))
    on_rim = round(2.0 * pi / spacing)
    return min(on_rim, points - 1)  # at least one point stays inside


def edge_spacing(points: int, edges: float, area: float) -> float:
    """Return the distance of points along the edges of a body that equals that of its
    inner points. `edges`: their length."""
    # A point on an edge has half the area of an inner one, so there are n = points -
    # edges/spacing/2 hexagons; their spacing is then quadratic.
    quarter = 0.25 * edges
    root = sqrt(quarter**2 + 2.0 * area * points / sqrt(3.0))
    return (quarter + root) / points


def rim_spacing(points: int, hole: float = 0.0) -> float:
    """Return the distance of neighbours along the rim [R]."""
    return 2.0 * pi / rim_points(points, hole)


def circle_faults(points: int, hole: float, core: float) -> list[tuple[str, str]]:
    """Return (key, message) for a hole or a core radius [R] that `points` points cannot
    resolve."""
    inner = 0.99  # if `hole` is too large, or not a number
    if hole < inner:
        inner = hole
    row = rim_spacing(points, inner)
    least = MIN_EDGE * row / (2.0 * np.pi)
    body = f"{points} points"
    of_hole = _radius_fault(
        radius=hole, low=least, high=1.0 - MIN_ROWS * row, body=body, rows=MIN_ROWS
    )
    with_hole = body
    if hole:
        with_hole = f"{body} and a hole of {hole:g} R"
    of_core = _radius_fault(
        radius=core,
        low=max(least, hole + row),
        high=1.0 - row,
        body=with_hole,
        rows=1,
    )
    faults = [("hole", of_hole), ("core_radius", of_core)]
    return [(key, fault) for key, fault in faults if fault]


def _radius_fault(radius: float, low: float, high: float, body: str, rows: int) -> str:
    """Return why `body` cannot have an edge of this radius [R] with `rows` springs
    between edge and rim, or ""."""
    if not radius or low <= radius <= high:
        return ""
    allowed = "0"
    if low <= high:
        allowed += f" or from {low:.3g} to {high:.3g}"
    return (
        f"must be {allowed} with {body}, not {radius:g}, because there must be at least"
        f" {MIN_EDGE} springs round its edge and {rows} from there to the rim: change"
        " the radius or increase lattice.points"
    )


def _ring(rng: np.random.Generator, count: int) -> Array:
    """Return evenly spaced points (count, 2) on the unit circle, from a random one."""
    return _unit_circle((np.arange(count) + rng.random()) / count)


def _unit_circle(turns: Array) -> Array:
    """Return (cos, sin) of 2 pi `turns`, 0 <= turns < 1, by Taylor series."""
    # Sums and products round alike on every machine, whereas the last bit of NumPy's
    # cos and sin depends on the processor.
    angle = np.pi * (2.0 * turns - 1.0)
    square = angle * angle
    cos = np.ones_like(angle)
    sin_over_angle = np.ones_like(angle)
    for k in range(32, 0, -2):
        cos = 1.0 - square / ((k - 1) * k) * cos
        sin_over_angle = 1.0 - square / (k * (k + 1)) * sin_over_angle
    xy = -np.stack([cos, angle * sin_over_angle], axis=1)
    return xy / norms(xy.T)[:, None]


def hexagonal_spacing(points: int) -> float:
    """Return the distance of neighbours [R] in a hexagonal lattice with `points` points
    in the unit circle."""
    return sqrt(2.0 * pi / (sqrt(3.0) * points))


def least_distance(points: int, min_spacing: float) -> float:
    """Return the smallest allowed distance [R]. Raises InputError if random points
    cannot keep it."""
    if not 0.0 <= min_spacing <= MAX_SPACING:
        raise InputError(
            f"lattice.min_spacing must be between 0 and {MAX_SPACING}, not"
            f" {min_spacing}"
        )
    return min_spacing * hexagonal_spacing(points)


def scatter(
    rng: np.random.Generator,
    count: int,
    low: Array,
    high: Array,
    depth: Depth,
    spacing: float,
    fixed: Array,
) -> Array:
    """Return uniform random points (count, 2) [R] at distances of at least `spacing`
    from one another and from `fixed`.

    The region is where `depth` is positive inside the box `low`..`high` (2,). Raises
    SimulationError if it has no room for `count` points.
    """
    if spacing == 0.0 or count == 0:
        points = np.empty((0, 2))
        while len(points) < count:
            darts = low + (high - low) * rng.random((count + 16, 2))
            points = np.concatenate([points, darts[depth(darts) >= 0.0]])
        return points[:count]
    for _ in range(_MAX_ATTEMPTS):
        points = _adsorb(rng, count, low, high, depth, spacing, fixed)
        if len(points) == count:
            return points
    raise SimulationError(
        f"no room for {count} points at a mutual distance of {spacing:.3g}: lower"
        " min_spacing"
    )


def _adsorb(
    rng: np.random.Generator,
    count: int,
    low: Array,
    high: Array,
    depth: Depth,
    spacing: float,
    fixed: Array,
) -> Array:
    """Try once to place the points of `scatter`; return fewer points if the region
    jams."""
    # Darts are thrown into square cells. As the region fills up, cells covered by one
    # point are removed and the others quartered (Ebeida et al., ACM Trans. Graph. 30,
    # 49, 2011), so darts stay uniform in the free area but rarely miss.
    side = sqrt(np.prod(high - low) / (4 * count))
    nx, ny = np.maximum(np.ceil((high - low) / side), 1).astype(int)
    cells = low + side * _grid(np.arange(nx), np.arange(ny))  # lower left corners
    points = fixed
    total = len(fixed) + count
    while len(points) < total and len(cells):
        missing = total - len(points)
        attempts = min(4 * count, 16 * missing + 16)
        corners = cells[rng.integers(len(cells), size=attempts)]
        darts = corners + side * rng.random((attempts, 2))
        darts = darts[depth(darts) >= 0.0]
        darts = darts[_are_clear(darts, points, spacing)]
        darts = _accepted(darts, spacing)
        points = np.concatenate([points, darts[:missing]])
        if len(darts) < _MIN_HIT_RATE * attempts:
            cells = _free_cells(cells, side, points, depth, spacing)
            side /= 2
            quarters = side * _grid(np.arange(2), np.arange(2))
            cells = (cells[:, None, :] + quarters).reshape(-1, 2)
    return points[len(fixed) :]


def _free_cells(
    cells: Array, side: float, points: Array, depth: Depth, spacing: float
) -> Array:
    """Keep only cells that may contain a place in the region at least `spacing` from
    all points."""
    half_diagonal = side * np.sqrt(0.5)
    cells = cells[depth(cells + side / 2) >= -half_diagonal]
    least = max(spacing - half_diagonal, 0.0)
    return cells[_are_clear(cells + side / 2, points, least)]


def _are_clear(places: Array, points: Array, distance: float) -> NDArray[np.bool_]:
    """Return whether each of the `places` (k, 2) keeps `distance` from all `points`."""
    from scipy.spatial import cKDTree

    nearest, _ = cKDTree(points).query(places, distance_upper_bound=distance)
    return nearest >= distance


def _accepted(darts: Array, spacing: float) -> Array:
    """Remove darts that are closer than `spacing` to an earlier one that stays."""
    from scipy.spatial import cKDTree

    pairs = cKDTree(darts).query_pairs(spacing, output_type="ndarray")
    pairs = np.sort(pairs, axis=1)
    rejected = np.zeros(len(darts), bool)
    while len(pairs):
        earlier, later = pairs.T
        # a dart that has no earlier one in its reach stays
        stays = ~np.isin(earlier, later)
        rejected[later[stays]] = True
        is_open = ~rejected[pairs].any(axis=1)
        pairs = pairs[is_open]
    return darts[~rejected]


def rectangle_points(
    rng: np.random.Generator,
    points: int,
    low: Array,
    high: Array,
    row: float,
    spacing: float,
) -> Array:
    """Return points (points, 2) [R] in the box `low`..`high` (2,), at least `spacing`
    apart.

    Along the four sides they are evenly spaced by about `row`; if `row` is infinite,
    there are none. The sides must leave some of the points for the inside.
    """
    frame = np.empty((0, 2))
    clear = 0.0
    if isfinite(row):
        frame = _frame(low, high, row)
        clear = spacing * sqrt(0.75)
    low = low + clear
    high = high - clear

    def depth(p: Array) -> Array:
        return np.minimum(p - low, high - p).min(axis=1)

    rest = points - len(frame)
    inside = scatter(rng, rest, low, high, depth, spacing, frame)
    return np.concatenate([frame, inside])


def _frame(low: Array, high: Array, row: float) -> Array:
    """Return points (k, 2) along the sides of a box, at distances of about `row` [R]:
    bottom, top, left, right."""
    springs_x, springs_y = np.maximum(np.round((high - low) / row), 1).astype(int)
    left, bottom = low
    right, top = high
    x = np.linspace(left, right, springs_x + 1)
    y = np.linspace(bottom, top, springs_y + 1)
    bottom_and_top = _grid(x, [bottom, top])
    left_and_right = _grid(y[1:-1], [left, right])[:, ::-1]  # pairs (y, x) turned round
    return np.concatenate([bottom_and_top, left_and_right])


def _grid(x: ArrayLike, y: ArrayLike) -> Array:
    """Return the points (k, 2) at all `x` and `y`, row by row."""
    return np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
