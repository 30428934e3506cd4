"""The mouse's pull on a point, against DOP853 and in the energy balance."""

import numpy as np
import pytest
import reference
from bodies import FALLING, disk, non_uniform

from taichi_disk.mechanics.integrators import (
    TAKAHASHI_IMADA,
    TRAPEZOIDAL,
    VELOCITY_VERLET,
)
from taichi_disk.mechanics.physics import Model, MouseSpring, Springs
from taichi_disk.mechanics.simulation.observables import INDEX

MOUSE = MouseSpring(0.2, 0.02)
POINT = 7
LONG = pytest.mark.validate
# Farther than strongest/k = 0.1 R from its target the pull is constant. (pulled point,
# offset of the target), 24 steps.
LED = ((POINT, (0.05, 0.02)), (POINT, (0.3, 0.1)), (-1, (0.0, 0.0)))


class Pulled(reference.Model):
    point = -1
    target = None

    def force(self, x, v):
        f = super().force(x, v)
        if self.point >= 0:
            d = self.target - x[self.point]
            f[self.point] += d * min(MOUSE.k, MOUSE.strongest / np.hypot(*d))
        return f


@pytest.mark.parametrize(
    ("eta", "integrator"),
    [
        (0.0, VELOCITY_VERLET),
        pytest.param(0.0, TAKAHASHI_IMADA, marks=LONG),
        # Overdamped: eta times the largest eigenvalue of the Laplacian over m is 14
        # times the inverse step.
        pytest.param(1.0, TRAPEZOIDAL, marks=LONG),
    ],
)
@pytest.mark.parametrize(
    "body",
    [lambda one: one, pytest.param(non_uniform, marks=LONG)],
    ids=["equal", "non-uniform"],
)
def test_a_pulled_point_moves_as_the_exact_solution_and_its_energy_is_accounted_for(
    body, eta, integrator, kernels
):
    dt = 0.02
    lattice = body(disk(60, height=0.5))
    model = Model(Springs(1.0, 1.0, eta), FALLING.wall, mouse=MOUSE)
    x = lattice.positions
    v = np.zeros_like(lattice.positions)
    plain = Pulled(lattice, model)
    y = (x, v)
    for plain.point, offset in LED:
        plain.target = x[POINT] + offset
        y = plain.solve(*y, (0.0, 24 * dt))[-1]
    errors = []
    for steps in (1, 2, 4):
        simulation = kernels.simulation(lattice, model, integrator, v, dt / steps)
        work = 0.0
        for point, offset in LED:
            work += simulation.set_mouse_target(point, tuple(x[POINT] + offset))
            simulation.advance(24 * steps)
        errors.append(np.abs(simulation.positions() - y[0]).max())
        row = simulation.now
        names = ("kinetic", "elastic", "wall", "load", "dissipated")
        energy = sum(row[INDEX[name]] for name in names)
    least = 0.8 * 2**2  # also for order 4, because the pull jumps
    assert errors[0] > least * errors[1] > least**2 * errors[2]
    assert errors[-1] < 2e-3 * np.abs(y[0] - x).max()
    assert energy == pytest.approx(work, rel=2e-3)
