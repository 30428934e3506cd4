"""Several bounces of one disk under gravity."""

import numpy as np
import pytest

from taichi_disk import load_scene, run
from taichi_disk.experiments.computation.contact import flights
from taichi_disk.base.errors import InputError

DISK = {"points": 60, "velocity": 0.05, "eta_star": 0.0}
GRAVITY = 2e-3


@pytest.fixture(scope="module")
def bounced():
    scene = load_scene("exponential_wall").with_(DISK)
    return run(scene.with_(gravity=GRAVITY, bounces=4), lattices=1)


def test_flights_are_parabolas(bounced) -> None:
    columns = bounced.series
    top = flights(columns)[1]
    rows = slice(top - 200, top + 200)
    t = columns["t"][rows] - columns["t"][top]
    y = columns["com_y"][top] + columns["com_vy"][top] * t - 0.5 * GRAVITY * t**2
    np.testing.assert_allclose(columns["com_y"][rows], y, rtol=0.0, atol=1e-13)


def test_energy_with_that_of_the_height_is_conserved(bounced) -> None:
    total = bounced.series["total"]
    assert np.ptp(total) < 1e-4 * bounced.series["kinetic"][0]


def test_restitution_is_that_of_heights(bounced) -> None:
    columns = bounced.series
    heights = columns["com_y"][flights(columns)] - columns["com_y"][0]
    e = [bounced.numbers[f"restitution_{k}"] for k in (2, 3)]
    np.testing.assert_allclose(e, np.sqrt(heights[2:4] / heights[1:3]), rtol=1e-4)


def test_weak_gravity_changes_nothing() -> None:
    scene = load_scene("exponential_wall").with_(DISK)
    plain = run(scene, lattices=1)
    weak = run(scene, gravity=1e-6, lattices=1)
    assert abs(weak.restitution - plain.restitution) < plain.error + weak.error


def test_several_bounces_need_gravity() -> None:
    with pytest.raises(InputError, match="write impact.gravity, too"):
        load_scene("exponential_wall", "impact.bounces=2")
