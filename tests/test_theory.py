"""The continuum laws against closed forms, limits and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
from elastic_disk import pressed_disk
from scipy.integrate import quad

from taichi_disk import theory

E, NU = 1.1, 0.29
SOUND = math.sqrt(math.pi * E)


def test_the_paper_s_law_with_b_1_lies_a_known_amount_above_the_exact_one() -> None:
    # (2) - exact = P/(pi E) {ln 4 - 1 - nu + (1 + nu)/4} = P/(pi E) {ln 4 - 3 (1 + nu)/4 - ... }, whatever P is.
    P = np.array([4e-3, 1e-2])
    apart = theory.paper_compression(P, E, NU) - theory.exact_compression(P, E, NU)
    np.testing.assert_allclose(apart, P / (math.pi * E) * (math.log(4) - 0.75 * (1 + NU)), rtol=1e-12)


def test_the_exact_law_is_the_integral_of_its_compliance() -> None:
    # d xi/dP = {ln(pi E/P) - (1 + nu)/4 - 1}/(pi E)
    def compliance(P: float) -> float:
        return (math.log(math.pi * E / P) - (1 + NU) / 4 - 1) / (math.pi * E)

    assert theory.exact_compression(0.01, E, NU) == pytest.approx(quad(compliance, 0, 0.01)[0], rel=1e-9)


@pytest.mark.parametrize(
    ("pressure", "poisson"),
    [(1e-3, NU), *(pytest.param(p, nu, marks=pytest.mark.validate) for p in (1e-4, 1e-2) for nu in (0.0, NU))],
)
def test_the_exact_law_is_what_finite_elements_converge_to(pressure: float, poisson: float) -> None:
    # Linear triangles: the error falls as the square of their size, so that two meshes give the limit.
    law = float(theory.exact_compression(pressure, E, poisson))
    coarse, fine = (pressed_disk(pressure, E, poisson, rays) for rays in (16, 32))
    # The law's own error is of the order of P/E; eq. (2) is off by 4 to 10 % at any.
    assert (4 * fine - coarse) / 3 == pytest.approx(law, rel=1e-4 + 0.25 * pressure / E)


@pytest.mark.parametrize("v", [3e-3, 5e-2])
def test_without_viscosity_the_impact_conserves_energy(v: float) -> None:
    impact = theory.quasistatic_impact(v, 0.0, E)
    assert impact.restitution == pytest.approx(1.0, abs=1e-8)
    # At the turn all energy is elastic: v^2/2 = int_0^xi pi E xi/ln(4/xi) dxi.
    stored = quad(lambda x: math.pi * E * x / math.log(4 / x), 0, impact.compression)[0]
    assert stored == pytest.approx(v**2 / 2, rel=1e-7)
    # The elastic impact lasts 2 int_0^xi_max dxi/sqrt(v^2 - 2 U), taken with xi = xi_max sin(s).
    top = impact.compression

    def time(s: float) -> float:
        x = top * math.sin(s)
        left = quad(lambda y: 2 * math.pi * E * y / math.log(4 / y), x, top)[0]
        return top * math.cos(s) / math.sqrt(left)

    assert impact.contact_time == pytest.approx(2 * quad(time, 0, math.pi / 2, epsrel=1e-6)[0], rel=1e-5)


@pytest.mark.parametrize("v", [3e-3, 5e-2])
def test_a_small_viscosity_costs_what_first_order_theory_says(v: float) -> None:
    loss = theory.first_order_loss(v, E)
    slopes = [(1 - theory.quasistatic_impact(v, tau, E).restitution) / tau for tau in (2e-3, 1e-3)]
    # The slope's own error is O(tau): extrapolate it away.
    assert 2 * slopes[1] - slopes[0] == pytest.approx(loss, rel=1e-5)


def test_the_paper_s_d2_is_twice_the_first_order_result_of_its_eq_4() -> None:
    # Eq. (5) to first order: 1 - e = d2/(2 sqrt(L)), L = ln(4 c/v), c = sqrt(E/rho); the rest is O(1/L).
    for v in (1e-50, 1e-200):
        L = math.log(4 * SOUND / v)
        printed = theory.paper_d2(1.0, E, SOUND) / (2 * math.sqrt(L))
        assert theory.first_order_loss(v, E) / printed == pytest.approx(0.5, abs=0.5 / L)


def test_a_constant_logarithm_would_make_the_impact_a_damped_oscillator() -> None:
    # As v -> 0, ln(4/xi) hardly changes in an impact: z'' = -w^2 (z + tau z'), w^2 = pi E/L, until the force vanishes.
    v, tau = 1e-280, 0.2
    L = math.log(4 / v)
    w = math.sqrt(math.pi * E / L)
    g = tau * w / 2
    W = math.sqrt(1 - g * g)
    # With g = tau w/2, s = w t: z = exp(-g s) sin(W s)/W; the force z + tau w z' = 0 at tan(W s) = -2 g W/(1 - 2 g^2).
    s = (math.pi - math.atan2(2 * g * W, 1 - 2 * g * g)) / W
    e = -math.exp(-g * s) * (math.cos(W * s) - g / W * math.sin(W * s))
    assert theory.quasistatic_impact(v, tau, E).restitution == pytest.approx(e, abs=3 * (1 - e) / L)


def test_contact_times_tend_to_hertz_s() -> None:
    # pi sqrt(ln(4 c/v)) is the half period at constant logarithm: right as v -> 0 only.
    shares = [
        theory.quasistatic_impact(v, 0.0, E).contact_time / float(theory.hertz_contact_time(v, SOUND))
        for v in (5e-2, 1e-4, 1e-200)
    ]
    assert shares[0] < shares[1] < shares[2]
    assert shares[2] == pytest.approx(1.0, abs=2 / math.log(4e200))  # the logarithm varies by O(1/L)


def test_eq_5_has_no_value_beyond_its_root() -> None:
    assert theory.paper_restitution(5e-2, 1.0, 3.0) == 0.0
    v = np.array([1e-2])
    np.testing.assert_allclose(theory.paper_restitution(v, 0.9, 0.3), 0.9 * np.sqrt(1 - 0.3 / np.sqrt(np.log(400))))


def test_an_impact_that_crushes_the_disk_is_refused() -> None:
    with pytest.raises(ValueError, match="no impact"):
        theory.quasistatic_impact(3.0, 0.0, E)
