"""Colour scales: what a picture's largest colour stands for."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.render.palette import full_scale, round_near


def test_two_per_cent_of_the_values_lie_beyond_the_colour_scale():
    # 1, 2, …, 1000 in units of 1e-5: the 98th percentile is 980e-5, which rounds to
    # 0.01; the 90th would round to 0.009 or 0.008.
    values = 1e-5 * np.arange(1, 1001)
    signs = np.where(np.arange(1000) % 2, 1.0, -1.0)
    assert full_scale(values * signs, "pressure") == pytest.approx(0.01)
    # A few outliers do not change the scale, but a twentieth of the values does.
    outliers = np.append(np.full(990, 0.01), np.full(10, 1.0))
    assert full_scale(outliers, "pressure") == pytest.approx(0.01)
    twentieth = np.append(np.full(950, 0.01), np.full(50, 1.0))
    assert full_scale(twentieth, "pressure") == pytest.approx(1.0)


@pytest.mark.parametrize("value", [3e-7, 1.24e-3, 0.044, 1.76, 98.0])
def test_a_rounded_scale_is_within_a_quarter_of_the_value(value):
    assert 1 / 1.25 <= round_near(value) / value <= 1.25
