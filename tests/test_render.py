"""Pictures: is everything where the camera says it is, in the colour that the scale gives to its strain?"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import taichi as ti
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.render.arrows import ARROW
from taichi_disk.render.camera import Camera
from taichi_disk.render.colours import GROUND, INK, amount_colours, strain_colours
from taichi_disk.render.film import film_problem
from taichi_disk.render.layout import Layout, _ticks
from taichi_disk.render.picture import Frame, Subject
from taichi_disk.render.text import width

needs_vulkan = pytest.mark.skipif(film_problem() is not None, reason=str(film_problem()))
VIEW = (-1.1, 1.1, 0.0, 2.2)
LIMIT = 0.02
UP = np.array([0.0, 1.1])


@pytest.fixture(scope="module", autouse=True)
def taichi() -> None:
    ti.init(ti.cpu, default_fp=ti.f64, fast_math=False, log_level=ti.ERROR)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Pictures leave nothing in the current folder."""
    monkeypatch.chdir(tmp_path)
    yield
    assert not list(tmp_path.iterdir())


def lattice_of(positions: NDArray[np.float64], bonds: list[tuple[int, int]]) -> Lattice:
    b, none = np.array(bonds, dtype=np.int32), np.empty(0, dtype=np.int32)
    rest = np.linalg.norm(positions[b[:, 0]] - positions[b[:, 1]], axis=1)
    n = len(positions)
    return Lattice(positions, b, rest, np.full(n, 1.0 / n), n, none, none, none)


def honeycomb(rings: int) -> Lattice:
    """A patch of the triangular lattice: the same after half a turn, so its centroid is its centre.

    Turned a little: lines along the rows of pixels are one pixel thicker or thinner all at once.
    """
    k = range(-rings, rings + 1)
    cells = [(i, j) for i in k for j in k if abs(i + j) <= rings]
    x = np.array([(i + 0.5 * j, np.sqrt(0.75) * j) for i, j in cells]) / rings @ [(0.98, 0.2), (-0.2, 0.98)]
    apart = np.linalg.norm(x[:, None] - x[None], axis=2)
    return lattice_of(x, [tuple(p) for p in np.argwhere(np.triu(apart < 1.01 / rings, 1))])


def subject(lattice: Lattice, rigid_wall: bool = True) -> Subject:
    return Subject(lattice, rigid_wall, ("A test", "k_a = 1"), LIMIT, VIEW)


def pictures(what: Subject, states: Iterable[NDArray[np.float64]], size: int = 360) -> tuple[list, Camera]:
    """Pictures (rows, columns, 3) of states with positions (n, 2), and the camera that took them."""
    from taichi_disk.render.still import Stills

    with Stills([what], size, 1) as stills:
        return [stills.draw([Frame(0.0, x, ("t = 0",))])[..., :3].copy() for x in states], stills.camera


def drawn(image: NDArray[np.uint8], camera: Camera) -> NDArray[np.float64]:
    """How far each pixel of the stage is from the ground's colour, 0 outside the stage."""
    stage = np.s_[camera.top : camera.top + camera.height, camera.left : camera.left + camera.width]
    amount = np.zeros(image.shape[:2])
    amount[stage] = np.abs(image[stage] - np.rint(255 * np.array(GROUND))).sum(axis=-1)
    return np.where(amount > 3, amount, 0.0)


def centroid(amount: NDArray[np.float64]) -> NDArray[np.float64]:
    """(column, row) of the centre of what is drawn; pixel k covers k to k + 1."""
    columns, rows = np.arange(amount.shape[1]) + 0.5, np.arange(amount.shape[0]) + 0.5
    return np.array([amount.sum(0) @ columns, amount.sum(1) @ rows]) / amount.sum()


