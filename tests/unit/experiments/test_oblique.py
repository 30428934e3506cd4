"""Results along the wall: lowest point, arm of the impulse, and scale of errors."""

from math import pi

import numpy as np
import pytest

from taichi_disk.experiments.scenes import oblique

# half-width and half-height of a flat plate [R], at rest in its frame
OUTLINE = np.array([[-1.0, -0.2], [1.0, -0.2], [1.0, 0.2], [-1.0, 0.2]])
INERTIA = 0.25


def columns(vx, vy, spin):
    """Return nine rows with contact from t = 3 to 5, where all changes linearly; `vx`,
    `vy` [c], `spin` [c/R]: before and after."""
    t = np.arange(9.0)
    part = np.clip((t - 3.0) / 2.0, 0.0, 1.0)

    def changing(before, after):
        return before + (after - before) * part

    return {
        "t": t,
        "com_vx": changing(*vx),
        "com_vy": changing(*vy),
        "com_y": np.full(9, 0.2),
        "lowest_y": np.zeros(9),
        "angular_momentum": INERTIA * changing(*spin),
        "wall_force": np.where((t >= 3.0) & (t <= 5.0), 1.0, 0.0),
        "dissipated": np.zeros(9),
        "absorbed": np.zeros(9),
    }


def test_the_lowest_point_of_a_flat_plate_is_its_half_height_below_the_centre():
    series = columns((0.5, 0.1), (-1.0, 0.9), (0.0, 2.0))
    found = oblique.along_the_wall(series, OUTLINE, INERTIA)
    # the corners, 1.02 R away, would give -(0.1 + 2.0 1.02)/0.5
    assert found["tangential_restitution"] == pytest.approx(-(0.1 + 2.0 * 0.2) / 0.5)
    assert found["spin_after"] == pytest.approx(2.0)
    assert found["tangential_impulse"] == pytest.approx(-0.4)
    assert found["normal_impulse"] == pytest.approx(1.9)


def test_a_plate_that_turns_in_flight_meets_the_wall_with_another_height():
    # A quarter of a turn in three units of time: the plate stands upright.
    spin = 0.5 * pi / 3.0
    series = columns((0.5, 0.5), (-1.0, 0.9), (spin, spin))
    found = oblique.along_the_wall(series, OUTLINE, INERTIA)
    assert found["tangential_restitution"] == pytest.approx(-1.0)
    scales = oblique.scales_along_the_wall(series, OUTLINE, INERTIA)
    assert scales["spin_after"] == pytest.approx(10.0 * 1.0 / INERTIA, rel=0.02)


def test_the_tangential_restitution_is_left_out_if_the_lowest_point_hardly_moves():
    for along, is_given in ((0.02, True), (0.005, False), (-0.005, False)):
        series = columns((along, 0.0), (-1.0, 0.9), (0.0, 0.0))
        found = oblique.along_the_wall(series, OUTLINE, INERTIA)
        assert ("tangential_restitution" in found) is is_given


def test_scales_are_momenta_of_the_flight_whatever_its_direction():
    series = columns((0.5, 0.1), (-2.0, 1.8), (0.0, 2.0))
    scales = oblique.scales_along_the_wall(series, OUTLINE, INERTIA)
    assert scales == {
        "normal_impulse": pytest.approx(2.0),
        "tangential_impulse": pytest.approx(20.0),
        "spin_after": pytest.approx(20.0 * 0.2 / INERTIA),
        "tangential_restitution": pytest.approx(20.0 * (1.0 + 0.2**2 / INERTIA) / 0.5),
    }
