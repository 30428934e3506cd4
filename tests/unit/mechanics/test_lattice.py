"""The disk's lattice: numbers, distances and triangles, the same to the last bit."""

import hashlib

import numpy as np
import pytest
from bodies import assert_tiles, hexagon, holes_of
from hypothesis import example, given, settings, strategies as st
from scipy.spatial.distance import pdist

from taichi_disk.base.errors import InputError, SimulationError
from taichi_disk.experiments.config.sections import LatticeSection
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.lattice.lattice import double_area, polygon_area, triangulate
from taichi_disk.mechanics.lattice.network import bending_compliance, network_stiffness
from taichi_disk.mechanics.lattice.random_points import (
    MAX_POINTS,
    MIN_POINTS,
    hexagonal_spacing,
    rim_points,
)


@settings(max_examples=15, deadline=None)
@given(
    st.integers(3, 300),
    st.integers(0, 2**32),
    st.booleans(),
    st.floats(0, 0.75, allow_subnormal=False),
)
@example(3, 5, True, 0.75)
@example(4, 5, True, 0.75)
@example(1099, 5, True, 0.7)
@example(1099, 5, False, 0.75)
@example(1099, 5, False, 0.0)
def test_points_keep_their_distance_in_the_circle_and_triangles_tile_their_outline(
    points, seed, rim, min_spacing
):
    disk = Lattice.disk(points, seed, rim, min_spacing)
    assert disk.positions.shape == (points, 2)
    assert disk.disk_points == points
    assert disk.masses == pytest.approx(np.full(points, 1 / points))
    assert np.hypot(*disk.positions.T).max() <= 1 + 1e-15
    # Every pair of points, not just neighbours, keeps the distance.
    distance = min_spacing * hexagonal_spacing(points)
    assert pdist(disk.positions).min() >= distance * (1 - 1e-12)
    assert_tiles(disk.positions, disk.triangles, disk.disk_surface)
    ends = np.roll(disk.triangles, -1, axis=1)
    sides = np.stack([disk.triangles, ends], axis=2).reshape(-1, 2)
    # both sorted lexicographically
    assert (np.unique(np.sort(sides, axis=1), axis=0) == disk.bonds).all()
    assert len(np.unique(disk.bonds)) == points
    i, j = disk.bonds.T
    length = np.linalg.norm(disk.positions[i] - disk.positions[j], axis=1)
    assert disk.rest_lengths == pytest.approx(length)
    for indices in (disk.bonds, disk.triangles, disk.disk_surface):
        assert indices.dtype == np.int32


@pytest.mark.parametrize("points", [7, 50, 1099])
def test_rim_points_are_evenly_spaced_on_the_unit_circle_and_are_the_surface(points):
    disk = Lattice.disk(points, 3)
    rim = disk.positions[disk.disk_surface]
    assert len(rim) == rim_points(points)
    assert np.hypot(*rim.T) == pytest.approx(np.ones(len(rim)), abs=4e-16)
    turn = np.diff(np.unwrap(np.arctan2(rim[:, 1], rim[:, 0])))
    assert turn == pytest.approx(np.full(len(rim) - 1, 2 * np.pi / len(rim)), abs=1e-13)


@settings(max_examples=15, deadline=None)
@given(
    st.integers(150, 600),
    st.integers(0, 2**32),
    st.booleans(),
    st.floats(0, 0.75),
    st.floats(0.25, 0.55),
)
@example(1099, 0, True, 0.7, 0.9)
@example(600, 0, True, 0.75, 0.85)
@example(1099, 0, True, 0.7, 0.06)
def test_a_hole_is_round_and_empty_and_the_points_are_as_many_as_asked(
    points, seed, rim, min_spacing, hole
):
    disk = Lattice.disk(points, seed, rim, min_spacing, hole)
    r = np.hypot(*disk.positions.T)
    assert disk.positions.shape == (points, 2)
    assert np.ptp(disk.masses) == 0.0
    assert disk.masses.sum() == pytest.approx(1.0, abs=1e-14)
    assert r.min() == pytest.approx(hole, abs=1e-15)
    edge = np.flatnonzero(r < hole * (1 + 1e-9))
    turn = np.sort(np.arctan2(*disk.positions[edge].T))
    assert np.ptp(np.diff(turn)) < 1e-12
    distance = min_spacing * hexagonal_spacing(points) * np.sqrt(1 - hole**2)
    assert pdist(disk.positions).min() >= distance * (1 - 1e-12)
    polygon = 0.5 * len(edge) * hole**2 * np.sin(2 * np.pi / len(edge))
    assert holes_of(disk) == [pytest.approx(polygon)]
    assert not disk.whole
    area = 0.5 * double_area(disk.positions[disk.triangles])
    outer = disk.positions[disk.disk_surface]
    assert area.min() > 0
    assert area.sum() == pytest.approx(polygon_area(outer) - polygon)
    if rim and points > 1000:  # the density is the same everywhere
        assert len(disk.disk_surface) / len(edge) == pytest.approx(1 / hole, rel=0.1)


