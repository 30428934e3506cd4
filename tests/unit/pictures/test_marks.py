"""Arrows, dots and lines: as long and as wide as asked for, with smooth edges."""

import numpy as np
import pytest
from PIL import Image

from taichi_disk.pictures.render.marks import Mark, arrows, dot, line, stamp

BLACK = (0, 0, 0)
WHITE = (255, 255, 255)
GREY = (128, 128, 128)


def stamped(corners, rim=0.0, columns=slice(0, 100)):
    """Return the brightness (100, 100) of grey with a black mark in a white rim."""
    image = Image.new("RGB", (100, 100), GREY)
    stamp(image, Mark(corners, BLACK, rim), WHITE, columns)
    return np.asarray(image)[..., 0].astype(float)


def test_the_head_of_a_short_arrow_is_in_proportion_and_never_longer_than_the_arrow():
    length = np.array([35.0, 10.0, 0.7])
    vectors = np.stack([np.zeros(3), -length], axis=1)
    corners = arrows(np.zeros((3, 2)), vectors, 2.0, 6.0)
    half = np.ptp(corners[..., 0], axis=1) / 2.0
    tip = corners[:, 3]
    depth = corners[:, 2, 1] - tip[:, 1]
    assert tip == pytest.approx(vectors)
    assert half == pytest.approx([6.0, *(0.65 / 1.56 * length[1:])])
    assert depth == pytest.approx(1.56 * half)
    assert (depth < length).all()


@pytest.mark.parametrize("angle", [0.0, 0.4, 2.0, 4.0])
def test_a_mark_covers_its_area_with_ink_and_the_rim_lies_around_it(angle):
    along = 40.0 * np.array([np.cos(angle), np.sin(angle)])
    centre = np.array([50.3, 49.8])
    bar = line(centre - along, centre + along, 3.0)
    ink = (128.0 - stamped(bar)).sum() / 128.0
    assert ink == pytest.approx(80.0 * 6.0, rel=0.05)
    rim = (stamped(bar, rim=2.0) - stamped(bar)).clip(0.0).sum() / 127.0
    assert rim == pytest.approx(84.0 * 10.0 - 80.0 * 6.0, rel=0.1)


def test_a_dot_is_where_it_is_asked_for_to_a_part_of_a_pixel():
    for centre in ([50.0, 40.0], [50.25, 40.5]):
        weight = 128.0 - stamped(dot(np.array(centre), 9.0))
        rows, columns = np.mgrid[:100, :100] + 0.5
        middle = [(weight * each).sum() / weight.sum() for each in (columns, rows)]
        assert middle == pytest.approx(centre, abs=0.05)
        assert weight.sum() / 128.0 == pytest.approx(np.pi * 81.0, rel=0.04)
        assert len(np.unique(weight)) > 5  # smooth edges


def test_a_mark_at_the_side_of_a_picture_is_cut():
    assert stamped(dot(np.array([0.0, 50.0]), 9.0))[50, 0] == 0.0
    # Beside the picture of a disk are another disk, or curves.
    whole = stamped(dot(np.array([30.0, 50.0]), 9.0), rim=2.0)
    for columns in (slice(0, 25), slice(25, 40), slice(50, 100)):
        part = stamped(dot(np.array([30.0, 50.0]), 9.0), 2.0, columns)
        assert (part[:, columns] == whole[:, columns]).all()
        assert (np.delete(part, columns, axis=1) == GREY[0]).all()
