"""Fits recover what was planted, and their intervals hold it as often as they say."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk import theory
from taichi_disk.study import fits
from taichi_disk.study.analysis import analyse

V = np.geomspace(3e-3, 5e-2, 12)
P = np.linspace(4e-3, 1e-2, 7)


def test_eq_5_s_planted_parameters_come_back() -> None:
    for d1, d2 in ((0.973, 0.119), (1.0, 0.6), (1.6, 1.4)):
        fit = fits.fit_restitution(V, theory.paper_restitution(V, d1, d2)[None])
        assert fit.values == pytest.approx({"d1": d1, "d2": d2}, rel=1e-6)
        assert fit.rms < 1e-7 and not fit.intervals
    fixed = fits.fit_restitution(V, theory.paper_restitution(V, 1.0, 0.6)[None], d1_is_1=True)
    assert fixed.values == pytest.approx({"d1": 1.0, "d2": 0.6}, rel=1e-6)


def test_a_planted_b_comes_back_and_each_lattice_has_its_own() -> None:
    b = np.array([0.9, 1.5, 2.4])
    xi = theory.paper_compression(P, 1.1, 0.29, b[:, None])
    one = fits.fit_b(P, xi[1:2], 1.1, 0.29)
    assert one.values["b"] == pytest.approx(1.5, rel=1e-6)
    fit = fits.fit_b(P, xi, 1.1, 0.29)
    assert [fit.values[f"b_{name}"] for name in ("min", "median", "max")] == pytest.approx(list(b), rel=1e-6)
    low, high = fit.intervals["b"]
    assert 0.9 <= low < fit.values["b"] < high <= 2.4


def test_a_planted_tau0_comes_back() -> None:
    e = theory.quasistatic_restitution(V, 0.0731, 1.1)
    fit = fits.fit_tau0(V, e[None], 1.1)
    assert fit.values["tau0"] == pytest.approx(0.0731, rel=1e-4)
    assert fit.rms < 1e-6


def test_the_residuals_are_data_minus_fit() -> None:
    e = theory.paper_restitution(V, 1.0, 0.6)
    bump = np.where(np.arange(12) == 5, 1e-3, 0.0)
    fit = fits.fit_restitution(V, np.stack([e + bump, e + bump]))
    # Two parameters on twelve points take up about a sixth of a lone bump.
    assert 0.7e-3 < fit.residuals[5] < 1e-3


def test_curvature_is_the_second_derivative_of_either_half() -> None:
    y = np.where(V[6] > V, -3.0 * V**2 + V, 2.0 * V**2)
    fit = fits.fit_curvature(V, np.stack([y, y]))
    assert fit.values == pytest.approx({"slow_half": -6.0, "fast_half": 4.0}, rel=1e-8)
    assert fit.rms < 1e-12


def test_intervals_hold_the_truth_about_as_often_as_their_level(monkeypatch: pytest.MonkeyPatch) -> None:
    # Lattices that scatter by a common factor each: what a bootstrap over single points would miss.
    monkeypatch.setattr(fits, "RESAMPLES", 200)
    rng = np.random.default_rng(1)
    true = theory.paper_restitution(V, 1.0, 0.6)
    held = 0
    for _ in range(30):
        e = true * (1.0 + 0.01 * rng.standard_normal((16, 1)))
        low, high = fits.fit_restitution(V, e).intervals["d1"]
        held += low <= 1.0 <= high
    # Binomial(30, 0.95), and 16 lattices make the percentile interval a little narrow.
    assert held >= 23


def test_the_moduli_are_the_mean_over_lattices_however_many_rows_each_has():
    rows = [
        {"seed": seed, "pressure": pressure, "xi": 0.01, "xi_nominal": 0.02, "status": "done", "young": young}
        | {"poisson": 0.3 * young}
        for seed, pressure, young in [(0, 1e-3, 1.0), (0, 2e-3, 1.0), (1, 1e-3, 1.2), (1, 2e-3, 1.2), (0, 3e-3, 1.0)]
    ]
    rows.append(rows[2] | {"pressure": 3e-3, "status": "failed", "xi": None})
    curve = analyse("compression", ["seed", "pressure"], rows).curves[0]
    assert (curve.young, curve.poisson) == (pytest.approx(1.1), pytest.approx(0.33))
