"""How far a result is off for its time step, by another run: exact for powers, careful elsewhere."""

from __future__ import annotations

import pytest

from taichi_disk.integrators import VEFRL, VELOCITY_VERLET
from taichi_disk.simulation.step_control import CAUTION, UNRESOLVED_PART, RunRecord, error_estimate


@pytest.mark.parametrize("integrator", [VELOCITY_VERLET, VEFRL])
@pytest.mark.parametrize("other", [0.02, 0.007], ids=["longer", "shorter"])
def test_the_estimate_is_exact_where_the_error_is_a_power_of_the_step(integrator, other):
    runs = [RunRecord(integrator, dt, 0.9 + 3.0 * dt**integrator.order) for dt in (other, 0.014)]
    assert error_estimate(*runs) == pytest.approx(CAUTION * 3.0 * 0.014**integrator.order, rel=1e-5)


def test_a_step_that_does_not_resolve_the_wall_is_judged_by_the_energy_too():
    for resolving, expected in ((0.01, 0.0), (0.008, UNRESOLVED_PART * 1e-3)):
        agreeing = [RunRecord(VELOCITY_VERLET, dt, 0.9, 1e-3, dt / resolving) for dt in (0.014, 0.009)]
        assert error_estimate(*agreeing) == expected
