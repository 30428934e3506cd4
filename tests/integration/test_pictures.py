"""Pictures of the painter: all is where the camera puts it, in the colour of maps."""

import os

import numpy as np
import pytest
from bodies import shaken, to_pixels
from programs import film_problem

from taichi_disk.base import runtime
from taichi_disk.base.engine import ti
from taichi_disk.mechanics.fields import QUANTITIES, Triangles, at_points
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.physics import Springs
from taichi_disk.pictures.render.finisher import shrunk
from taichi_disk.pictures.render.geometry import Camera
from taichi_disk.pictures.render.painter import Painter
from taichi_disk.pictures.render.palette import THEMES, colour_map

pytestmark = pytest.mark.skipif(film_problem() is not None, reason=str(film_problem()))
SIZE = 360
CAMERA = Camera.fit((-1.15, 1.15, -0.1, 2.2), SIZE, SIZE, (0.0, SIZE, 0.0, SIZE))
DISK = Lattice.disk(400, 0)
X, V = shaken(DISK, 0, 2e-3)
X += [0.0, 1.1]


@pytest.fixture(scope="module")
def shoot(tmp_path_factory):
    """Return a function that draws a lattice: (SIZE, SIZE, 3), rows downwards."""
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
    # Lines and points are drawn around the positions, by less than 4 pixels here.
    assert (drawn[0] <= there.min(axis=0) + 1.0).all()
    assert (drawn[0] > there.min(axis=0) - 4).all()
    assert (drawn[1] >= there.max(axis=0) - 1.0).all()
    assert (drawn[1] < there.max(axis=0) + 4).all()


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