@pytest.mark.parametrize(("hole", "core"), [(0.4, 0.0), (0.0, 0.5)])
@pytest.mark.parametrize("min_spacing", [0.7, 0.0])
def test_the_edges_of_hole_and_core_are_rings_of_springs_without_flat_triangles(
    hole, core, min_spacing
):
    # A random point too close to an edge would make a sliver, or break the outline.
    spacing = min_spacing * hexagonal_spacing(300) * np.sqrt(1 - hole**2)
    for seed in range(3):
        disk = Lattice.disk(300, seed, True, min_spacing, hole, core)
        off = np.abs(np.hypot(*disk.positions.T) - (hole or core))
        edge = np.flatnonzero(off < 1e-9)
        half_a_chord = (hole or core) * np.sin(np.pi / len(edge))
        assert np.delete(off, edge).min() >= max(np.sqrt(0.75) * spacing, half_a_chord)
        ring = edge[np.argsort(np.arctan2(*disk.positions[edge].T))]
        chords = np.sort(np.stack([ring, np.roll(ring, -1)], axis=1), axis=1)
        assert {*map(tuple, chords.tolist())} <= {*map(tuple, disk.bonds.tolist())}


def test_a_core_has_the_points_and_springs_within_and_the_mean_on_its_edge():
    place = {"hole": 0.2, "core_radius": 0.5}
    plain = Lattice.disk(1099, 2, **place)
    heavy = Lattice.disk(1099, 2, **place, core_density=3.0)
    stiff = Lattice.disk(1099, 2, **place, core_stiffness=10.0)
    assert plain.stiffness is heavy.stiffness is None
    assert np.ptp(plain.masses) == np.ptp(stiff.masses) == 0.0
    assert (heavy.positions == plain.positions).all()
    assert heavy.masses.sum() == pytest.approx(1.0, abs=1e-14)
    r = np.hypot(*heavy.positions.T)
    is_on_edge = np.abs(r - 0.5) < 1e-9
    outer = heavy.masses[(r > 0.5) & ~is_on_edge]
    edge = heavy.masses[is_on_edge]
    inner = heavy.masses[(r < 0.5) & ~is_on_edge]
    assert np.ptp(outer) == np.ptp(edge) == np.ptp(inner) == 0.0
    ratios = [edge[0] / outer[0], inner[0] / outer[0]]
    assert ratios == pytest.approx([2.0, 3.0])
    middle = np.hypot(*stiff.positions[stiff.bonds].mean(axis=1).T)
    on_edge = is_on_edge[stiff.bonds].all(axis=1)
    assert set(stiff.stiffness[on_edge]) == {5.5}
    assert on_edge.sum() == len(edge)
    assert set(stiff.stiffness[~on_edge & (middle < 0.5)]) == {10.0}
    assert set(stiff.stiffness[middle > 0.5]) == {1.0}
    # The core has the mass fraction of its area, 3 (a^2 - h^2) to 1 - a^2, up to the
    # whole number of rim points.
    fraction = inner.sum() + 0.75 * edge.sum()
    assert fraction == pytest.approx(3 * 0.21 / (3 * 0.21 + 0.75), rel=0.04)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"hole": 0.95}, "hole: must be 0 or from .* to 0.9"),
        ({"hole": -0.1}, "hole: must be 0 or from"),
        ({"hole": 0.01}, "hole: must be 0 or from 0.0561 to"),
        ({"hole": np.nan}, "hole: must be 0 or from .*, not nan"),
        (
            {"hole": 0.5, "core_radius": 0.4},
            "core_radius: must be 0 or from 0.552 .* and a hole of 0.5 R, not 0.4",
        ),
        ({"core_radius": 0.99}, "core_radius: must be 0 or from .* to 0.94"),
        ({"core_radius": 0.5, "core_density": 0.0}, "masses"),
        ({"core_radius": 0.5, "core_stiffness": -1.0}, "stiffness"),
    ],
)
def test_holes_and_cores_that_cannot_be_are_refused(arguments, message):
    with pytest.raises(InputError, match=message):
        Lattice.disk(1099, 0, **arguments)


@pytest.mark.parametrize("points", [30, 61, 150, 300, 1099, 5000])
def test_the_rim_s_spacing_is_that_of_a_hexagonal_lattice_inside(points):
    on_rim = rim_points(points)

    def excess(rim):
        return 2 * np.pi / rim - hexagonal_spacing(points - rim / 2)

    assert excess(on_rim - 0.5) > 0.0 > excess(on_rim + 0.5)


