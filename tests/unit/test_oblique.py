"""Results along the wall: the lowest point, the arm of the wall's impulse, and the
scale of errors."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

from taichi_disk import Lattice, load_scene, run
from taichi_disk.scenes import oblique

# half-width and half-height of a flat plate [R], at rest in its frame
OUTLINE = np.array([[-1.0, -0.2], [1.0, -0.2], [1.0, 0.2], [-1.0, 0.2]])
INERTIA = 0.25


def columns(vx, vy, spin, height=0.2):
    """Return a series of nine rows: contact from t = 3 to t = 5, linear changes there.

    `vx`, `vy` [c] and `spin` [c/R]: before and after.
    """
    t = np.arange(9.0)
    part = np.clip((t - 3.0) / 2.0, 0.0, 1.0)

    def changing(before, after):
        return before + (after - before) * part

    return {
        "t": t,
        "com_vx": changing(*vx),
        "com_vy": changing(*vy),
        "com_y": np.full(9, height),
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


@pytest.mark.usefixtures("kernels")
def test_a_flat_plate_that_sticks_comes_to_rest_along_the_wall():
    # Three rows of a triangular lattice. A rigid body that sticks has J_t =
    # -v_t/(1/M + h^2/I), with h the height of its centre above the wall.
    spacing = 1.0 / 6.0
    half = 0.5 * np.sqrt(3.0) * spacing * 1.2
    ends = spacing * np.arange(-6, 7)
    middle = ends[:-1] + 0.5 * spacing
    rows = [(x, y) for y in (-half, half) for x in ends]
    points = np.array(rows + [(x, 0.0) for x in middle])
    distance = np.hypot(*(points[:, None] - points).T)
    plate = Lattice.from_points(points, np.argwhere(np.triu(distance < 0.25, 1)))
    scene = load_scene("exponential_wall").with_(
        {
            "wall.friction": 3.0,
            "wall.a": 1000.0,
            "wall.V0": 500.0,
            "material.eta_star": 0.0,
            "impact.velocity": 0.002,
            "impact.angle": 0.5,
        }
    )
    result = run(scene, lattice=plate, lattices=1)
    found = result.numbers
    along = 0.002 * np.sin(0.5)
    rigid = -along / (1.0 + half**2 / result.lattice.inertia)
    assert found["tangential_impulse"] == pytest.approx(rigid, rel=0.15)
    assert found["tangential_restitution"] == pytest.approx(0.0, abs=0.06)
