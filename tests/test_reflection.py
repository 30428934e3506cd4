"""The absorbing wall's dashpots against plane waves: they send back what one-dimensional wave theory says."""

from __future__ import annotations

import pytest

from taichi_disk.study.reflection import reflect

LONG = pytest.mark.validate


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize("wave", ["p", pytest.param("s", marks=LONG)])
def test_matched_dashpots_send_back_less_than_5_percent_of_the_energy(wave):
    found = reflect(wave, 0.35, 0)
    assert found.energy < 0.05
    assert abs(found.amplitude) < 0.03


@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize(
    ("wave", "impedance"),
    [("s", 0.5), *(pytest.param(wave, z, marks=LONG) for wave in "ps" for z in (0.0, 1.5, 3.0, 1e6))],
)
def test_mismatched_dashpots_send_back_the_amplitude_of_theory(wave, impedance):
    # A dashpot q rho c at the end of a rod: (1 - q)/(1 + q) of the velocity; free end +1, fixed end -1.
    found = reflect(wave, 0.5, 1, impedance=impedance)
    theory = (1 - impedance) / (1 + impedance)
    assert found.amplitude == pytest.approx(theory, abs=0.04)
    assert found.energy == pytest.approx(theory**2, abs=0.03)


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
@pytest.mark.parametrize("wave", ["p", "s"])
def test_what_comes_back_falls_as_the_wave_grows_longer(wave):
    short, middle, long = (sum(reflect(wave, sigma, seed).energy for seed in range(4)) for sigma in (0.2, 0.35, 0.7))
    assert short > middle > long and long < 0.02 * 4
