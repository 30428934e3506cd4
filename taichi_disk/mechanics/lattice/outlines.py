"""A body by its outline: closed paths of a table or a drawing, filled with random
points as the disk is."""

from __future__ import annotations

import math
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import svgelements
from scipy.spatial import cKDTree

from taichi_disk.base.errors import InputError
from taichi_disk.base.text_files import read_text
from taichi_disk.mechanics.lattice.custom import check_body, numbers
from taichi_disk.mechanics.lattice.files import reading
from taichi_disk.mechanics.lattice.random_points import (
    MAX_POINTS,
    MIN_EDGE,
    MIN_ROWS,
    check_counts,
    least_distance,
    scatter,
)
from taichi_disk.mechanics.lattice.tables import read_table
from taichi_disk.mechanics.lattice.triangles import (
    Array,
    Long,
    cross,
    delaunay,
    double_area,
    norms,
    shown_point,
)

# Halves of the smallest widths, in springs: of a part of the body, less what random
# points vary, and of a hole or a notch.
_HALF_WIDTHS = (-0.45 * MIN_ROWS, MIN_EDGE / (2.0 * math.pi))
# A tip or the ground of a notch may lie this far, in half widths, from where they are
# wider. Those of 29 degrees do.
_MAX_TIP = 3.0
_CORNER = 0.5  # an outline that turns by more has a corner [rad]
_ROUGHNESS = 0.25  # an outline has no features smaller than this, in springs
_CURVE = np.linspace(0.0, 1.0, 33)  # places along a curve of a drawing


def read_outline(path: Path) -> tuple[list[Array], float]:
    """Return the paths (k, 2) of a drawing (.svg), or the one of a table, in units of
    the file, and -1.0 if its y points downwards, else 1.0."""
    if path.suffix.lower() != ".svg":
        return [read_table(read_text(path))[0]], 1.0
    drawing: Any = svgelements.SVG.parse(path)
    to_user_units = ~svgelements.Matrix(drawing.viewbox_transform)
    paths = []
    for shape in drawing.elements(lambda one: isinstance(one, svgelements.Shape)):
        if shape.values.get("visibility") == "hidden":
            continue
        for part in abs(svgelements.Path(shape) * to_user_units).as_subpaths():
            sides = [side.npoint(_CURVE) for side in part][1:]
            if sides:
                paths.append(np.concatenate(sides))
    if not paths:
        raise InputError("there are no paths; words and images must be made paths")
    return paths, -1.0


def filled(
    outline: Any, points: int, seed: int, min_spacing: float, up: float = 1.0
) -> tuple[Array, Long, str]:
    """Return the points (points, 2) [R] and triangles (t, 3) of `Lattice.outline`, and
    a note. `up`: -1.0 if y points downwards."""
    if isinstance(outline, (str, Path)):
        path = Path(outline)
        with reading(path, "outline"):
            paths, up = read_outline(path)
            return filled(paths, points, seed, min_spacing, up)
    if np.ndim(outline[0]) == 1:
        outline = [outline]
    paths = [numbers(path, "outline") for path in outline]
    check_counts(points, seed)
    spacing = least_distance(points, min_spacing)
    rng = np.random.default_rng(seed)
    body = _polygon(paths)
    _check_widths(body, points)
    unit = math.sqrt(body.area / math.pi)
    middle = np.array(body.centroid.coords)
    body = shapely.transform(body, lambda x: (x - middle) * [1.0, up] / unit)
    row = _row(body, points)
    rings = [_along(ring, row, rng) for ring in (body.exterior, *body.interiors)]
    fixed = np.concatenate(rings)
    check_body(fixed, 1.0)
    shape = shapely.Polygon(rings[0], rings[1:])
    shapely.prepare(shape)
    # so dense that distances from it are exact to some 1e-3 springs
    edge = cKDTree(shapely.get_coordinates(shape.segmentize(row / 16.0)))
    # If points were closer, some sides of the outline would not become springs.
    clear = max(spacing * math.sqrt(0.75), 0.55 * row)

    def depth(p: Array) -> Array:
        distance, _ = edge.query(p, distance_upper_bound=4.0 * row)  # inf beyond
        return np.where(shapely.contains_xy(shape, p), distance, -distance) - clear

    box = fixed.min(axis=0), fixed.max(axis=0)
    rest = max(points - len(fixed), 0)
    x = np.concatenate([fixed, scatter(rng, rest, *box, depth, spacing, fixed)])
    triangles = delaunay(x)
    triangles = triangles[shapely.contains_xy(shape, x[triangles].mean(axis=1))]
    uncovered = shape.area - 0.5 * double_area(x[triangles]).sum()
    if len(x) > points or abs(uncovered) > 1e-9:
        raise InputError(
            "the springs do not follow the outline: round off its sharp notches, or"
            " increase lattice.points"
        )
    return x, triangles, f"1 R = {unit:.4g} units of the outline"


