"""The elastic wall's lattice: the disk's material below y = 0, apart from the disk."""

import math

import numpy as np
import pytest
from bodies import assert_tiles
from scipy.spatial.distance import pdist

from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.lattice import Lattice, with_wall
from taichi_disk.mechanics.lattice.random_points import hexagonal_spacing, rim_points
from taichi_disk.mechanics.lattice.triangles import polygon_area
from taichi_disk.mechanics.lattice.wall import wall_height

DISK = Lattice.disk(1099, 0)
PAPER = with_wall(DISK, 1269, 3.8, 0)
LITERAL = with_wall(DISK, 1269, 3.8, 0, False, 0.0)
HEIGHT = math.pi * 1269 / (1099 * 3.8)  # equal points per area


@pytest.mark.parametrize("both", [PAPER, LITERAL], ids=["rows", "literal"])
def test_the_disk_comes_first_unchanged_but_lifted_and_triangles_tile_the_wall(both):
    assert both.positions.shape == (1099 + 1269, 2)
    assert both.disk_points == 1099
    assert both.positions[:1099, 1].min() == 0.0
    assert np.ptp(both.positions[:1099] - DISK.positions, axis=0).max() < 1e-15
    for name in ("bonds", "rest_lengths", "triangles", "disk_surface"):
        own = getattr(DISK, name)
        assert (getattr(both, name)[: len(own)] == own).all()
    assert both.masses == pytest.approx(np.full(1099 + 1269, 1 / 1099))

    surface = both.wall_surface
    boundary = both.wall_boundary
    bonds = both.bonds[len(DISK.bonds) :]
    triangles = both.triangles[len(DISK.triangles) :]
    assert min(bonds.min(), triangles.min(), boundary.min(), surface.min()) >= 1099
    # The outline is split at the top corners, which belong to both parts.
    assert (surface[[0, -1]] == boundary[[0, -1]]).all()
    outline = np.concatenate([boundary, surface[-2:0:-1]])
    assert len(np.unique(outline)) == len(outline)
    assert len(np.unique(triangles)) == 1269
    assert len(bonds) == 3 * 1269 - 3 - len(outline)  # Euler
    # Counter-clockwise, from the left top corner down; all points inside.
    assert_tiles(both.positions, triangles, outline)
    area = polygon_area(both.positions[outline])
    assert 0.98 * 3.8 * HEIGHT < area <= 3.8 * HEIGHT * (1 + 1e-12)
    x, y = both.positions[1099:].T
    left, right = both.positions[surface[[0, -1]]]
    assert (y - x).max() == left[1] - left[0]
    assert (y + x).max() == right[1] + right[0]
    assert (np.diff(both.positions[surface, 0]) > 0).all()


def test_rows_along_the_sides_are_straight_and_evenly_spaced():
    top = PAPER.positions[PAPER.wall_surface]
    assert top[[0, -1]] == pytest.approx(np.array([[-1.9, 0.0], [1.9, 0.0]]), abs=1e-15)
    assert (top[:, 1] == 0.0).all()
    x, y = PAPER.positions[PAPER.wall_boundary].T
    left = x == -1.9
    bottom = y == -wall_height(1099, 1269, 3.8)
    right = x == 1.9
    assert (left | bottom | right).all()
    for along in (top[:, 0], y[left], x[bottom], y[right]):
        step = np.abs(np.diff(along))
        assert step == pytest.approx(np.full(len(step), step[0]), rel=1e-10)
        most_even = np.ptp(along) * rim_points(1099) / (2 * np.pi)
        assert abs(len(step) - most_even) <= 0.5
    assert y.min() == pytest.approx(-HEIGHT, rel=1e-14)


def test_wall_points_keep_the_disks_distance_and_depend_on_the_seed_alone():
    assert pdist(PAPER.positions[1099:]).min() >= 0.7 * hexagonal_spacing(1099) * (
        1 - 1e-12
    )
    assert PAPER.rest_lengths.max() < 2.5 * hexagonal_spacing(1099)
    again = with_wall(DISK, 1269, 3.8, 0)
    other = with_wall(DISK, 1269, 3.8, 1)
    assert (again.positions[1099:] == PAPER.positions[1099:]).all()
    assert (other.positions[1099:] != PAPER.positions[1099:]).any()


@pytest.mark.parametrize("rim", [True, False])
@pytest.mark.parametrize("points", [27, 60, 1269])
def test_every_width_in_the_range_that_the_message_allows_makes_a_wall(points, rim):
    with pytest.raises(InputError, match=r"wall\.width must be between") as refusal:
        with_wall(DISK, points, 1e3, 0, rim)
    least, most = (
        float(w)
        for w in str(refusal.value).split("between ")[1].split(" for")[0].split(" and ")
    )
    for width in (least * 1.001, math.sqrt(least * most), most * 0.999):
        wall = with_wall(DISK, points, width, 0, rim, 0.75).positions[1099:]
        assert len(wall) == points
        assert np.ptp(wall[:, 0]) <= width * (1 + 1e-12)
    for width in (least * 0.99, most * 1.01, -1.0, float("nan")):
        with pytest.raises(InputError):
            with_wall(DISK, points, width, 0, rim)


def test_a_wall_of_too_few_points_is_refused_with_the_number_needed():
    with pytest.raises(InputError, match=r"wall\.points must be at least") as refusal:
        with_wall(DISK, 5, 1.0, 0)
    fewest = int(str(refusal.value).split("at least ")[1].split()[0])
    # The rows along the sides of the narrowest wall, three springs thick, and of the
    # widest one take most of the points of an area of 20 squares of their spacing.
    spacing = 2.0 * math.pi / rim_points(1099)
    area = math.pi * fewest / 1099
    assert 20.0 <= area / spacing**2 < 20.0 + math.pi / (1099 * spacing**2)
    side = math.sqrt(math.pi * fewest / 1099)
    assert len(with_wall(DISK, fewest, side, 0).positions) == 1099 + fewest
