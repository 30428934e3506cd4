"""A body by its outline: closed paths of a table or a drawing, filled with random
points as the disk is."""

from __future__ import annotations

import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import svgelements
from scipy.spatial import cKDTree

from taichi_disk.base.errors import InputError
from taichi_disk.base.text_files import read_text
from taichi_disk.mechanics.lattice.custom import check_body, point_array
from taichi_disk.mechanics.lattice.files import TABLES
from taichi_disk.mechanics.lattice.random_points import (
    MAX_POINTS,
    MIN_EDGE,
    MIN_ROWS,
    check_counts,
    edge_spacing,
    least_distance,
    scatter,
)
from taichi_disk.mechanics.lattice.tables import read_table
from taichi_disk.mechanics.lattice.triangles import (
    Array,
    Long,
    delaunay,
    double_area,
    norms,
    shown_point,
)

# Halves of the smallest widths, in springs: of a part of the body, less what random
# points vary, and of a hole or a notch.
_HALF_WIDTHS = (-0.45 * MIN_ROWS, MIN_EDGE / (2.0 * math.pi))
# A tip, or the ground of a notch, may lie at most this far, in half widths, from a
# place that is wide enough. A tip of 29 degrees lies so far.
_MAX_TIP = 3.0
_CORNER = 0.5  # an outline that turns by more has a corner [rad]
_ROUGHNESS = 0.25  # an outline has no features smaller than this, in springs
_MAX_GAP = 3.0  # from the last point of a path to its first, in longest sides
_CURVE = np.linspace(0.0, 1.0, 65)  # places along a curve, which may be a whole drop
# few along a straight side: drawings may have 100,000 of them
_PLACES = dict.fromkeys((svgelements.Line, svgelements.Close), _CURVE[::8])
# svgelements draws the content of these where no viewer shows it.
_MISPLACED = ("svg", "symbol", "marker", "mask")
# Viewers apply these to a path; svgelements does not.
_NOT_APPLIED = (
    "clip-path",
    "mask",
    "transform-origin",
    "translate",
    "rotate",
    "scale",
)


def read_outline(path: Path) -> list[Array]:
    """Return the paths (k, 2) of a drawing (.svg), or the one of a table, in units of
    the file, with y upwards."""
    suffix = path.suffix.lower()
    if suffix in TABLES:
        return [read_table(read_text(path))[0]]
    if suffix != ".svg":
        raise InputError("an outline is a drawing (.svg) or a table (.csv): save it so")
    drawing = _drawing(path)
    scale = svgelements.Matrix(drawing.viewbox_transform)
    if not math.isclose(scale.a, scale.d):
        raise InputError("its view box is stretched: leave preserveAspectRatio out")
    paths = []
    for shape in drawing.elements():
        given = shape.values.get
        tag = given("tag")
        if shape is not drawing and tag in _MISPLACED:
            raise InputError(f"a path is inside of <{tag}>: take it out, or delete it")
        for key in _NOT_APPLIED:
            if given(key, "none") != "none":
                raise InputError(
                    f"a path has a {key}: remove it (release a clip), or apply it"
                )
        if (
            not isinstance(shape, svgelements.Shape)
            or not (shape.fill.alpha or shape.stroke.alpha)  # as an artboard
            or given("opacity") == "0"  # as the ground of a traced picture
            or given("visibility") in ("hidden", "collapse")
        ):
            continue
        outline = svgelements.Path(shape)
        # An arc may be long: of 36° at most. Skewed, it would be another.
        outline.approximate_arcs_with_cubics()
        outline = abs(outline * ~scale)
        for part in outline.as_subpaths():
            sides = [
                side.npoint(_PLACES.get(type(side), _CURVE))
                for side in part[1:]  # the first is a move
            ]
            if sides:
                paths.append(np.concatenate(sides) * [1.0, -1.0])
    if not paths:
        raise InputError("no path is visible; words and images must be made paths")
    return paths


def _drawing(path: Path) -> Any:
    # svgelements computes no em and ex, in which icons and formulas have their size.
    # An em is 16 px, as a pc is. Of the size of a drawing only the ratio counts.
    data = re.sub(rb"(?<=\d)e[mx]\b", b"pc", path.read_bytes())
    drawing = svgelements.SVG.parse(io.BytesIO(data), reify=False)
    if not isinstance(drawing, svgelements.SVG):
        raise InputError("it is a part of a drawing: write <svg> … </svg> round it")
    return drawing


