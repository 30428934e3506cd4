"""Finer lattices on harder walls: impacts come to obey the quasi-static law, eq. (4), integrated."""

from __future__ import annotations

import pytest
from worlds import computed

from taichi_disk import theory
from taichi_disk.study.viscosity import contact_viscosity

YOUNG = 1.1025  # of 16 stretched samples of 17,600 points: +- 0.2 %


def differences(points, a, eta_star, velocity):
    """e minus that of eq. (4), and the contact time over it minus 1."""
    settings = (f"lattice.points={points}", f"wall.a={a}", f"material.eta_star={eta_star}")
    setup, outcome = computed("exponential_wall", *settings, f"impact.velocity={velocity}")
    values = setup.headline(outcome.columns).values
    law = theory.quasistatic_impact(velocity, eta_star * contact_viscosity(0, points, a=float(a)), YOUNG)
    return values["restitution"] - law.restitution, values["contact_time"] / law.contact_time - 1.0


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
def test_strongly_damped_impacts_tend_to_eq_4():
    # eta, not eta*, is the same: eta* grows with N. What is left at N = 4396 are 2 %.
    coarse = [abs(one) for one in differences(1099, 300.0, 100.0, 7.5e-3)]
    fine = [abs(one) for one in differences(4396, 12000.0, 400.0, 7.5e-3)]
    assert fine[0] < 0.02 and fine[1] < 0.03
    assert coarse[0] > 5 * fine[0] and coarse[1] > 5 * fine[1]


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
def test_the_contact_of_an_undamped_disk_lasts_as_long_as_eq_4_says():
    e, time = differences(4396, 12000.0, 0.0, 2e-2)
    assert abs(time) < 0.02
    assert -0.03 < e < 0.0  # vibrations take a little with them, at any N


def test_tau0_does_not_depend_on_the_number_of_points_at_the_same_eta():
    # eta = eta*/N; a sum over springs of (strain times spacing)^2 over one of (strain times spacing)^2.
    few, many = (contact_viscosity(0, points, a=3000.0) * points for points in (400, 1600))
    assert many == pytest.approx(few, rel=0.1)