def test_the_disk_has_no_slivers():
    disk = Lattice.disk(1099, 0)
    corner = disk.positions[disk.triangles]
    side = np.roll(corner, -1, axis=1) - corner
    side /= np.linalg.norm(side, axis=2, keepdims=True)
    cosine = -np.sum(side * np.roll(side, 1, axis=1), axis=2)
    # smallest distance l, largest circumradius R: the smallest angle has sin >= l/(2 R)
    assert np.degrees(np.arccos(cosine.max())) > 20


def test_the_lattice_of_a_seed_is_the_same_everywhere():
    disk = Lattice.disk(300, 0)
    data = disk.positions.tobytes() + disk.bonds.tobytes() + disk.rest_lengths.tobytes()
    assert hashlib.sha256(data).hexdigest()[:16] == "c5ae7cb2cdba8362"
    assert disk.positions.tobytes() != Lattice.disk(300, 1).positions.tobytes()


def test_points_without_a_minimum_distance_are_uniform_in_the_circle():
    x, y = Lattice.disk(20_000, 0, rim=False, min_spacing=0.0).positions.T
    # r^2 and the angle are uniform: means 1/2 and pi, with standard errors
    # range/sqrt(12 n); 4 of them.
    for value, width in ((x**2 + y**2, 1.0), (np.arctan2(y, x) + np.pi, 2 * np.pi)):
        error = width / np.sqrt(12 * len(x))
        assert value.mean() == pytest.approx(width / 2, abs=4 * error)
        assert value.std() == pytest.approx(width / np.sqrt(12), rel=0.02)


def test_scattered_points_are_as_dense_everywhere():
    # 0.75 is close to jamming, so only uncovered cells are searched in the end.
    n = 8_000
    disk = Lattice.disk(n, 0, min_spacing=0.75)
    inner = disk.positions[np.abs(disk.positions).max(axis=1) < 0.7]
    expected = n / np.pi * 1.4**2 / 16
    # Points at a distance fluctuate by less than sqrt(n) = 18 (Poisson) in a bin.
    assert np.abs(np.histogram2d(*inner.T, bins=4)[0] - expected).max() < 30


def test_numbering_keeps_neighbours_close_in_memory():
    # A level of a breadth-first search through a disk has about 2/d = 1.05 sqrt(N)
    # points; a bond spans two levels.
    i, j = Lattice.disk(5000, 0).bonds.T
    assert np.abs(i - j).max() < 2.5 * np.sqrt(5000)


@pytest.mark.parametrize("angle", np.arange(4) * 1.65)
def test_points_in_a_row_make_no_flat_triangles(angle):
    # A grid with displaced inner points, whose sides are straight but for rounding.
    grid = np.stack(np.meshgrid(np.arange(30.0), np.arange(9.0)), axis=-1)
    grid[1:-1, 1:-1] += 0.4 * np.random.default_rng(0).random((7, 28, 2)) - 0.2
    c = np.cos(angle)
    s = np.sin(angle)
    mesh = triangulate(grid.reshape(-1, 2) @ np.array([[c, s], [-s, c]]))
    assert len(mesh.disk_surface) == 2 * (29 + 8)
    area = 0.5 * double_area(mesh.positions[mesh.triangles])
    assert area.min() > 0.1
    assert area.sum() == pytest.approx(29 * 8, rel=1e-12)
    with pytest.raises(SimulationError, match="degenerate"):
        triangulate(np.array([[0.0, 0.0], [1.0, 0.0], [0.5, 1.0], [0.5, 1.0]]))


def test_arguments_out_of_range_are_named_and_are_those_of_a_scene():
    spacing = r"lattice\.min_spacing must be between"
    number = "lattice.points: must be a whole number from 3 to 2,000,000, not {!r}"
    seed = "lattice.seed: must be a whole .*, not {!r}"
    for name, values, message in (
        ("min_spacing", (0.76, -0.1, np.nan), spacing),
        ("points", (2, 2_000_001, "60", 60.5, np.nan), number),
        ("seed", (-1, 1.5, "1", None), seed),
    ):
        for value in values:
            with pytest.raises(InputError, match=message.format(value)):
                Lattice.disk(**{"points": 50, name: value})
    points = LatticeSection.schema()["points"]
    assert (points.low, points.high) == (MIN_POINTS, MAX_POINTS)


@pytest.mark.parametrize("rings", [2, 4])
def test_bending_compliance_is_that_of_the_dense_matrix(rings):
    # A hexagon has pairs of vibrations with the same frequency, and the solver may
    # return any mixture of them.
    disk = hexagon(rings)
    stiffness = network_stiffness(disk.positions, disk.bonds, 2.0)
    values, modes = np.linalg.eigh(stiffness.toarray())
    assert values[3] == pytest.approx(values[4], rel=1e-9)
    weights = 1.0 / values[3:8] - 1.0 / values[8]
    soft = (modes[:, 3:8] ** 2 @ weights).reshape(-1, 2).sum(axis=1)
    assert bending_compliance(stiffness) == pytest.approx(soft.max(), rel=1e-5)