def filled(
    paths: list[Array], points: int, seed: int, min_spacing: float
) -> tuple[Array, Long, str]:
    """Return the points (points, 2) [R] and triangles (t, 3) of `Lattice.outline`, and
    a note."""
    check_counts(points, seed)
    spacing = least_distance(points, min_spacing)
    rng = np.random.default_rng(seed)
    outline = _polygon(paths)
    unit = math.sqrt(outline.area / math.pi)
    middle = np.array(outline.centroid.coords)
    body = shapely.transform(outline, lambda x: (x - middle) / unit)
    row = edge_spacing(points, body.length, body.area)
    rings = [_along(ring, row, rng) for ring in (body.exterior, *body.interiors)]
    fixed = np.concatenate(rings)
    check_body(fixed, max_offset=1.0)
    _refuse_thin(outline, points)
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
    rings = []
    for path in paths:
        sides = norms(np.diff(path.T, append=path[:1].T))
        if sides[-1] > _MAX_GAP * sides[:-1].max():
            raise InputError(
                f"a path is open from {shown_point(path[-1])} to"
                f" {shown_point(path[0])}: join it to the next piece, close it, or"
                " remove it"
            )
        # a point that is repeated up to rounding may be a self-intersection
        rings.append(point_array(path[sides >= 1e-5 * sides.max()]))
    edge, *holes = sorted(rings, key=lambda ring: -shapely.Polygon(ring).area)
    body = shapely.Polygon(edge, holes)
    if not body.is_valid:
        fault, _, place = shapely.is_valid_reason(body).rstrip("]").partition("[")
        spot = shown_point(np.array(place.split(), float))
        raise InputError(
            f"the outline is not the edge of one body: {fault.lower()} at {spot}; its"
            " points go round the body once, and other paths are holes in it"
        )
    if not body.boundary.is_simple:
        raise InputError("a hole touches the edge or another hole: leave a gap")
    return body.normalize()


def _refuse_thin(body: Any, points: int) -> None:
    """Raise InputError where springs cannot resolve a part of the body or a notch."""
    place = _thin_place(body, points)
    if place is None:
        return
    enough = points
    while enough < MAX_POINTS and _thin_place(body, enough) is not None:
        enough = math.ceil(1.2 * enough)
    remedy = "round it off"
    if enough < MAX_POINTS:
        remedy += f", or take some {enough:,} points"
    raise InputError(
        f"at {shown_point(place)} the body, a hole or a notch is too thin: {remedy}"
    )


def _thin_place(body: Any, points: int) -> Array | None:
    row = edge_spacing(points, body.length, body.area)
    body = body.simplify(0.1 * row)  # a rough one takes seconds
    places = shapely.get_coordinates(body.segmentize(row))
    for half_width in _HALF_WIDTHS:
        half = half_width * row
        swollen = body.buffer(half)
        resolved = swollen.buffer(-half).boundary
        lost = shapely.distance(resolved, shapely.points(places))
        is_whole = swollen.geom_type == "Polygon"
        if not (is_whole and lost.max() <= _MAX_TIP * abs(half)):
            return places[lost.argmax()]
    return None


def _along(ring: Any, row: float, rng: np.random.Generator) -> Array:
    """Return the corners of a closed path, and points between them at distances of
    about `row`."""
    smooth = ring.simplify(_ROUGHNESS * row)
    corners = shapely.get_coordinates(smooth)[1:]
    z = corners @ [1.0, 1.0j]
    sides = z - np.roll(z, 1)
    turn = np.abs(np.angle(np.roll(sides, -1) / sides))
    marks = shapely.points(corners[turn > _CORNER])
    places = np.sort(shapely.line_locate_point(ring, marks))
    if not len(places):
        places = ring.length * rng.random(1)
    places = np.append(places, places[0] + ring.length)
    springs = smooth.length / (ring.length * row)  # what is rough counts as straight
    counts = np.maximum(np.rint(np.diff(places) * springs), 1.0)
    numbers = np.append(0.0, np.cumsum(counts))
    along = np.interp(np.arange(numbers[-1]), numbers, places) % ring.length
    return shapely.get_coordinates(shapely.line_interpolate_point(ring, along))
