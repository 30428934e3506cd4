"""The limit of the step, and energy over a million steps."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.integrators import VELOCITY_VERLET, Integrator
from taichi_disk.simulation.simulation import KernelCache

from .endurance import ABOVE, BELOW, BOUNDED, DRIFTS, LIMITS, STIFFNESSES, Rest, Wander, drift

pytestmark = pytest.mark.validate


@pytest.mark.parametrize("pressed", [False, True], ids=["free", "pressed on the wall"])
@pytest.mark.parametrize(("integrator", "eta_star"), LIMITS)
def test_steps_below_the_limit_stay_bounded_and_above_blow_up(
    integrator: Integrator, eta_star: float, pressed: bool, kernels: KernelCache
) -> None:
    for k_a in STIFFNESSES:
        rest = Rest(integrator, eta_star, k_a, pressed)
        # Beside the wall the limit stated is on the safe side of the true one.
        assert 0.8 < rest.stated / rest.true < 1.0 + 2e-4
        assert rest.growth(kernels, 0.98 * rest.stated, BELOW) < (BOUNDED, BELOW + 1)
        assert rest.growth(kernels, 1.05 * rest.true, ABOVE)[1] < ABOVE


@pytest.mark.parametrize("bouncing", [False, True])
def test_energy_does_not_drift_in_a_million_steps(bouncing: bool, kernels: KernelCache) -> None:
    modified: list[tuple[Wander, Wander]] = []
    for case in DRIFTS:
        if case[1] != bouncing:
            continue
        energy, kept = drift(kernels, *case)
        # Leapfrog's energy swings by up to (h omega/2)^2 for the fastest mode, the mean over all modes far less.
        assert energy.swing < 0.25
        if bouncing:  # some 2,500 bounces, each with the error of an impact; and see below
            assert abs(energy.slope) < 0.02
        else:
            assert abs(energy.slope) < 4.0 * energy.slope_error
            assert energy.slope_error < 2e-3
        if kept is not None:
            assert case[0] is VELOCITY_VERLET and kept.swing < 0.5 * energy.swing
            modified.append((energy, kept))
    coarse, fine = modified
    if bouncing:
        # Leapfrog conserves E + (h omega)^2 E/24 of a mode: as the bounces' energy goes over to faster modes, E falls.
        # The motion is chaotic: another step gives another course of the same kind.
        assert coarse[0].slope < -3.0 * coarse[0].slope_error
        assert np.log2(coarse[0].swing / fine[0].swing) == pytest.approx(2.0, abs=0.5)
        assert np.log2(coarse[1].swing / fine[1].swing) == pytest.approx(4.0, abs=0.5)
