"""The order in the time step, in every scene and with every integrator, against DOP853
on the same lattice.

The order is log2 of the ratio of the largest position errors after a fixed time at the
steps h and h/2. The whole state is compared, so no error hides in an average.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
import reference
from bodies import FOUR_FORCES, RESET, V0, A, bouncing

from taichi_disk.mechanics.integrators import (
    TAKAHASHI_IMADA,
    TRAPEZOIDAL,
    VELOCITY_VERLET,
)
from taichi_disk.mechanics.physics import ExponentialWall
from taichi_disk.studies.accuracy.steps import reference_state

N = 40
END = 1.92  # [R/c], during the contact
ETA = 100.0 / N  # eta* = 100
VV = VELOCITY_VERLET


class Rough(reference.Model):
    """While every point slides to the right, friction is -mu times the push."""

    def wall_force(self, x):
        force = super().wall_force(x)
        force[:, 0] -= 0.2 * force[:, 1]
        return force


def build(scene, eta):
    """Return lattice, velocities and model of a scene, and the independent model."""
    lattice, velocities, model = bouncing(scene.removeprefix("sliding "), N, eta)
    if model.elastic is None:
        # A shear breaks the symmetry. Above an elastic wall it would move contacts from
        # spring to spring, where the force jumps and no integrator has an order.
        velocities[:, 0] += 0.02 * lattice.positions[:, 1]
    if scene.startswith("sliding"):
        velocities[:, 0] += 0.3
        model = replace(model, wall=ExponentialWall(A, V0, 0.2))
        return lattice, velocities, model, Rough(lattice, model)
    return lattice, velocities, model, reference.Model(lattice, model)


@lru_cache
def solved(scene, eta):
    lattice, velocities, _, plain = build(scene, eta)
    start = (lattice.positions, velocities)
    if scene.endswith("reset"):
        return plain.solve_with_resets(*start, END, RESET, 1e-10)
    return plain.solve(*start, (0.0, END), 1e-10)[-1]


def test_the_reference_of_accuracy_is_that_of_a_solver_of_its_own():
    lattice, velocities, model, _ = build("rigid", 0.0)
    found = reference_state(lattice, model, velocities, END)
    assert found == pytest.approx(np.array(solved("rigid", 0.0)), abs=1e-8)


def steps_for(eta, integrator):
    # Explicit dashpots at eta* = 100 need h < 1.7e-3 R/c. A reset interval contains a
    # whole number of steps.
    if integrator.order == 4:
        return 192
    return 2400 if eta and integrator is VV else 960


FAST = [
    ("rigid", 0.0, VV),
    ("rigid", 0.0, FOUR_FORCES),
    ("rigid", 0.0, TAKAHASHI_IMADA),
    ("sliding rigid", 0.0, VV),
]
WAYS = [(0.0, VV), (ETA, VV), (ETA, TRAPEZOIDAL), (0.0, FOUR_FORCES)]
SLOW = [("compression", *way) for way in WAYS]
SLOW += [("rigid", ETA, VV), ("rigid", ETA, TRAPEZOIDAL)]
# The integrator of order 4 takes no force that depends on velocity.
SLOW += [(scene, *way) for scene in ("reset", "pinned", "matched") for way in WAYS]
SLOW.remove(("matched", 0.0, FOUR_FORCES))
SLOW += [
    ("non-uniform compression", ETA, TRAPEZOIDAL),
    ("non-uniform rigid", 0.0, FOUR_FORCES),
    ("non-uniform matched", ETA, TRAPEZOIDAL),
    ("non-uniform reset", ETA / 5.0, VV),
    ("non-uniform reset", ETA, TRAPEZOIDAL),
    ("compression", 0.0, TAKAHASHI_IMADA),
    ("pinned", 0.0, TAKAHASHI_IMADA),
    ("non-uniform rigid", 0.0, TAKAHASHI_IMADA),
]
CASES = [*FAST, *(pytest.param(*case, marks=pytest.mark.validate) for case in SLOW)]


@pytest.mark.parametrize(("scene", "eta", "integrator"), CASES)
def test_errors_fall_with_the_order_of_the_integrator(scene, eta, integrator, kernels):
    lattice, velocities, model, _ = build(scene, eta)
    x, v = solved(scene, eta)
    errors = []
    coarse = steps_for(eta, integrator)
    for count in (coarse, 2 * coarse):
        simulation = kernels.simulation(
            lattice, model, integrator, velocities, END / count
        )
        simulation.advance(count)
        off = simulation.positions() - x, simulation.velocities() - v
        errors.append(np.abs(off).max(axis=(1, 2)))
    orders = np.log2(errors[0] / errors[1])
    if integrator.correction:  # velocities come from the difference of two forces
        assert 2.9 < orders[1] < 3.5
        orders = orders[:1]
    np.testing.assert_allclose(orders, integrator.order, atol=0.1)
    # At h ~ 1e-3 R/c, 2 per cent of the stability limit, h^2 omega^2/24 ~ 1e-4 of the
    # amplitudes. At h = 5e-3 order 4 leaves h^4 omega^4 times its own constant, 9e-4
    # (phase error of an oscillator), a hundred times less.
    bounds = (2e-6, 1e-4)
    if integrator.order == 4:
        bounds = (2e-8, 1e-5 if integrator.correction else 1e-6)
    assert (errors[1] < bounds).all()
    # displacements are hundreds of times the errors
    assert np.abs(x - lattice.positions).max() > 0.005
