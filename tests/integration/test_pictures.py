"""Pictures of the painter: everything is at the place given by the camera, in the
colour given by the map."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest
from bodies import shaken, to_pixels
from scipy.spatial import cKDTree

from taichi_disk import runtime
from taichi_disk.engine import ti
from taichi_disk.fields import QUANTITIES, Triangles, at_points
from taichi_disk.lattice import Lattice
from taichi_disk.physics import ExponentialWall, Springs
from taichi_disk.render import film_problem
from taichi_disk.render.geometry import Camera
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, colour_map
from taichi_disk.render.pictures import shrunk

pytestmark = pytest.mark.skipif(film_problem() is not None, reason=str(film_problem()))
SIZE = 360
CAMERA = Camera.fit((-1.15, 1.15, -0.1, 2.2), SIZE, SIZE, (0.0, SIZE, 0.0, SIZE))
DISK = Lattice.disk(400, 0)
X, V = shaken(DISK, 0, 2e-3)
X += [0.0, 1.1]


@pytest.fixture(scope="module")
def shoot(tmp_path_factory):
    """Return a function that draws a state of a lattice: (SIZE, SIZE, 3), rows
    downwards, 0 to 1."""
    runtime.start()
    window = ti.ui.Window("test", (SIZE, SIZE), show_window=False)
    here = os.getcwd()

    def draw(lattice, x, v=None, wall=None, camera=CAMERA, unit=0.5, **look):
        look = {"draw": "field", "limit": 0.02} | look
        painter = Painter(lattice, Springs(), wall, **look)
        if v is None:
            v = np.zeros_like(x)
        painter.paint(window.get_canvas(), camera, x, v, painter.placed(x), unit)
        picture = window.get_image_buffer_as_numpy()[..., :3]
        return picture.transpose(1, 0, 2)[::-1].astype(float)

    yield draw
    os.chdir(tmp_path_factory.mktemp("window"))  # a closing window writes an imgui.ini
    window.destroy()
    os.chdir(here)


def ground(theme="light"):
    return np.array(THEMES[theme].ground)


def pixel(picture, at, camera=CAMERA):
    column, row = to_pixels(camera, at).astype(int)
    return picture[row, column]


@pytest.mark.parametrize("colour", QUANTITIES)
def test_colours_equal_the_field_s_values(shoot, colour):
    painter = Painter(DISK, Springs())
    # triangles that do not touch the outline, which is drawn over them
    is_outer = np.isin(DISK.triangles, DISK.disk_surface).any(axis=1)
    corners = DISK.triangles[~is_outer][::5]
    values = at_points(colour, Triangles(DISK), Springs(), X, V)
    painter.colour = colour
    painter.limit = 1.3 * float(np.abs(values).max())
    for painter.theme in THEMES:
        look = {"colour": colour, "theme": painter.theme, "limit": painter.limit}
        picture = shoot(DISK, X, V, **look)
        drawn = np.array([pixel(picture, X[three].mean(axis=0)) for three in corners])
        # The middle of a triangle has the mean colour of its corners or, for nonlinear
        # colours, the colour of the mean value.
        colours = painter.colours(painter.normalised(values))[corners].mean(axis=1)
        if colour == "fringes":
            light = np.sin(np.pi * values[corners].mean(axis=1) / painter.limit) ** 2
            table = colour_map(painter.theme, "fringes")
            colours = table[np.rint(511 * light).astype(int)]
        assert np.median(np.abs(drawn - colours)) < 0.01
        # half a pixel off the middle, in steep colours
        assert np.percentile(np.abs(drawn - colours), 95) < 0.06


@pytest.mark.parametrize("draw", ["field", "both", "springs", "points"])
@pytest.mark.parametrize("points", [3, 20, 2000])
def test_a_disk_of_any_number_of_points_is_seen_whole(shoot, points, draw):
    disk = Lattice.disk(points, 1)
    x = disk.positions + [0.0, 1.1]
    picture = shoot(disk, x, draw=draw, theme="dark")
    is_drawn = np.abs(picture - ground("dark")).sum(axis=-1) > 0.05
    rows, columns = np.nonzero(is_drawn)
    drawn = np.array([(columns.min(), rows.min()), (columns.max() + 1, rows.max() + 1)])
    there = to_pixels(CAMERA, x)
    # Lines and points are drawn around the positions, by less than 4 pixels at this
    # size.
    assert (drawn[0] <= there.min(axis=0) + 1.0).all()
    assert (drawn[0] > there.min(axis=0) - 4).all()
    assert (drawn[1] >= there.max(axis=0) - 1.0).all()
    assert (drawn[1] < there.max(axis=0) + 4).all()


def test_springs_are_seen_on_the_field_of_a_coarse_lattice_only(shoot):
    x = DISK.positions + [0.0, 1.1]
    fine = Lattice.disk(9000, 0)
    plain = shoot(DISK, x)
    sprung = shoot(DISK, x, draw="both")
    i, j = DISK.bonds[::5].T
    middles = 0.5 * (x[i] + x[j])
    darker = [(pixel(plain, at) - pixel(sprung, at)).mean() for at in middles]
    assert (np.array(darker) > 0.02).mean() > 0.7
    for lattice, y, look in (
        (fine, fine.positions + [0.0, 1.1], {}),
        (DISK, x, {"colour": "fringes"}),
    ):
        field, both = (
            shoot(lattice, y, draw=draw, **look) for draw in ("field", "both")
        )
        assert np.array_equal(field, both)


@pytest.mark.parametrize("a", [10.0, 300.0])
@pytest.mark.parametrize("theme", THEMES)
def test_the_wall_is_solid_up_to_where_the_disk_rests(shoot, theme, a):
    edge = 0.05
    body = np.array(THEMES[theme].wall)
    x = DISK.positions - [0.0, DISK.positions[:, 1].min() - edge]
    picture = shoot(DISK, x, wall=ExponentialWall(a, 150.0), edge=edge, theme=theme)
    for place in ((-0.9, edge - 0.02), (0.9, 0.0)):
        assert pixel(picture, place) == pytest.approx(body, abs=0.01)
    haze = pixel(picture, (-1.0, edge + 0.1)) - ground(theme)
    share = np.exp(-a * 0.1) * np.linalg.norm(body - ground(theme))
    assert np.linalg.norm(haze) == pytest.approx(share, abs=0.02)
    # Between disk and wall there is nothing: the lowest point lies on the edge.
    column = int(to_pixels(CAMERA, x[x[:, 1].argmin()])[0])
    gap = np.abs(picture[:, column] - ground(theme)).sum(axis=-1) < 0.01
    assert gap[:15].any()
    assert not gap[40:].any()


def test_springs_across_triangles_and_the_edge_of_a_core_are_drawn(shoot):
    line = np.arange(-4.0, 5.0) / 4.0
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    near = cKDTree(grid).query_pairs(0.36, output_type="ndarray")
    squares = np.arange(81).reshape(9, 9)[:-1, :-1].reshape(-1, 1)
    halves = np.concatenate([squares + [0, 1, 10], squares + [0, 10, 9]])
    crossed = Lattice.from_points(grid, near, triangles=halves)
    x = crossed.positions + [0.0, 1.1]
    triangles = Triangles(crossed)
    field, both = (shoot(crossed, x, draw=draw) for draw in ("field", "both"))
    assert len(triangles.crossing) == 64  # the other diagonal of each square
    darker = (field - both).sum(axis=-1) > 0.02
    for a, b in x[triangles.crossing]:
        part = a + 0.3 * (b - a)
        column, row = to_pixels(CAMERA, part).astype(int)
        assert darker[row - 1 : row + 2, column - 1 : column + 2].any()
    core = Lattice.disk(400, 0, core_radius=0.5, core_stiffness=2.0)
    x = core.positions + [0.0, 1.1]
    ink = shoot(core, x).sum(axis=-1) < 1.5
    turns = np.linspace(0.0, 6.2, 40)
    edge = 0.499 * np.stack([np.cos(turns), np.sin(turns)], axis=1) + [0.0, 1.1]
    columns, rows = to_pixels(CAMERA, edge).astype(int).T
    for column, row in zip(columns, rows, strict=True):
        assert ink[row - 1 : row + 2, column - 1 : column + 2].any()
    plain = shoot(replace(core, stiffness=None), x).sum(axis=-1) < 1.5
    assert not plain[rows, columns].any()


def test_a_picture_does_not_depend_on_those_before_it(shoot):
    alone = shoot(DISK, X, V, draw="both")
    shoot(DISK, 1.1 * DISK.positions, draw="both")
    assert np.array_equal(shoot(DISK, X, V, draw="both"), alone)


@pytest.mark.parametrize("samples", [1.0, 1.5, 2.0])
def test_smoothing_averages_over_the_area_of_each_pixel(samples):
    shape = round(24 * samples), round(16 * samples), 4
    drawn = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
    # split each pixel into 2 x 2, of which 2 samples x 2 samples have one mean
    fine = drawn.repeat(2, axis=0).repeat(2, axis=1).astype(float)
    block = round(2 * samples)
    mean = fine.reshape(24, block, 16, block, 4).mean(axis=(1, 3))
    assert shrunk(drawn, samples)[..., :3] == pytest.approx(mean[..., :3], abs=1.01)
