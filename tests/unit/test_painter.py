"""The parts of pictures, without a graphics device: camera, colours, scales, wall,
arrows, text."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from bodies import RIGID, to_pixels
from PIL import Image, ImageDraw

from taichi_disk.lattice import disk_lattice
from taichi_disk.physics import ExponentialWall, Springs
from taichi_disk.render import palette, words
from taichi_disk.render.geometry import ArrowStyle, Camera, arrows, edge_height
from taichi_disk.render.moments import Caption
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import LEVELS, THEMES, colour_map
from taichi_disk.render.pictures import Disk, arranged
from taichi_disk.render.words import LEAST, Letters, Scales, legend

VIEW = (-1.1, 1.1, -0.1, 2.1)
DISK = disk_lattice(60, 0)
# Viénot, Brettel and Mollon 1999: linear RGB as a dichromat without long or medium
# cones sees it.
DICHROMATS = {
    "protan": np.array(
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]]
    ),
    "deutan": np.array(
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]]
    ),
}


def linear(rgb):
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def lightness(rgb):
    """Return CIE L* of sRGB colours, from the luminance weights of the standard."""
    return (
        116 * np.cbrt(linear(np.asarray(rgb, dtype=float)) @ [0.2126, 0.7152, 0.0722])
        - 16
    )


def painter(**attributes):
    made = Painter(
        replace(DISK, positions=DISK.positions + [0.0, 1.05]), Springs(), RIGID
    )
    vars(made).update(
        {"colour": "pressure", "limit": 0.02, "full_force": 0.01, "edge": 0.03}
        | attributes
    )
    return made


# ---- camera


def test_the_camera_keeps_the_view_in_the_viewport_with_equal_scales():
    camera = Camera.fit(
        (-1.9, 1.9, -0.95, 2.1), 720, 700, 14.0, (0.0, 720.0, 60.0, 640.0)
    )
    (left, bottom), (right, top) = to_pixels(camera, [(-1.9, -0.95), (1.9, 2.1)])
    assert left >= 14
    assert right <= 706
    assert top >= 73.999
    assert bottom <= 626.001
    assert to_pixels(camera, (1.0, 0.0)) - to_pixels(
        camera, (0.0, 1.0)
    ) == pytest.approx([camera.scale] * 2)


def test_zooming_keeps_the_point_under_the_cursor_and_every_camera_has_an_inverse():
    wide = Camera.fit(VIEW, 640, 480)
    cursor = (100.0, 50.0)
    closer = wide.zoomed(2.5, cursor)
    assert to_pixels(closer, wide.to_scene(cursor)) == pytest.approx(cursor)
    left, right, low, high = closer.seen
    assert (right - left, high - low) == pytest.approx(
        (640 / (2.5 * wide.scale), 480 / (2.5 * wide.scale))
    )
    camera = closer.panned(7.0, -30.0)
    points = np.random.default_rng(0).random((20, 2))
    assert camera.to_scene(to_pixels(camera, points)) == pytest.approx(
        points, abs=1e-12
    )


# ---- colours


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("kind", ["pressure", "stretch", "amount", "fringes"])
@pytest.mark.parametrize("bare", [False, True])
def test_maps_are_even_in_lightness(theme, kind, bare):
    light = lightness(colour_map(theme, kind, bare))
    for half in np.split(light, 2) if kind in ("pressure", "stretch") else [light]:
        assert np.abs(half - np.linspace(half[0], half[-1], len(half))).max() < 2.5
        assert abs(half[-1] - half[0]) > 40


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("eyes", DICHROMATS)
def test_the_colour_blind_tell_compression_from_stretching(theme, eyes):
    seen = linear(colour_map(theme, "pressure")) @ DICHROMATS[eyes].T
    low = seen[: LEVELS // 8].mean(axis=0)
    high = seen[-LEVELS // 8 :].mean(axis=0)
    # They can distinguish yellow from blue, so the fractions of blue in the seen
    # colours must differ.
    assert high[2] / high.sum() - low[2] / low.sum() > 0.25


@pytest.mark.parametrize("theme", THEMES)
def test_compression_is_blue_and_what_rests_stands_out_from_the_ground(theme):
    for kind, place in (("pressure", -1), ("stretch", 0)):
        red, _, blue = colour_map(theme, kind)[place]
        assert blue > red + 0.2
    for kind, place in (("pressure", LEVELS // 2), ("amount", 0)):
        resting = lightness(colour_map(theme, kind, bare=True)[place])
        assert abs(resting - lightness(np.array(THEMES[theme].ground))) > 14


# ---- scales


@pytest.mark.parametrize(
    "value", [0.0123, 0.0577, 9.2, 2.3e-5, 0.14, 1e-12, 0.3, 999.9999999999999]
)
def test_scales_end_at_round_numbers(value):
    limit = palette.round_near(value)
    assert 1 / 1.25 < limit / value < 1.25
    below = words.round_below(value)
    assert value / 2.5 < below <= value
    assert f"{below:.6e}"[:8] in (
        "1.000000",
        "2.000000",
        "5.000000",
    )
    assert f"{limit:.6e}".split("e")[0].rstrip("0").rstrip(".") in (
        "1",
        "1.5",
        "2",
        "3",
        "4",
        "5",
        "6",
        "8",
    )


def test_numbers_are_written_as_in_print():
    assert words.label(-5.0, signed=True) == "−5"
    assert words.label(2e-7) == "2·10⁻⁷"
    assert words.label(0.0) == "0"
    assert words.label(0.5, signed=True) == "+0.5"


def test_the_round_number_next_to_a_value_is_the_one_nearest_in_ratio():
    # 8.97 is nearer to 8 by difference but nearer to 10 by ratio; likewise 2.46 is
    # nearer to 2, but to 3 by ratio.
    assert palette.round_near(0.0897) == 0.1
    assert palette.round_near(0.0246) == 0.03
    assert palette.round_near(0.0892) == 0.08
    assert palette.round_near(0.0244) == 0.02


def test_few_outliers_do_not_set_the_scale():
    values = np.concatenate([np.linspace(-0.1, 0.1, 990), [7.0] * 5])
    assert palette.full_scale(values, "pressure") == 0.1
    assert palette.full_scale(np.linspace(0.0, 0.1, 1000), "fringes") == pytest.approx(
        0.02
    )


# ---- wall and arrows


def test_the_wall_s_edge_is_where_it_pushes_with_the_largest_force():
    for a in (10.0, 300.0):
        wall = ExponentialWall(a, 150.0)
        assert a * wall.potential(np.array([edge_height(wall, 2e-3)])) == pytest.approx(
            [2e-3]
        )
    assert edge_height(None, 1.0) == edge_height(wall, 0.0) == 0.0


def test_arrows_that_would_touch_become_their_mean_and_weak_ones_are_left_out():
    default_painter = painter()
    lowest = np.argsort(default_painter.lattice.positions[:, 1])[:4]
    forces = np.array([0.002, 0.004, 0.006, 1e-6])
    pushes = lowest, np.stack([np.zeros(4), forces], axis=1)
    default_painter.wall = SimpleNamespace(
        decay_length=1 / 300, contact_forces=lambda *state: pushes
    )
    x = default_painter.lattice.positions + [5.0, 0.0]
    feet, mean = default_painter.pushes(x, 0 * x, x, 10.0)
    assert feet == pytest.approx(x[lowest[:3]].mean(axis=0)[None])
    assert mean == pytest.approx(np.array([[0.0, 0.4]]))
    assert len(default_painter.pushes(x, 0 * x, x, 1e-3)[0]) == 3


def test_arrows_begin_above_the_wall_s_edge_however_much_displacements_are_magnified():
    default_painter = painter(magnify=20.0)
    lowest = np.argsort(default_painter.lattice.positions[:, 1])[:6]
    default_painter.wall = SimpleNamespace(
        decay_length=1e-9, contact_forces=lambda *state: (lowest, np.full((6, 2), 0.01))
    )
    x = np.maximum(default_painter.lattice.positions, [-9.0, 0.1])  # flat below
    assert default_painter.placed(x)[lowest, 1].min() < 0.0 < default_painter.edge
    placed = default_painter.placed(x)
    feet, _ = default_painter.pushes(x, 0 * x, placed, 1e-3)
    assert feet[:, 1].min() == default_painter.edge


def test_the_head_of_a_short_arrow_is_in_proportion_and_never_longer_than_the_arrow():
    length = np.array([0.35, 0.1, 0.007])
    head = 0.06
    vectors = np.stack([np.zeros(3), length], axis=1)
    style = ArrowStyle(shaft=0.02, head=head, rim=0.01, fade=0.0)
    theme = THEMES["light"]
    points, colours = arrows(np.zeros((3, 2)), vectors, style, theme.arrow, theme)
    assert (colours[:, :3] == theme.ground).all(axis=1).sum() == len(points) / 2
    # first the rim, then the arrow: three filled triangles each, the last is the head
    front = points[len(points) // 2 :][: 3 * 9].reshape(3, 9, 2)
    back = front[:, 6]
    tip = front[:, 7]
    assert tip[:, 1] == pytest.approx(length)
    half = np.abs(back[:, 0])
    depth = tip[:, 1] - back[:, 1]
    assert half == pytest.approx([head, *(0.65 / 1.56 * length[1:])])
    assert (depth < tip[:, 1]).all()
    assert depth == pytest.approx(1.56 * half)


# ---- displacements shown larger


def test_a_rigid_motion_stays_where_it_is_and_a_strain_is_magnified():
    magnified_painter = painter(magnify=20.0)
    rest = magnified_painter.lattice.positions
    rest_at = rest.mean(axis=0)
    cos = np.cos(0.7)
    sin = np.sin(0.7)
    flown = (rest - rest_at) @ np.array([[cos, sin], [-sin, cos]]) + [3.0, 1.5]
    assert magnified_painter.placed(flown) == pytest.approx(flown, abs=1e-12)
    # A disk that has shrunk uniformly: the lowest point stays, and all other
    # displacements are 20 times as large.
    middle = rest_at[0]
    low = rest[:, 1].min()
    x = rest - 0.003 * (rest - [middle, low])
    assert magnified_painter.placed(x) == pytest.approx(
        rest - 0.06 * (rest - [middle, low]), abs=1e-12
    )
    assert (painter().placed(x) == x).all()
    assert magnified_painter.remarks == ["displacements × 20"]
    assert painter().remarks == []
    plain, titled = (still(each)[0] for each in (painter(), magnified_painter))
    assert (plain[:550] == titled[:550]).all()
    assert (plain[550:] != titled[550:]).any()


def still(painter, size=720):
    """Return the constant words of a picture, and its scales."""
    letters = Letters(size)
    block = legend(letters, size, ("A", "B"), painter.remarks, [Caption(["t"])])
    image = Image.new("RGBA", (size, size), "white")
    for line in block.lines:
        line.draw(ImageDraw.Draw(image), 0.0, 0.0)
    below = np.zeros((letters.footer, size, 4), np.uint8)
    draw = ImageDraw.Draw(Image.fromarray(below))
    Scales(painter, size, letters, 250.0 * size / 720).draw(below, draw)
    return np.asarray(image), below[..., :3]


# ---- text


@pytest.mark.parametrize("is_band", [False, True])
@pytest.mark.parametrize("size", [64, 200, 240, 360, 720, 1080])
def test_letters_have_11_pixels_or_are_left_out_and_nothing_overlaps(size, is_band):
    caption = Caption(
        ["t = −14.12 R/c", "−0.78 v"], "greatest compression", "e = 0.9672"
    )
    title = (
        "Impact on an elastic wall",
        "v = 0.1 c    η* = 0    a = 300/R",
        "N = 1,099    seed 0    reset every 0.003 R/c",
    )
    letters = Letters(size)
    block = legend(letters, size, title, [], [caption], is_band)
    boxes = block.boxes
    header = block.header
    below = letters.footer
    if size < 240:
        assert not boxes
        assert not header
        assert not below
        return
    assert len(boxes) > 6
    for k, (left, right, top, bottom) in enumerate(boxes):
        assert left >= 0.0
        assert right <= size
        assert top >= 0.0
        assert bottom <= size - below
        for other in boxes[k + 1 :]:
            is_beside = right <= other[0] or other[1] <= left
            assert is_beside or bottom <= other[2] + 3.0 or other[3] <= top + 3.0
    assert letters.small.size >= LEAST
    room = size - header - below
    assert room > 0.4 * size  # the disk is still visible


@pytest.mark.parametrize("is_elastic", [True, False])
def test_words_stand_above_an_elastic_wall_however_large_they_are(is_elastic):
    above = painter()
    if is_elastic:
        ends = np.array([0, 1], dtype=np.int32)
        above.lattice = replace(above.lattice, wall_surface=ends)
    letters = Letters(720, 1.5)
    title = ("Impact", "v = 0.1 c    η* = 0    a = 300/R    N = 1,099    seed 0")
    disk = Disk(above, title, [Caption(["t = 1.00 R/c"])], [above.lattice.positions])
    camera, (block,) = arranged([disk], 720, letters, (-3.0, 3.0, -4.0, 2.4))
    _, wall = camera.to_pixels((0.0, 0.0))
    _, _, _, bottoms = np.array(block.boxes).T
    assert (bottoms.max() < wall) == is_elastic


def test_words_of_a_hall_are_larger_by_the_user_s_factor():
    assert Letters(720, 1.5).small.size == 1.5 * Letters(720).small.size
    assert Letters(720, 1.5).footer > Letters(720).footer


@pytest.mark.parametrize("colour", ["pressure", "shear"])
@pytest.mark.parametrize("factor", [1.0, 1.5])
@pytest.mark.parametrize("size", [240, 360, 720])
def test_words_of_the_scales_do_not_overlap(size, factor, colour):
    letters = Letters(size, factor)
    arrows = painter(colour=colour, limit=0.015)
    pace = ("1 s = 5.3 R/c", "slow motion")
    below = Scales(arrows, size, letters, 80.0 * size / 720, {pace, pace[:1]})
    drawn = [*below.lines, *below.pace_lines(pace)]
    texts = [line.text for line in drawn]
    assert "1 s = 5.3 R/c" in texts
    assert "≥ 1.5" in texts or "≥ +1.5" in texts
    is_large = size == 720 and factor == 1.0
    assert not is_large or {"slow motion", "force on a point"} < set(texts)
    assert ("stretched" in texts) == (colour == "pressure")
    for k, line in enumerate(drawn):
        left, right, _, _ = line.box
        assert left >= 0.0
        assert right <= size
        for other in drawn[k + 1 :]:
            first, last, _, _ = other.box
            is_apart = right <= first or last <= left
            assert other.baseline != line.baseline or is_apart, (line, other)


@pytest.mark.parametrize("colour", ["pressure", "shear"])
def test_the_colour_bar_shows_the_map(colour):
    coloured_painter = painter(colour=colour, theme="dark")
    bar = np.rint(255 * coloured_painter.colours(np.linspace(0.0, 1.0, 245))).astype(
        np.uint8
    )
    _, below = still(coloured_painter)
    assert any(np.array_equal(row[237:482], bar) for row in below)
