"""The order in the time step, in every scene and with every integrator, against DOP853
on the same lattice.

The order is log2 of the ratio of the largest position errors after a fixed time at the
steps h and h/2. The whole state is compared, not only e, so no error can hide in an
average.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest
import reference
from bodies import FOUR_FORCES, RESET, bouncing

from taichi_disk.integrators import TAKAHASHI_IMADA, TRAPEZOIDAL, VELOCITY_VERLET

N = 40
END = 1.92  # [R/c], during the contact
ETA = 100.0 / N  # eta* = 100
VV = VELOCITY_VERLET


def build(scene, eta):
    lattice, velocities, model = bouncing(scene, N, eta)
    if model.elastic is None:
        # A shear breaks the symmetry. Above an elastic wall it would move contacts from
        # spring to spring, where the force jumps a little and no integrator has an
        # order.
        velocities[:, 0] += 0.02 * lattice.positions[:, 1]
    return lattice, velocities, model


@lru_cache
def solved(scene, eta):
    lattice, velocities, model = build(scene, eta)
    plain = reference.Model(lattice, model)
    start = (lattice.positions, velocities)
    if scene.endswith("reset"):
        return plain.solve_with_resets(*start, END, RESET, 1e-10)
    return plain.solve(*start, (0.0, END), 1e-10)[-1]


def steps_for(eta, integrator):
    # Explicit dashpots at eta* = 100 need h < 1.7e-3 R/c. A reset interval contains a
    # whole number of steps.
    return 192 if integrator.order == 4 else 2400 if (eta and integrator is VV) else 960


FAST = {
    ("rigid", 0.0, VV),
    ("rigid", 0.0, FOUR_FORCES),
    ("rigid", 0.0, TAKAHASHI_IMADA),
}
SCENES = ["compression", "rigid", "reset", "pinned", "matched"]
WAYS = [(0.0, VV), (ETA, VV), (ETA, TRAPEZOIDAL), (0.0, FOUR_FORCES)]
# The integrator of order 4 takes no force that depends on velocity.
CASES = [
    (scene, *way)
    for scene in SCENES
    for way in WAYS
    if (scene, way[1]) != ("matched", FOUR_FORCES)
]
CASES += [
    ("non-uniform compression", ETA, TRAPEZOIDAL),
    ("non-uniform rigid", 0.0, FOUR_FORCES),
    ("non-uniform matched", ETA, TRAPEZOIDAL),
]
CASES += [("non-uniform reset", ETA / 5.0, VV), ("non-uniform reset", ETA, TRAPEZOIDAL)]
CASES += [
    (scene, 0.0, TAKAHASHI_IMADA)
    for scene in ("compression", "rigid", "pinned", "non-uniform rigid")
]


@pytest.mark.parametrize(
    ("scene", "eta", "integrator"),
    [
        pytest.param(*case, marks=() if case in FAST else pytest.mark.validate)
        for case in CASES
    ],
)
def test_errors_fall_with_the_order_of_the_integrator(scene, eta, integrator, kernels):
    lattice, velocities, model = build(scene, eta)
    x, v = solved(scene, eta)
    errors = []
    coarse = steps_for(eta, integrator)
    for count in (coarse, 2 * coarse):
        simulation = kernels.simulation(
            lattice, model, integrator, velocities, END / count
        )
        simulation.advance(count)
        errors.append(
            [
                np.abs(simulation.positions() - x).max(),
                np.abs(simulation.velocities() - v).max(),
            ]
        )
    orders = np.log2(np.array(errors[0]) / errors[1])
    if integrator.correction:  # velocities come from the difference of two forces
        assert 2.9 < orders[1] < 3.5
        orders = orders[:1]
    np.testing.assert_allclose(orders, integrator.order, atol=0.1)
    # At h ~ 1e-3 R/c, 2 per cent of the stability limit, h^2 omega^2/24 ~ 1e-4 of the
    # amplitudes. At h = 5e-3 order 4 leaves h^4 omega^4 times its own constant, 9e-4
    # (phase error of an oscillator), a hundred times less.
    bounds = (
        (2e-6, 1e-4)
        if integrator.order == 2
        else (2e-8, 1e-5 if integrator.correction else 1e-6)
    )
    assert errors[1][0] < bounds[0]
    assert errors[1][1] < bounds[1]
    # displacements are hundreds of times the errors
    assert np.abs(x - lattice.positions).max() > 0.005
