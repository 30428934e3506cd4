"""A scene gives the same bits: repeated, after other scenes, and replayed."""

import numpy as np
import pytest
from bodies import computed
from numpy.testing import assert_array_equal

IMPACT = ("exponential_wall", "lattice.points=60", "material.eta_star=0")
SCENES = [
    IMPACT,
    ("compression", "lattice.points=40", "compression.tolerance=1e-3"),
    ("absorbing_wall", "lattice.points=40", "wall.points=60", "wall.width=3.0"),
]


def test_scenes_give_the_same_bits_again_in_any_order(kernels):
    first = [computed(kernels, *scene)[1] for scene in SCENES]
    for scene, result in zip(SCENES[::-1], first[::-1], strict=True):
        _, other = computed(kernels, *scene)
        assert_array_equal(result.positions, other.positions)
        assert_array_equal(result.velocities, other.velocities)
        assert result.summary == other.summary
        for name, column in result.series.items():
            assert_array_equal(column, other.series[name], err_msg=name)


def test_replayed_moments_are_those_of_the_run_whatever_kernels_do_meanwhile(kernels):
    _, outcome = computed(kernels, *IMPACT)
    columns = outcome.series
    rows = np.array([0, 3, 3, len(columns["t"]) // 2, len(columns["t"]) - 1])
    # `replay` uses the nearest steps
    times = columns["t"][rows] - 0.4 * outcome.summary["dt"]
    for row, (t, x, v) in zip(rows, outcome.replay(times), strict=True):
        computed(kernels, *IMPACT, "lattice.points=50")  # with the same kernels
        assert t == pytest.approx(columns["t"][row], rel=1e-12)
        assert x[:, 1].min() == pytest.approx(columns["lowest_y"][row], rel=1e-14)
        assert v[:, 1].mean() == pytest.approx(columns["com_vy"][row], rel=1e-12)
    assert_array_equal(x, outcome.positions)
    assert_array_equal(v, outcome.velocities)
