"""The continuum laws, compared with closed forms, limits and each other."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from docs.experiments.quasistatic import quasistatic_impact
from taichi_disk.experiments.scenes.compression import (
    exact_compression,
    paper_compression,
)
from taichi_disk.studies.figures import theory

E = 1.1
NU = 0.29


def test_eq_2_lies_a_known_amount_above_the_exact_law_and_depends_on_b_over_e():
    # (2) with b = 1 minus the exact law is P/(pi E) {ln 4 - 3 (1 + nu)/4} at any P.
    P = np.array([4e-3, 1e-2])
    apart = paper_compression(P, E, NU) - exact_compression(P, E, NU)
    np.testing.assert_allclose(
        apart, P / (math.pi * E) * (math.log(4) - 0.75 * (1 + NU)), rtol=1e-12
    )
    # So a fitted b is proportional to the E that is used in the fit.
    np.testing.assert_allclose(
        paper_compression(P, 2 * E, NU, 2.0), paper_compression(P, E, NU)
    )


def test_the_exact_law_is_the_integral_of_its_compliance():
    # d xi/dP = {ln(pi E/P) - (1 + nu)/4 - 1}/(pi E)
    compliance = quad(
        lambda P: (math.log(math.pi * E / P) - (1 + NU) / 4 - 1) / (math.pi * E),
        0,
        0.01,
    )[0]
    assert exact_compression(0.01, E, NU) == pytest.approx(compliance, rel=1e-9)


def twice_potential(x, start=0.0):
    """2 U from `start` to x, U' = pi E xi/ln(4/xi)."""
    return float(quad(lambda y: 2 * math.pi * E * y / math.log(4 / y), start, x)[0])


@pytest.mark.parametrize("v", [3e-3, 5e-2])
def test_without_viscosity_the_impact_conserves_energy(v):
    e, contact_time, top = quasistatic_impact(v, 0.0, E)
    assert e == pytest.approx(1.0, abs=1e-8)
    # at the turn all energy is elastic
    assert twice_potential(top) == pytest.approx(v**2, rel=1e-7)

    def time(s):  # dt/ds for xi = xi_max sin(s)
        x = top * math.sin(s)
        return top * math.cos(s) / math.sqrt(twice_potential(top, x))

    assert contact_time == pytest.approx(
        2 * quad(time, 0, math.pi / 2, epsrel=1e-6)[0], rel=1e-5
    )


def test_eq_5_has_no_value_beyond_its_root_and_eq_4_none_for_a_crushed_disk():
    assert theory.paper_restitution(5e-2, 1.0, 3.0) == 0.0
    assert theory.paper_restitution(1e-2, 0.9, 0.3) == pytest.approx(
        0.9 * math.sqrt(1 - 0.3 / math.sqrt(math.log(400)))
    )
    with pytest.raises(ValueError, match="no impact"):
        quasistatic_impact(3.0, 0.0, E)