def _polygon(paths: list[Array]) -> Any:
    """Return the shapely polygon of closed paths: the largest, and holes. Raises
    InputError if they are not the edge of one body."""
    for path in paths:
        if len(path) < 3:
            raise InputError("a path has fewer than 3 points")
        first, last = path[[0, -1]]
        sides = norms(np.diff(path.T))
        if norms(last - first) > max(3.0 * sides.max(), 0.02 * sides.sum()):
            raise InputError(
                f"a path is open from {shown_point(last)} to {shown_point(first)}:"
                " close it"
            )
    paths.sort(key=lambda path: -shapely.Polygon(path).area)
    body = shapely.Polygon(paths[0], paths[1:])
    if not body.is_valid:
        fault = shapely.is_valid_reason(body)
        raise InputError(f"the outline is not the edge of one body: {fault}")
    return body.normalize()


def _row(body: Any, points: int) -> float:
    """Return the distance of points along the outline that equals that of the inner
    ones."""
    # as for `rim_points`
    quarter = body.length / 4.0
    root = math.sqrt(quarter**2 + 2.0 * body.area * points / math.sqrt(3.0))
    return (quarter + root) / points


def _along(ring: Any, row: float, rng: np.random.Generator) -> Array:
    """Return the corners of a closed path, and points between them at distances of
    about `row`."""
    smooth = ring.simplify(_ROUGHNESS * row)
    corners = shapely.get_coordinates(smooth)[:-1]
    before = corners - np.roll(corners, 1, axis=0)
    after = np.roll(before, -1, axis=0)
    turn = np.arctan2(cross(before, after), (before * after).sum(axis=1))
    marks = shapely.points(corners[np.abs(turn) > _CORNER])
    places = np.sort(shapely.line_locate_point(ring, marks))
    if not len(places):
        places = ring.length * rng.random(1)
    springs = smooth.length / (ring.length * row)  # what is rough counts as straight
    found = []
    for start, end in pairwise([*places, places[0] + ring.length]):
        count = max(1, round((end - start) * springs))
        found.append(np.linspace(start, end, count, endpoint=False))
    along = np.concatenate(found) % ring.length
    return shapely.get_coordinates(shapely.line_interpolate_point(ring, along))


def _check_widths(body: Any, points: int) -> None:
    """Raise InputError where springs cannot resolve a part of the body or a notch."""
    place = _thin_place(body, points)
    if place is None:
        return
    enough = points
    while enough < MAX_POINTS and _thin_place(body, enough) is not None:
        enough = math.ceil(1.2 * enough)
    remedy = f"take some {enough:,} points"
    if enough >= MAX_POINTS:
        remedy = "round it off"
    raise InputError(
        f"at {shown_point(place)} the body, a hole or a notch is too thin for springs"
        f" of {_row(body, points):.3g}: {remedy}"
    )


def _thin_place(body: Any, points: int) -> Array | None:
    row = _row(body, points)
    body = body.simplify(0.1 * row)  # a rough one takes seconds
    places = shapely.get_coordinates(body.segmentize(row))
    for half_width in _HALF_WIDTHS:
        half = half_width * row
        swollen = body.buffer(half)
        resolved = swollen.buffer(-half).boundary
        lost = shapely.distance(resolved, shapely.points(places))
        rings = shapely.get_num_geometries([body.boundary, swollen.boundary])
        if not lost.max() <= _MAX_TIP * abs(half) or rings[0] != rings[1]:
            return places[lost.argmax()]
    return None
