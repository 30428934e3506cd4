"""Words and scales of pictures: large enough, whole, and apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from bodies import RIGID
from PIL import Image, ImageDraw

from taichi_disk.lattice import disk_lattice
from taichi_disk.physics import Springs
from taichi_disk.render.moments import Caption
from taichi_disk.render.painter import Painter
from taichi_disk.render.pictures import Disk, arranged
from taichi_disk.render.words import (
    LEAST,
    Letters,
    Scales,
    label,
    legend,
    round_below,
)

DISK = disk_lattice(60, 0)


def painter(**attributes):
    made = Painter(
        replace(DISK, positions=DISK.positions + [0.0, 1.05]), Springs(), RIGID
    )
    vars(made).update(
        {"colour": "pressure", "limit": 0.02, "full_force": 0.01, "edge": 0.03}
        | attributes
    )
    return made


def test_numbers_are_written_as_in_print():
    assert label(-5.0, signed=True) == "−5"
    assert label(2e-7) == "2·10⁻⁷"
    assert label(0.0) == "0"
    assert label(0.5, signed=True) == "+0.5"


@pytest.mark.parametrize("value", [0.0123, 9.2, 2.3e-5, 1e-12, 999.9999999999999])
def test_the_arrow_of_the_scale_stands_for_a_round_force(value):
    below = round_below(value)
    assert value / 2.5 < below <= value
    assert f"{below:.6e}"[:8] in ("1.000000", "2.000000", "5.000000")


def still(painter, size=720):
    """Return the constant words of a picture, and its scales."""
    letters = Letters(size)
    block = legend(
        letters, size, ("A", "B"), painter.remarks, [Caption(0.0, lines=("t",))]
    )
    image = Image.new("RGBA", (size, size), "white")
    for line in block.lines:
        line.draw(ImageDraw.Draw(image), 0.0, 0.0)
    below = np.zeros((letters.footer, size, 4), np.uint8)
    picture = Image.fromarray(below)
    draw = ImageDraw.Draw(picture)
    Scales(painter, size, letters, 250.0 * size / 720).draw(below, picture, draw)
    return np.asarray(image), below[..., :3]


# ---- text


@pytest.mark.parametrize("is_band", [False, True])
@pytest.mark.parametrize("size", [64, 200, 240, 360, 720, 1080])
def test_letters_have_11_pixels_or_are_left_out_and_nothing_overlaps(size, is_band):
    caption = Caption(
        t=-14.12,
        lines=("t = −14.12 R/c", "−0.78 v"),
        note="greatest compression",
        result="e = 0.9672",
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
    disk = Disk(
        above, title, [Caption(1.0, lines=("t = 1.00 R/c",))], [above.lattice.positions]
    )
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