def lightness(rgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """CIE L* of sRGB colours, from the standard's own luminance weights."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    return 116 * np.cbrt(linear @ [0.2126, 0.7152, 0.0722]) - 16


def test_stretched_is_red_compressed_is_blue_and_rest_is_grey() -> None:
    red, blue, grey = strain_colours(np.array([LIMIT, -LIMIT, 0.0]), LIMIT)
    assert red[0] > 0.6 and red[0] > 2 * max(red[1:])
    assert blue[2] > 0.6 and blue[2] > 2 * blue[0]
    assert np.ptp(grey) < 0.02


def test_equal_strains_of_either_sign_are_equally_light_and_lightness_falls_evenly() -> None:
    strain = np.linspace(0.0, LIMIT, 21)
    for sign in (1, -1):
        light = lightness(strain_colours(sign * strain, LIMIT))
        # Linear in L*: 74 at rest, 36 at the limit (a little more where sRGB clips the blue).
        assert light == pytest.approx(74 - (74 - 36) * strain / LIMIT, abs=1.5)


def test_amounts_darken_evenly_from_what_stands_out_from_the_ground() -> None:
    light = lightness(amount_colours(np.linspace(0.0, 3.0, 21), 3.0))
    assert lightness(np.array(GROUND)) - light[0] > 12
    assert np.diff(light) == pytest.approx((light[-1] - light[0]) / 20, abs=0.2) and light[-1] < 35


def test_springs_at_rest_stand_out_from_the_ground() -> None:
    assert lightness(np.array(GROUND)) - lightness(strain_colours(np.array(0.0), LIMIT)) > 20


def test_strains_beyond_the_limit_have_its_colour() -> None:
    assert np.array_equal(strain_colours(np.array([7.0, -7.0]), 0.1), strain_colours(np.array([0.1, -0.1]), 0.1))


@pytest.mark.parametrize(("limit", "ticks"), [(0.02, 0.01), (0.05, 0.025), (0.01, 0.005), (0.003, 0.001)])
def test_ticks_of_the_colour_bar_are_round(limit: float, ticks: float) -> None:
    assert np.allclose(np.diff(_ticks(limit)), ticks, rtol=1e-12)
    assert _ticks(limit)[0] >= -limit * (1 + 1e-9)


def test_an_underscore_makes_a_narrower_subscript() -> None:
    assert width("v", 20) < width("v_cm", 20) < width("vcm", 20)
    assert width("τ_{reset}", 20) == width("τ_reset", 20)


def test_the_camera_keeps_the_view_on_the_stage_with_equal_scales() -> None:
    camera = Camera.fit((-1.9, 1.9, -0.95, 2.1), 0, 60, 720, 580, 14.0)
    corners = camera.to_pixels([(-1.9, -0.95), (1.9, 2.1)])
    assert corners[0, 0] >= 14 and corners[1, 0] <= 706
    assert corners[1, 1] >= 60 + 14 and corners[0, 1] <= 60 + 580 - 14
    assert camera.to_pixels((1.0, 0.0)) - camera.to_pixels((0.0, 1.0)) == pytest.approx([camera.scale] * 2)


@needs_vulkan
def test_a_spring_has_the_colour_of_its_strain() -> None:
    triangle = lattice_of(np.array([(-0.9, 0.5), (0.9, 0.5), (0.0, 1.9)]), [(0, 1), (0, 2), (1, 2)])
    strains = [0.013, -0.008, 0.0, 0.05, -0.05]  # of the first spring, which lies along x
    pulled = [triangle.positions * [1.0 + strain, 1.0] for strain in strains]
    images, camera = pictures(subject(triangle), pulled, size=720)
    for strain, x, image in zip(strains, pulled, images, strict=True):
        column, row = camera.to_pixels(x[:2].mean(axis=0)).astype(int)
        # One in 255 for rounding, one for the linear interpolation in the table of 256 colours.
        assert image[row, column] == pytest.approx(255 * strain_colours(np.array(strain), LIMIT), abs=2)


@needs_vulkan
@pytest.mark.parametrize("signed", [True, False])
def test_a_point_without_springs_has_the_colour_of_the_mean_of_its_springs(signed: bool) -> None:
    from taichi_disk.render.painter import Painter

    triangle = lattice_of(np.array([(-0.9, 0.5), (0.9, 0.5), (0.0, 1.9)]), [(0, 1), (0, 2), (1, 2)])
    camera = Camera.fit(VIEW, 0, 0, 360, 360, 10.0)
    painter = Painter(subject(triangle, rigid_wall=False), camera, 0.5)
    window = ti.ui.Window("test", (360, 360), show_window=False)
    values = np.array([0.2, 0.6, 1.0])
    painter.paint(window.get_canvas(), triangle.positions, values, "points", signed)
    image = window.get_image_buffer_as_numpy()[..., :3].transpose(1, 0, 2)[::-1]
    window.destroy()
    Path("imgui.ini").unlink(missing_ok=True)
    colours = (strain_colours if signed else amount_colours)(np.array([0.4, 0.6, 0.8]), 1.0)
    for (column, row), colour in zip(camera.to_pixels(triangle.positions).astype(int), colours, strict=True):
        assert image[row, column] == pytest.approx(colour, abs=2 / 255)
    seen = (np.abs(image - GROUND).sum(axis=-1) > 0.02).sum()
    assert seen < 3 * np.pi * 8**2  # nothing but three points
    painter.destroy()


@needs_vulkan
@pytest.mark.parametrize("size", [122, 360, 722])
def test_the_disk_is_drawn_where_the_camera_says(size: int) -> None:
    patch = honeycomb(5)
    centres = np.array([(0.0, 1.1), (-0.07, 1.02), (0.0937, 1.1718)])
    images, camera = pictures(subject(patch, rigid_wall=False), patch.positions + centres[:, None], size)
    assert images[0].shape == (size, size, 3)
    for centre, image in zip(centres, images, strict=True):
        assert np.abs(centroid(drawn(image, camera)) - camera.to_pixels(centre)).max() < 0.5


@needs_vulkan
@pytest.mark.parametrize("points", [3, 20, 1099, 20_000])
def test_a_disk_of_any_number_of_points_is_seen_whole(points: int) -> None:
    disk = disk_lattice(points, 1)
    positions = disk.positions + UP
    (image,), camera = pictures(subject(disk, rigid_wall=False), [positions])
    rows, columns = np.nonzero(drawn(image, camera))
    seen = np.array([(columns.min(), rows.min()), (columns.max() + 1, rows.max() + 1)])
    there = camera.to_pixels(positions)
    # Lines and points are drawn around the positions, by less than 4 pixels at this size.
    assert (seen[0] <= there.min(axis=0) + 0.5).all() and (seen[0] > there.min(axis=0) - 4).all()
    assert (seen[1] >= there.max(axis=0) - 0.5).all() and (seen[1] < there.max(axis=0) + 4).all()


@needs_vulkan
@pytest.mark.parametrize("rigid", [True, False])
def test_only_the_rigid_wall_is_drawn_as_a_line_at_y_0(rigid: bool) -> None:
    disk = disk_lattice(20, 0)
    (image,), camera = pictures(subject(disk, rigid), [disk.positions + UP], size=720)
    row = int(camera.to_pixels((0.0, 0.0))[1])
    columns = slice(camera.left, camera.left + camera.width)
    line = image[row - 1 : row + 1, columns].astype(int).sum(axis=-1).min(axis=0)
    ink, ground = 255 * sum(INK), 255 * sum(GROUND)
    assert (line < 0.5 * (ink + ground)).all() if rigid else (line > ground - 3).all()


@needs_vulkan
def test_a_picture_does_not_depend_on_those_before_it() -> None:
    from taichi_disk.render.still import Stills

    disk = disk_lattice(100, 0)
    first, second = 1.1 * disk.positions + UP, 0.9 * disk.positions + UP
    with Stills([subject(disk)], 360, 1) as stills:
        stills.draw([Frame(0.0, first, ("t = 10000000 R/c",))])
        after = stills.draw([Frame(1.0, second, ("t = 10000000 R/d",))]).copy()
    with Stills([subject(disk)], 360, 1) as stills:
        assert np.array_equal(after, stills.draw([Frame(1.0, second, ("t = 10000000 R/d",))]))


@needs_vulkan
def test_more_samples_make_smoother_edges_of_the_same_lines() -> None:
    from taichi_disk.render.still import Stills

    disk = disk_lattice(30, 0)
    x, stages = disk.positions + UP, []
    for samples in (1.0, 1.5, 2.0):
        with Stills([replace(subject(disk, rigid_wall=False), show="springs")], 360, 1, samples) as stills:
            image, camera = stills.draw([Frame(0.0, x, ("t = 0",))])[..., :3].astype(int), stills.camera
            stages.append(image[camera.top : camera.top + camera.height, camera.left : camera.left + camera.width])
    # At rest all springs are grey, and their points are not drawn: the darkest is the spring's grey.
    grey, ground = (np.rint(255 * np.asarray(c)) for c in (strain_colours(np.array(0.0), 1.0), GROUND))
    assert all((stage.min(axis=(0, 1)) >= grey - 1).all() for stage in stages)
    shades = [len(np.unique(stage.reshape(-1, 3), axis=0)) for stage in stages]
    assert shades[0] == 2 and shades[0] < shades[1] and shades[0] < shades[2]
    cover = [(ground - stage).sum() for stage in stages]
    assert cover[0] == pytest.approx(cover[2], rel=0.1) and cover[1] == pytest.approx(cover[2], rel=0.05)


@needs_vulkan
def test_an_arrow_stands_on_a_pushed_point_as_long_as_its_force(tmp_path: Path) -> None:
    from taichi_disk.render.still import Stills

    disk = replace(disk_lattice(100, 0))
    what = replace(subject(disk, rigid_wall=False), full_force=2e-3)
    x = disk.positions + UP
    point = int(x[:, 0].argmin())
    with Stills([what], 360, 1) as stills:
        plain = stills.draw([Frame(0.0, x, ("t = 0",), pushed=(np.array([point]), np.array([[0.0, 0.001]])))]).copy()
        pushed = stills.draw([Frame(0.0, x, ("t = 0",), pushed=(np.array([point]), np.array([[0.0, 0.8]])))])
        changed = np.argwhere((plain != pushed).any(axis=-1)) + 0.5
        column, foot = stills.camera.to_pixels(x[point])
        length = 0.8 * ARROW * stills.camera.scale
        assert np.array_equal(stills.draw([Frame(0.0, x, ("t = 0",))]), plain)
    assert changed[:, 0].min() == pytest.approx(foot - length, abs=2.0)
    assert changed[:, 0].max() == pytest.approx(foot, abs=6.0)
    assert changed[:, 1].mean() == pytest.approx(column, abs=1.0)


def test_changing_text_is_set_in_the_upper_right_and_leaves_the_rest_alone() -> None:
    layout = Layout(subject(honeycomb(2)), 720, 2)
    picture = np.dstack([layout.still, np.zeros((720, 720), dtype=np.uint8)])
    layout.write(picture, ("t = 1.5 R/c", "v_cm = 0.1"))
    rows, columns = np.nonzero((picture[..., :3] != layout.still).any(axis=-1))
    assert len(rows) > 300  # pixels of ink
    assert rows.max() < layout.header and columns.min() > 540
    layout.write(picture, ())
    assert np.array_equal(picture[..., :3], layout.still)


def test_the_colour_bar_shows_the_scale() -> None:
    still = Layout(subject(honeycomb(2)), 720, 2).still
    bar = next(row for row in still[::-1] if np.ptp(row[360].astype(int)) < 3 and row[360].max() < 200)
    colours = np.rint(255 * strain_colours(np.linspace(-LIMIT, LIMIT, 300), LIMIT))
    assert np.array_equal(bar[210:510], colours)


@needs_vulkan
@pytest.mark.parametrize("samples", [2, 3, 4])
def test_smoothing_averages_over_the_area_of_each_pixel(samples: int) -> None:
    from taichi_disk.render.still import _shrink

    drawn = np.random.default_rng(0).random((12 * samples, 8 * samples, 4)).astype(np.float32)
    strip = np.zeros((16, 40), dtype=np.uint32)
    _shrink(drawn, strip, 10, samples)
    assert not strip[:, :10].any() and not strip[:, 34:].any()
    stage = np.ascontiguousarray(strip[:, 10:34])
    # samples/2 a pixel: cut each into 2 x 2, average samples x samples of those; [x, y up] becomes [row, column].
    fine = drawn.repeat(2, axis=0).repeat(2, axis=1).astype(float)
    mean = fine.reshape(24, samples, 16, samples, 4).mean(axis=(1, 3)).transpose(1, 0, 2)[::-1]
    assert np.abs(stage.view(np.uint8).reshape(16, 24, 4)[..., :3] - 255 * mean[..., :3]).max() < 0.5 + 1e-3


@pytest.mark.parametrize("bad", [np.nan, np.inf])
def test_a_position_that_is_not_finite_is_refused(bad: float) -> None:
    disk = disk_lattice(20, 0)
    positions = disk.positions + UP
    positions[7, 1] = bad
    with pytest.raises(SimulationError, match=r"t = 0 R/c.*1 of 20 points.*point 7"):
        Frame(0.0, positions, ()).require_finite()
