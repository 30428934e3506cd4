"""Shapes of pictures: where the wall's edge is drawn."""

from __future__ import annotations

import pytest

from taichi_disk.physics import ExponentialWall
from taichi_disk.render.geometry import edge_height


def test_the_edge_is_drawn_where_the_wall_pushes_a_point_with_the_given_force():
    # f = a V0 exp(-a y), so y = ln(a V0/f)/a
    wall = ExponentialWall(300.0, 150.0)
    height = edge_height(wall, 1e-3)
    assert 300.0 * 150.0 * 2.718281828459045 ** (-300.0 * height) == pytest.approx(1e-3)


def test_the_edge_is_never_drawn_below_the_wall_s_surface():
    # A soft wall needs points below its surface for this force.
    soft = ExponentialWall(1.0, 1e-3)
    assert soft.height_of_force(1.0) < 0.0
    assert edge_height(soft, 1.0) == 0.0
    assert edge_height(soft, 0.0) == 0.0
    assert edge_height(None, 1.0) == 0.0
