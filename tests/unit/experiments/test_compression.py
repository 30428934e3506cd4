"""The compression at rest: the rest of the last slow roll is extrapolated."""

import numpy as np
import pytest

from taichi_disk import load_scene


def test_the_rest_of_a_roll_is_extrapolated_from_the_whole_settling_time():
    scene = load_scene("compression").with_(
        {"lattice.points": 30, "compression.method": "relaxation"}
    )
    scenario = scene.scenario()
    t = np.arange(0.0, 101.0)
    assert scenario.quiet_time == 20.0
    # Faster at first: only the last 20 R/c count, and all of them.
    spin = np.exp(-t / 50.0) + np.exp(-(t - 60.0) / 10.0)
    distance = 0.98 + 1e-3 * spin
    columns = {
        "t": t,
        "angular_momentum": spin,
        "com_y": distance,
        "lowest_y": np.zeros(101),
    }
    ratio = spin[100] / spin[80]
    remaining = (distance[100] - distance[80]) * ratio / (1.0 - ratio)
    found = scenario.result(columns)
    # distance - 0.98 is proportional to the spin, so all of it is still to come
    assert remaining == pytest.approx(-1e-3 * spin[100])
    assert found["xi_extrapolated"] == pytest.approx(1e-3 * spin[100])
    _, y = scenario.lattice.positions.T  # of the disk before it is pressed
    assert found["xi"] == pytest.approx(y.mean() - y.min() - 0.98, abs=1e-9)
    assert found["xi_nominal"] == pytest.approx(0.02, abs=1e-9)
    # a roll that is not proportional to the spin
    found = scenario.result(columns | {"com_y": 0.98 + 1e-3 * spin**2})
    squares = spin**2
    change = 1e-3 * (squares[100] - squares[80])
    assert found["xi_extrapolated"] == pytest.approx(
        abs(change) * ratio / (1.0 - ratio)
    )
    # a roll that grows has no end to extrapolate to
    grows = columns | {"angular_momentum": spin**-0.5}
    assert scenario.result(grows)["xi_extrapolated"] == 0.0


def test_times_of_a_soft_disk_grow_with_the_time_in_which_a_wave_crosses_it():
    keys = {"lattice.points": 30, "compression.method": "relaxation"}
    hard = load_scene("compression").with_(keys).scenario()
    soft = load_scene("compression").with_(keys, material={"k_a": 1 / 16}).scenario()
    for name in "max_time", "sample_interval", "quiet_time":
        assert getattr(soft, name) == pytest.approx(4.0 * getattr(hard, name))
