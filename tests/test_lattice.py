"""The disk's lattice: exact counts, distances, a sound triangulation, reproducible to the last bit."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import pdist

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice import disk_lattice, rim_points
from taichi_disk.scatter import hexagonal_spacing, scatter
from taichi_disk.triangulation import polygon_area, triangulate

VARIANTS = [(True, 0.7), (True, 0.0), (True, 0.75), (False, 0.0), (False, 0.75)]


def crossings(points, bonds):
    """Pairs of bonds that cut each other, by the signs of the triangles their ends span."""

    def side(a, b, c):
        return np.sign((b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0])

    p, q = points[bonds[:, 0]], points[bonds[:, 1]]
    a, b, c, d = p[:, None], q[:, None], p[None], q[None]
    cut = (side(a, b, c) * side(a, b, d) < 0) & (side(c, d, a) * side(c, d, b) < 0)
    shared = (bonds[:, None, :, None] == bonds[None, :, None, :]).any(axis=(2, 3))
    return int(np.sum(cut & ~shared)) // 2


def components(lattice):
    n = len(lattice.positions)
    i, j = lattice.bonds.T
    return connected_components(coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n)), directed=False)[0]


@pytest.mark.parametrize(("rim", "min_spacing"), VARIANTS)
@pytest.mark.parametrize("points", [3, 4, 5, 7, 50, 1099])
def test_lattice_has_the_exact_number_of_points_in_one_piece(points, rim, min_spacing):
    disk = disk_lattice(points, 5, rim, min_spacing)
    assert disk.positions.shape == (points, 2)
    assert disk.disk_points == points
    assert disk.masses == pytest.approx(np.full(points, 1 / points))
    assert np.hypot(*disk.positions.T).max() <= 1 + 1e-15
    assert components(disk) == 1
    assert len(disk.wall_surface) == len(disk.wall_boundary) == 0


@settings(max_examples=40, deadline=None)
@given(
    points=st.integers(3, 300),
    seed=st.integers(0, 2**32),
    rim=st.booleans(),
    min_spacing=st.floats(0, 0.75, allow_subnormal=False),
)
def test_triangulation_is_planar_and_fills_its_outline(points, seed, rim, min_spacing):
    disk = disk_lattice(points, seed, rim, min_spacing)
    i, j = disk.bonds.T
    # Euler: V - E + F = 1 and 3 F = 2 E - h, so that a triangulated polygon of h corners has E = 3 V - 3 - h.
    assert len(disk.bonds) == 3 * points - 3 - len(disk.disk_surface)
    assert (i < j).all()
    assert (np.diff(i.astype(np.int64) * points + j) > 0).all()
    # Every pair of points, not just neighbours, keeps the distance.
    assert pdist(disk.positions).min() >= min_spacing * hexagonal_spacing(points) * (1 - 1e-12)
    assert polygon_area(disk.positions[disk.disk_surface]) > 0
    assert disk.rest_lengths == pytest.approx(np.linalg.norm(disk.positions[i] - disk.positions[j], axis=1))


@pytest.mark.parametrize(("rim", "min_spacing"), VARIANTS)
def test_no_two_bonds_cross(rim, min_spacing):
    disk = disk_lattice(200, 1, rim, min_spacing)
    assert crossings(disk.positions, disk.bonds) == 0


def test_crossing_bonds_would_be_seen():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    assert crossings(square, np.array([[0, 2], [1, 3]])) == 1


@pytest.mark.parametrize(("rim", "min_spacing"), VARIANTS)
def test_triangles_tile_the_outline_and_their_circles_are_empty(rim, min_spacing):
    mesh = triangulate(disk_lattice(300, 2, rim, min_spacing).positions)
    a, b, c = np.moveaxis(mesh.positions[mesh.triangles], 1, 0)
    ab, ac = b - a, c - a
    area = 0.5 * (ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0])
    assert area.min() > 0
    assert area.sum() == pytest.approx(polygon_area(mesh.positions[mesh.outline]), rel=1e-12)
    # Circumcentre: |p - a|^2 = |p - b|^2 = |p - c|^2. Delaunay: no fourth point within.
    right = np.stack([(b**2 - a**2).sum(axis=1), (c**2 - a**2).sum(axis=1)], axis=1) / 2
    centre = np.linalg.solve(np.stack([ab, ac], axis=1), right[..., None])[..., 0]
    radius = np.linalg.norm(centre - a, axis=1)
    distance = np.linalg.norm(mesh.positions[None] - centre[:, None], axis=2)
    assert (distance.min(axis=1) >= radius * (1 - 1e-9)).all()


@pytest.mark.parametrize("points", [7, 50, 1099])
def test_rim_points_are_evenly_spaced_on_the_unit_circle_and_are_the_surface(points):
    disk = disk_lattice(points, 3)
    rim = disk.positions[disk.disk_surface]
    assert len(rim) == rim_points(points)
    assert np.hypot(*rim.T) == pytest.approx(np.ones(len(rim)), abs=4e-16)
    turn = np.diff(np.unwrap(np.arctan2(rim[:, 1], rim[:, 0])))
    assert turn == pytest.approx(np.full(len(rim) - 1, 2 * np.pi / len(rim)), abs=1e-13)


def test_rim_makes_no_slivers():
    mesh = triangulate(disk_lattice(1099, 0).positions)
    corner = mesh.positions[mesh.triangles]
    side = np.roll(corner, -1, axis=1) - corner
    length = np.linalg.norm(side, axis=2)
    cosine = -np.sum(side * np.roll(side, 1, axis=1), axis=2) / (length * np.roll(length, 1, axis=1))
    # With a least distance l and a greatest circumradius R, the smallest angle has sin >= l/(2 R).
    assert np.degrees(np.arccos(cosine.max())) > 20


def test_rim_has_the_spacing_of_the_points_inside():
    # A triangular lattice has sqrt(3)/2 d^2 for each point; a rim point owns half of it.
    for points in (50, 1099, 100_000):
        rim = rim_points(points)
        spacing = 2 * np.pi / rim
        assert np.sqrt(3) / 2 * spacing**2 * (points - rim / 2) == pytest.approx(np.pi, rel=2 / rim)


def test_same_seed_gives_the_same_bytes_and_another_seed_others():
    one, two, other = (disk_lattice(500, seed) for seed in (4, 4, 5))
    for name in ("positions", "bonds", "rest_lengths", "disk_surface"):
        assert getattr(one, name).tobytes() == getattr(two, name).tobytes()
    assert one.positions.tobytes() != other.positions.tobytes()


def test_the_lattice_of_a_seed_is_the_same_everywhere():
    disk = disk_lattice(300, 0)
    data = disk.positions.tobytes() + disk.bonds.tobytes() + disk.rest_lengths.tobytes()
    assert hashlib.sha256(data).hexdigest()[:16] == "c5ae7cb2cdba8362"


def test_points_without_a_minimum_distance_are_uniform_in_the_circle():
    disk = disk_lattice(20_000, 0, rim=False, min_spacing=0.0)
    x, y = disk.positions.T
    # r^2 and the angle are uniform: means 1/2 and pi, with standard errors range/sqrt(12 n); 4 of them.
    for value, width in ((x**2 + y**2, 1.0), (np.arctan2(y, x) + np.pi, 2 * np.pi)):
        assert value.mean() == pytest.approx(width / 2, abs=4 * width / np.sqrt(12 * len(x)))
        assert value.std() == pytest.approx(width / np.sqrt(12), rel=0.02)


def test_scattered_points_are_as_dense_everywhere():
    # 0.75 is close to jamming, where the search goes over to the uncovered cells.
    points = 20_000
    spacing = 0.75 * hexagonal_spacing(points)
    box = np.array([np.sqrt(np.pi)] * 2)

    def depth(p):
        return np.minimum(p, box - p).min(axis=1)

    rng = np.random.default_rng(0)
    p = scatter(rng, points, np.zeros(2), box, depth, spacing, np.empty((0, 2)))
    count = np.histogram2d(*p.T, bins=4)[0]
    # Points that keep apart fluctuate less than Poisson's sqrt(n) = 35 for n = 1250 in a bin.
    assert np.abs(count - points / 16).max() < 60


def test_numbering_keeps_neighbours_close_in_memory():
    # A level of a breadth-first search through a disk has about 2/d = 1.05 sqrt(N) points; a bond spans two.
    disk = disk_lattice(5000, 0)
    assert np.abs(np.diff(disk.bonds, axis=1)).max() < 2.5 * np.sqrt(5000)


@pytest.mark.parametrize("angle", np.arange(12) * 0.55)
def test_points_in_a_row_make_no_flat_triangles(angle):
    # A square grid whose inner points are jittered, turned so that its sides are straight to rounding only.
    grid = np.stack(np.meshgrid(np.arange(30.0), np.arange(9.0)), axis=-1)
    grid[1:-1, 1:-1] += 0.4 * np.random.default_rng(0).random((7, 28, 2)) - 0.2
    c, s = np.cos(angle), np.sin(angle)
    mesh = triangulate(grid.reshape(-1, 2) @ np.array([[c, s], [-s, c]]))
    assert len(mesh.outline) == 2 * (29 + 8)
    p, q, r = np.moveaxis(mesh.positions[mesh.triangles], 1, 0)
    area = 0.5 * ((q - p)[:, 0] * (r - p)[:, 1] - (q - p)[:, 1] * (r - p)[:, 0])
    assert area.min() > 0.1
    assert area.sum() == pytest.approx(29 * 8, rel=1e-12)


def test_points_that_cannot_be_meshed_are_refused():
    with pytest.raises(SimulationError, match="degenerate"):
        triangulate(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [0.5, 1.0]]))


@pytest.mark.parametrize(
    ("points", "min_spacing", "name"),
    [(2, 0.7, "points"), (2_000_001, 0.7, "points"), (50, 0.76, "min_spacing"), (50, -0.1, "min_spacing")],
)
def test_arguments_out_of_range_are_named(points, min_spacing, name):
    with pytest.raises(InputError, match=f"lattice.{name} must be between"):
        disk_lattice(points, 0, True, min_spacing)


def test_nan_min_spacing_is_refused():
    with pytest.raises(InputError):
        disk_lattice(50, 0, True, float("nan"))


def test_a_scene_may_ask_for_as_many_points_as_are_built():
    from taichi_disk.lattice import MAX_POINTS, MIN_POINTS
    from taichi_disk.scene import LatticeSection

    bounds = LatticeSection.model_json_schema()["properties"]["points"]
    assert (bounds["minimum"], bounds["maximum"]) == (MIN_POINTS, MAX_POINTS)
