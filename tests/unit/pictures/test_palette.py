"""Colours: even maps for the colour-blind too, and scales that end at round numbers."""

import numpy as np
import pytest

from taichi_disk.pictures.render.palette import (
    LEVELS,
    THEMES,
    colour_map,
    full_scale,
    round_near,
)

# Viénot, Brettel and Mollon 1999: linear RGB seen without long or medium cones
DICHROMATS = {
    "protan": np.array(
        [[0.11238, 0.88762, 0.0], [0.11238, 0.88762, 0.0], [0.00401, -0.00401, 1.0]]
    ),
    "deutan": np.array(
        [[0.29275, 0.70725, 0.0], [0.29275, 0.70725, 0.0], [-0.02234, 0.02234, 1.0]]
    ),
}


def linear(rgb):
    return np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)


def lightness(rgb):
    """Return CIE L* of sRGB colours, from the luminance weights of the standard."""
    luminance = linear(np.array(rgb, dtype=float)) @ [0.2126, 0.7152, 0.0722]
    return 116 * np.cbrt(luminance) - 16


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("kind", ["pressure", "stretch", "amount", "fringes"])
@pytest.mark.parametrize("bare", [False, True])
def test_maps_are_even_in_lightness(theme, kind, bare):
    light = lightness(colour_map(theme, kind, bare))
    for half in np.split(light, 2) if kind in ("pressure", "stretch") else [light]:
        assert np.abs(half - np.linspace(half[0], half[-1], len(half))).max() < 2.5
        assert abs(half[-1] - half[0]) > 40


@pytest.mark.parametrize("theme", THEMES)
@pytest.mark.parametrize("eyes", DICHROMATS)
def test_the_colour_blind_tell_compression_from_stretching(theme, eyes):
    seen = linear(colour_map(theme, "pressure")) @ DICHROMATS[eyes].T
    low = seen[: LEVELS // 8].mean(axis=0)
    high = seen[-LEVELS // 8 :].mean(axis=0)
    # They tell yellow from blue, so the fractions of blue must differ.
    assert high[2] / high.sum() - low[2] / low.sum() > 0.25


@pytest.mark.parametrize("theme", THEMES)
def test_compression_is_blue_and_what_rests_stands_out_from_the_ground(theme):
    for kind, place in (("pressure", -1), ("stretch", 0)):
        red, _, blue = colour_map(theme, kind)[place]
        assert blue > red + 0.2
    for kind, place in (("pressure", LEVELS // 2), ("amount", 0)):
        resting = lightness(colour_map(theme, kind, bare=True)[place])
        assert abs(resting - lightness(np.array(THEMES[theme].ground))) > 14


@pytest.mark.parametrize(
    "value", [0.0123, 0.0577, 9.2, 2.3e-5, 0.14, 1e-12, 0.3, 999.9999999999999]
)
def test_scales_end_at_round_numbers(value):
    limit = round_near(value)
    assert 1 / 1.25 < limit / value < 1.25
    digits = f"{limit:.6e}".split("e")[0].rstrip("0").rstrip(".")
    assert digits in ("1", "1.5", "2", "3", "4", "5", "6", "8")


def test_the_round_number_next_to_a_value_is_the_one_nearest_in_ratio():
    # 8.97 is nearer to 8 by difference but nearer to 10 by ratio; likewise 2.46 is
    # nearer to 2, but to 3 by ratio.
    assert round_near(0.0897) == 0.1
    assert round_near(0.0246) == 0.03
    assert round_near(0.0892) == 0.08
    assert round_near(0.0244) == 0.02


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
    assert full_scale(np.linspace(0.0, 0.1, 1000), "fringes") == pytest.approx(0.02)
