"""Moduli by the stretch test: exact for a perfect lattice, in the known range for random ones."""

from __future__ import annotations

import math

import numpy as np
import pytest

from taichi_disk.errors import InputError
from taichi_disk.moduli import Moduli, bulk_moduli, perfect_stretch_test, stretch_test


def test_perfect_triangular_lattice_has_the_textbook_moduli():
    # Equal springs k on a triangular lattice: E = 2/sqrt(3) k, nu = 1/3.
    for k_a in (1.0, 0.3):
        bulk = perfect_stretch_test(16, 16, k_a).bulk
        assert bulk.young == pytest.approx(2 / math.sqrt(3) * k_a, rel=1e-9)
        assert bulk.poisson == pytest.approx(1 / 3, rel=1e-9)


def test_perfect_lattice_looks_stiffer_by_its_edges_alone():
    # The pull on the grips counts the bonds along both free edges whole, though half of each lies outside:
    # k d too much over a width of (rows - 1) sqrt(3)/2 d.
    rows = 24
    test = perfect_stretch_test(60, rows, 1.0)
    excess = test.apparent.young - test.bulk.young
    assert excess == pytest.approx(1 / ((rows - 1) * math.sqrt(0.75)), rel=0.2)


@pytest.mark.parametrize(("min_spacing", "young", "poisson"), [(0.0, 1.04, 0.26), (0.7, 1.10, 0.286)])
def test_random_lattice_has_moduli_in_the_known_range(min_spacing, young, poisson):
    samples = [bulk_moduli(1099, seed, 1.0, min_spacing) for seed in range(8)]
    assert np.mean([m.young for m in samples]) == pytest.approx(young, abs=0.03)
    assert np.mean([m.poisson for m in samples]) == pytest.approx(poisson, abs=0.01)
    # One sample of 1000 points scatters by a few per cent.
    assert np.std([m.young for m in samples]) < 0.06


def test_grips_do_not_change_what_the_inside_tells():
    free, held = (stretch_test(1099, 0, 1.0, 0.7, 3.0, 1.0, clamped=c).bulk for c in (False, True))
    assert held.young == pytest.approx(free.young, rel=0.01)
    assert held.poisson == pytest.approx(free.poisson, rel=0.03)


def test_short_wide_clamped_strip_shows_the_papers_poisson_ratio():
    tests = [stretch_test(1099, seed, 1.0, 0.7, 1.0, 4.0, clamped=True) for seed in range(4)]
    assert np.mean([t.apparent.poisson for t in tests]) == pytest.approx(0.075, abs=0.035)
    assert np.mean([t.bulk.poisson for t in tests]) == pytest.approx(0.286, abs=0.015)


def test_moduli_scale_with_the_springs_and_not_with_the_number_of_points():
    assert bulk_moduli(1099, 0, 2.5, 0.7).young == pytest.approx(2.5 * bulk_moduli(1099, 0, 1.0, 0.7).young)
    few, many = (np.mean([bulk_moduli(n, s, 1.0, 0.7).young for s in range(4)]) for n in (300, 1000))
    assert few == pytest.approx(many, rel=0.05)


@pytest.mark.validate
def test_moduli_of_large_disks_scatter_less_about_the_same_mean():
    few, many = (np.array([bulk_moduli(n, s, 1.0, 0.7).young for s in range(8)]) for n in (1100, 17_600))
    assert many.std() < 0.5 * few.std()
    assert few.mean() == pytest.approx(many.mean(), abs=3 * few.std() / np.sqrt(8))
    assert bulk_moduli(1_000_000, 0, 1.0, 0.7) == bulk_moduli(20_000, 0, 1.0, 0.7)


def test_small_disks_have_moduli_too():
    assert bulk_moduli(3, 0, 1.0, 0.7).young == pytest.approx(1.1, abs=0.15)


def test_bulk_moduli_repeat_to_the_bit():
    assert bulk_moduli(1099, 3, 1.0, 0.7) == bulk_moduli(1099, 3, 1.0, 0.7)


def test_wave_speeds_are_those_of_plane_stress():
    # c_p^2 = E/((1 - nu^2) rho), c_s^2 = E/(2 (1 + nu) rho), rho = M/(pi R^2).
    m = Moduli(young=1.1, poisson=0.25)
    assert m.density == pytest.approx(1 / math.pi)
    assert m.wave_speed_p**2 == pytest.approx(1.1 * math.pi / (1 - 0.0625))
    assert m.wave_speed_s**2 == pytest.approx(1.1 * math.pi / 2.5)


def test_strip_without_an_inside_is_refused():
    with pytest.raises(InputError, match="6 spacings"):
        stretch_test(1099, 0, 1.0, 0.7, 3.0, 0.25)
    with pytest.raises(InputError, match="rows"):
        stretch_test(1099, 0, 1.0, 0.7, 3.0, 0.05)
