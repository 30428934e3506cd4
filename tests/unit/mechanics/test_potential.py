"""Heights, forces and stiffness of a wall agree with its potential."""

import numpy as np
import pytest

from taichi_disk.experiments.config.sections import ElasticWallSection, WallSection
from taichi_disk.mechanics.physics import BodyForce, ElasticWall, ExponentialWall, Wall

NUMBERS = {"a": 30.0, "V0": 5.0}
RIGID = ExponentialWall(**NUMBERS)
ELASTIC = ElasticWall(**NUMBERS, threshold=0.1)
WALLS = (RIGID, ELASTIC, WallSection(**NUMBERS), ElasticWallSection(**NUMBERS))
ABOVE = np.array([0.0, 0.01, 0.07])  # heights of three points over the lowest


@pytest.mark.parametrize("wall", WALLS, ids=lambda wall: type(wall).__name__)
def test_at_the_height_of_an_energy_or_a_force_the_wall_has_it(wall):
    # 20 is more than the potential at distance 0, so the height is negative
    for value in (1e-10, 1.0, 20.0):
        assert wall.potential(wall.height_of(value)) == pytest.approx(value)
        assert wall.force_at(wall.height_of_force(value)) == pytest.approx(value)
        assert wall.potential(
            wall.height_of(value, ABOVE) + ABOVE
        ).sum() == pytest.approx(value)
        assert wall.force_at(
            wall.height_of_force(value, ABOVE) + ABOVE
        ).sum() == pytest.approx(value)


def test_the_force_is_the_slope_of_the_potential_and_the_stiffness_that_of_the_force():
    wall = RIGID
    y = 0.05
    step = 1e-6
    slope = (wall.potential(y - step) - wall.potential(y + step)) / (2.0 * step)
    assert wall.force_at(y) == pytest.approx(slope, rel=1e-8)
    assert wall.potential(y + wall.decay_length) == pytest.approx(
        wall.potential(y) / np.e
    )
    slope = (wall.force_at(y - step) - wall.force_at(y + step)) / (2.0 * step)
    assert wall.added_stiffness(wall.force_at(y)) == pytest.approx(slope, rel=1e-8)
    # two points that approach each other, instead of one and a fixed wall
    assert ELASTIC.added_stiffness(3.0) == 2.0 * wall.added_stiffness(3.0)


def test_a_wall_without_force_is_out_of_reach():
    assert RIGID.force_at(RIGID.reach) == pytest.approx(np.exp(-45.0))
    assert ExponentialWall(1.0, 1e-30).reach == 0.0


def test_a_wall_without_a_method_that_it_must_have_is_refused_with_its_name():
    class Incomplete(Wall, BodyForce):
        decay_length = 0.02
        contact_forces = None

    missing = r"methods? '?added_stiffness'?(,| and) '?height_of_force"
    with pytest.raises(TypeError, match=missing):
        Incomplete()
