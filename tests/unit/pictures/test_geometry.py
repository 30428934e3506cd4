"""Shapes of pictures: the camera, the wall's edge, magnified displacements."""

import numpy as np
import pytest

from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.physics import ExponentialWall
from taichi_disk.pictures.render.geometry import (
    edge_height,
    flattening,
    magnification,
    placed,
)

DISK = Lattice.disk(60, 0)


def test_the_edge_is_drawn_where_the_wall_pushes_with_a_force_or_at_its_surface():
    # f = a V0 exp(-a y), so y = ln(a V0/f)/a
    wall = ExponentialWall(300.0, 150.0)
    height = edge_height(wall, 1e-3)
    assert 300.0 * 150.0 * np.exp(-300.0 * height) == pytest.approx(1e-3)
    # A soft wall needs points below its surface for this force.
    soft = ExponentialWall(1.0, 1e-3)
    assert soft.height_of_force(1.0) < 0.0
    assert edge_height(soft, 1.0) == edge_height(soft, 0.0) == 0.0


def test_a_rigid_motion_stays_where_it_is_and_a_strain_is_magnified():
    rest = DISK.positions + [0.0, 1.05]
    rest_at = rest.mean(axis=0)
    cos = np.cos(0.7)
    sin = np.sin(0.7)
    flown = (rest - rest_at) @ np.array([[cos, sin], [-sin, cos]]) + [3.0, 1.5]
    assert placed(DISK, flown, 20.0) == pytest.approx(flown, abs=1e-12)
    # A disk that has shrunk uniformly: the lowest point stays, and all other
    # displacements are 20 times as large.
    lowest = np.array([rest_at[0], rest[:, 1].min()])
    x = rest - 0.003 * (rest - lowest)
    larger = placed(DISK, x, 20.0)
    assert larger == pytest.approx(rest - 0.06 * (rest - lowest), abs=1e-12)
    assert (placed(DISK, x, 1.0) == x).all()


def test_no_magnified_point_is_drawn_below_the_edge_of_a_wall_or_the_lowest_point():
    x = DISK.positions * [1.03, 0.94] + [0.0, 1.0]
    x = np.maximum(x, [-9.0, 0.08])  # flat below
    assert placed(DISK, x, 20.0)[:, 1].min() < 0.0
    for edge in (0.05, 0.2):
        drawn = placed(DISK, x, 20.0, edge)
        assert drawn[:, 1].min() == min(edge, x[:, 1].min())
        assert (
            drawn == np.maximum(placed(DISK, x, 20.0), [-9.0, min(edge, 0.08)])
        ).all()


def test_a_ringing_is_drawn_larger_around_the_centre_of_the_disk():
    rest = DISK.positions + [0.0, 1.5]
    wave = 0.01 * np.sin(3.0 * rest[:, ::-1])
    wave -= wave.mean(axis=0)
    drawn = placed(DISK, rest + wave, 2.0, ringing=4.0)
    at_rest = placed(DISK, rest, 2.0)
    # a part of the wave is a turn of the whole disk, which is not drawn larger
    arms = rest - rest.mean(axis=0)
    turn = (arms[:, ::-1] * [-1.0, 1.0] * wave).sum() / (arms**2).sum()
    strain = wave - turn * arms[:, ::-1] * [-1.0, 1.0]
    moved = drawn - at_rest - (drawn - at_rest).mean(axis=0)
    assert moved == pytest.approx(8.0 * strain, abs=0.01)
    assert np.abs(8.0 * strain).max() > 0.05
    centre = placed(DISK, rest + wave, 2.0).mean(axis=0)
    assert drawn.mean(axis=0) == pytest.approx(centre, abs=1e-12)


def test_a_film_magnifies_the_flattening_to_about_a_twentieth_of_r_if_not_told():
    assert magnification("auto", 0.0101) == 5.0
    assert magnification("auto", 0.07) == 1.0  # never smaller
    assert magnification("auto", 1e-9) == 20.0
    assert magnification(3, 0.0101) == 3.0


@pytest.mark.parametrize(
    ("longer", "shorter", "expected"),
    [(0.0, 0.01, 0.01), (0.004, 0.006, 0.01), (0.08, -0.05, 1.0), (-0.01, 0.02, 0.02)],
)
def test_the_flattening_counts_from_the_flight_unless_a_spin_stretches_more(
    longer, shorter, expected
):
    # `longer`, `shorter` [R]: from the centre to the lowest point, than in the unloaded
    # disk, in flight and at the greatest compression
    flying = DISK.positions * [1.0, 1.0 + longer]
    pressed = DISK.positions * [1.0, 1.0 - shorter] + [0.3, 1.0]
    assert flattening(DISK, pressed, flying) == pytest.approx(expected, rel=0.05)
