"""The elastic wall's lattice: the disk's material in a rectangle below y = 0, apart from the disk."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components
from scipy.spatial.distance import pdist

from taichi_disk.errors import InputError
from taichi_disk.lattice import disk_lattice, rim_points
from taichi_disk.scatter import hexagonal_spacing
from taichi_disk.triangulation import polygon_area
from taichi_disk.wall_lattice import wall_height, with_wall

DISK = disk_lattice(1099, 0)
PAPER = with_wall(DISK, 1269, 3.8, 0, True, 0.7, 0.06)
LITERAL = with_wall(DISK, 1269, 3.8, 0, False, 0.0, 0.06)
HEIGHT = math.pi * 1269 / (1099 * 3.8)  # equal points per area


def wall_points(lattice):
    return lattice.positions[lattice.disk_points :]


@pytest.mark.parametrize("both", [PAPER, LITERAL], ids=["rows", "literal"])
def test_disk_comes_first_unchanged_but_lifted_to_the_gap(both):
    assert len(both.positions) == 1099 + 1269
    assert both.disk_points == 1099
    disk = both.positions[:1099]
    assert disk[:, 1].min() == pytest.approx(0.06, abs=1e-15)
    assert (disk[:, 0] == DISK.positions[:, 0]).all()
    assert np.ptp(disk[:, 1] - DISK.positions[:, 1]) < 1e-15
    assert (both.bonds[: len(DISK.bonds)] == DISK.bonds).all()
    assert (both.rest_lengths[: len(DISK.bonds)] == DISK.rest_lengths).all()
    assert (both.disk_surface == DISK.disk_surface).all()
    assert both.masses == pytest.approx(np.full(1099 + 1269, 1 / 1099))


@pytest.mark.parametrize("both", [PAPER, LITERAL], ids=["rows", "literal"])
def test_no_bond_joins_disk_and_wall_and_each_is_in_one_piece(both):
    i, j = both.bonds.T
    assert ((i < 1099) == (j < 1099)).all()
    assert (i < j).all()
    assert (np.diff(i.astype(np.int64) * len(both.positions) + j) > 0).all()
    n = len(both.positions)
    graph = coo_matrix((np.ones(len(i)), (i, j)), shape=(n, n))
    assert connected_components(graph, directed=False)[0] == 2


@pytest.mark.parametrize("both", [PAPER, LITERAL], ids=["rows", "literal"])
def test_surface_and_boundary_are_the_outline_cut_at_the_top_corners(both):
    surface, boundary = both.wall_surface, both.wall_boundary
    assert surface[0] == boundary[0]
    assert surface[-1] == boundary[-1]
    outline = np.concatenate([boundary, surface[-2:0:-1]])
    assert len(np.unique(outline)) == len(outline)
    # Euler: a triangulation of V points with h of them on its outline has 3 V - 3 - h bonds.
    assert len(both.bonds) - len(DISK.bonds) == 3 * 1269 - 3 - len(outline)
    # Counter-clockwise, from the left top corner down; all points inside.
    area = polygon_area(both.positions[outline])
    assert 0.98 * 3.8 * HEIGHT < area <= 3.8 * HEIGHT * (1 + 1e-12)
    x, y = wall_points(both).T
    assert (-x + y).max() == -both.positions[surface[0], 0] + both.positions[surface[0], 1]
    assert (x + y).max() == both.positions[surface[-1], 0] + both.positions[surface[-1], 1]
    assert (np.diff(both.positions[surface, 0]) > 0).all()


def test_rows_along_the_sides_are_straight_and_evenly_spaced():
    corners = PAPER.positions[[PAPER.wall_surface[0], PAPER.wall_surface[-1]]]
    assert corners == pytest.approx(np.array([[-1.9, 0.0], [1.9, 0.0]]), abs=1e-15)
    top = PAPER.positions[PAPER.wall_surface]
    assert (top[:, 1] == 0.0).all()
    assert np.diff(top[:, 0]) == pytest.approx(np.full(len(top) - 1, 3.8 / (len(top) - 1)), rel=1e-12)
    x, y = PAPER.positions[PAPER.wall_boundary].T
    left, bottom, right = x == -1.9, y == -wall_height(1099, 1269, 3.8), x == 1.9
    assert (left | bottom | right).all()
    for row, along in ((left, y), (bottom, x), (right, y)):
        step = np.abs(np.diff(along[row]))
        assert step == pytest.approx(np.full(len(step), step[0]), rel=1e-10)
        assert step[0] == pytest.approx(2 * np.pi / rim_points(1099), rel=0.05)
    assert y.min() == pytest.approx(-HEIGHT, rel=1e-14)


def test_wall_points_keep_the_disks_distance():
    assert pdist(wall_points(PAPER)).min() >= 0.7 * hexagonal_spacing(1099) * (1 - 1e-12)
    assert PAPER.rest_lengths.max() < 2.5 * hexagonal_spacing(1099)


def test_wall_depends_on_its_seed_alone_and_not_on_the_gap():
    again = with_wall(DISK, 1269, 3.8, 0, True, 0.7, 0.5)
    other = with_wall(DISK, 1269, 3.8, 1, True, 0.7, 0.06)
    assert wall_points(again).tobytes() == wall_points(PAPER).tobytes()
    assert wall_points(other).tobytes() != wall_points(PAPER).tobytes()


@pytest.mark.parametrize("rim", [True, False])
@pytest.mark.parametrize("points", [27, 60, 1269])
def test_every_width_in_the_range_that_the_message_allows_makes_a_wall(points, rim):
    disk = disk_lattice(1099, 0)
    with pytest.raises(InputError, match=r"wall\.width must be between") as refusal:
        with_wall(disk, points, 1e3, 0, rim, 0.7, 0.1)
    least, most = (float(w) for w in str(refusal.value).split("between ")[1].split(" for")[0].split(" and "))
    for width in (least * 1.001, math.sqrt(least * most), most * 0.999):
        wall = wall_points(with_wall(disk, points, width, 0, rim, 0.75, 0.1))
        assert len(wall) == points
        assert np.ptp(wall[:, 0]) <= width * (1 + 1e-12)
    for width in (least * 0.99, most * 1.01, -1.0, float("nan")):
        with pytest.raises(InputError):
            with_wall(disk, points, width, 0, rim, 0.7, 0.1)


def test_a_wall_of_too_few_points_is_told_how_many_it_takes():
    with pytest.raises(InputError, match=r"wall\.points must be at least") as refusal:
        with_wall(DISK, 5, 1.0, 0, True, 0.7, 0.1)
    fewest = int(str(refusal.value).split("at least ")[1].split()[0])
    side = math.sqrt(math.pi * fewest / 1099)
    assert len(wall_points(with_wall(DISK, fewest, side, 0, True, 0.7, 0.1))) == fewest
