"""The forces of every law: kernels, NumPy and an independent implementation agree, and
the forces follow from the energy.

Two implementations differ by rounding. Each force is a sum of some ten terms of similar
size, so 1e-13 of the largest force is allowed. The walls here are so soft that they
push many points about as hard as the springs do.
"""

from dataclasses import replace

import numpy as np
import pytest
import reference
from bodies import (
    FALLING,
    FREE,
    damped,
    disk,
    disk_and_wall,
    matched,
    non_uniform,
    pressed,
    shaken,
)
from numpy.testing import assert_allclose

from taichi_disk.mechanics.integrators import TRAPEZOIDAL, VELOCITY_VERLET
from taichi_disk.mechanics.physics import (
    ElasticWall,
    ExponentialWall,
    Model,
    PinnedBoundary,
    ResetBoundary,
    Springs,
)
from taichi_disk.mechanics.simulation.observables import INDEX

VV = VELOCITY_VERLET
DISK = disk(height=0.03)
BOTH = disk_and_wall()
SOFT = ExponentialWall(20.0, 0.02)
ELASTIC = ElasticWall(20.0, 0.02, 0.1)
AXIAL = Model(Springs(1.0, 2.0, 0.3, axial=True), SOFT)
LOADED = pressed(0.02, 0.3, k_b=2.0, wall=SOFT)
PINNED = Model(Springs(1.0, 2.0), ELASTIC, boundary=PinnedBoundary())
RESET = replace(PINNED, boundary=ResetBoundary(1.0))
MATCHED = Model(Springs(1.0, 2.0, 0.3), ELASTIC, boundary=matched(BOTH))
CASES = {
    "free": (disk(), replace(FREE, springs=Springs(0.7)), VV),
    "wall, cubic springs": (DISK, replace(FALLING, wall=SOFT), VV),
    "wall, dashpots": (DISK, replace(damped(0.3, k_b=2.0), wall=SOFT), VV),
    "wall, axial dashpots": (DISK, AXIAL, VV),
    "wall, load, dashpots solved for": (DISK, LOADED, TRAPEZOIDAL),
    "elastic wall, reset": (BOTH, RESET, VV),
    "elastic wall, pinned": (BOTH, PINNED, VV),
    "elastic wall, matched, dashpots solved for": (BOTH, MATCHED, TRAPEZOIDAL),
    "non-uniform, wall, load, dashpots": (non_uniform(DISK, 0.2, 3.0), LOADED, VV),
}
RARE = {
    "non-uniform, wall, axial dashpots": (non_uniform(DISK, 0.2, 3.0), AXIAL, VV),
    "non-uniform, elastic wall, pinned": (non_uniform(BOTH, 0.2, 3.0), PINNED, VV),
}


def assert_equal_forces(force, expected):
    assert_allclose(force, expected, rtol=0, atol=1e-13 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("lattice", "model", "integrator"),
    [
        *(pytest.param(*case, id=name) for name, case in CASES.items()),
        *(
            pytest.param(*case, id=name, marks=pytest.mark.validate)
            for name, case in RARE.items()
        ),
    ],
)
def test_kernels_and_numpy_have_the_forces_and_energies_of_plain_numpy(
    lattice, model, integrator, kernels
):
    plain = reference.Model(lattice, model)
    springs = model.springs
    for seed in range(3):
        x, v = shaken(lattice, seed, 0.01)
        if plain.pinned:
            v[lattice.wall_boundary] = 0.0
        moved = replace(lattice, positions=x)
        simulation = kernels.simulation(moved, model, integrator, v, 1e-3)
        f = simulation.snapshot().vectors[2]
        wall = plain.wall_force(x)[: lattice.disk_points]
        at = v
        if integrator is TRAPEZOIDAL:
            # Implicit dashpots act at the velocity in the middle of the first step.
            at = v + 0.5 * simulation.dt / lattice.masses[:, None] * f
        force = plain.force(x, at)
        assert_equal_forces(f, force)
        assert_equal_forces(model.forces_moving(lattice, x, at), force)

        row = {key: simulation.first_row[k] for key, k in INDEX.items()}
        residual = np.hypot(*force[: lattice.disk_points].T).max()
        expected = {
            "elastic": plain.elastic(x),
            "kinetic": 0.5 * np.sum(plain.mass * v**2),
            "load": plain.load * np.average(x[:, 1], weights=lattice.masses),
            "residual": residual,
            "wall": plain.wall(x),
            "wall_force": wall[:, 1].sum(),
        }
        for key, value in expected.items():
            assert row[key] == pytest.approx(value, rel=1e-11), key
        assert springs.energy(lattice, x) == pytest.approx(plain.elastic(x), rel=1e-12)
        assert model.energy(lattice, x) == pytest.approx(plain.potential(x), rel=1e-12)
        if model.wall:
            assert np.count_nonzero(wall[:, 1] > 0.02) >= 3
            points, pushes = model.wall.contact_forces(lattice, x)
            shown = np.zeros_like(wall)
            shown[points] = pushes
            assert_equal_forces(shown, wall)


@pytest.mark.parametrize(
    "name",
    [
        "wall, load, dashpots solved for",
        "elastic wall, reset",
        "non-uniform, wall, load, dashpots",
    ],
)
def test_the_independent_force_is_minus_the_slope_of_its_potential(name):
    # With both of them the laws agree, as asked above. Central differences, step d:
    # error d^2 U'''/6 with U''' ~ a^2 F at the wall, 3e-12 F, and rounding eps U/d.
    lattice, model, _ = CASES[name]
    plain = reference.Model(lattice, model)
    x = shaken(lattice, 7, 0.005)[0]
    force = plain.force(x, np.zeros_like(x))
    d = 2e-7
    surface = lattice.wall_surface
    lowest = np.argsort(x[: lattice.disk_points, 1])[:4]
    under = surface[np.argsort(np.abs(x[surface, 0] - x[lowest[0], 0]))[:3]]
    for i in [*lowest, *under, *np.random.default_rng(3).integers(0, len(x), 8)]:
        for c in (0, 1):
            step = np.zeros_like(x)
            step[i, c] = d
            slope = (plain.potential(x + step) - plain.potential(x - step)) / (2 * d)
            assert abs(force[i, c] + slope) < 1e-7 * np.abs(force).max()


@pytest.mark.parametrize(
    "lattice",
    [disk(40, height=0.05), non_uniform(disk(40, height=0.05))],
    ids=["equal", "non-uniform"],
)
def test_the_stiffness_is_minus_the_derivative_of_the_forces(lattice):
    model = pressed(0.02, k_b=40.0)
    plain = reference.Model(lattice, model)
    x = shaken(lattice, 1, 0.02)[0]
    d = 3e-7
    tangent = model.stiffness(lattice, x).toarray()
    for k in range(x.size):
        step = d * np.eye(1, x.size, k).reshape(x.shape)
        change = plain.force(x - step, 0 * x) - plain.force(x + step, 0 * x)
        column = change.ravel() / (2 * d)
        assert_allclose(tangent[:, k], column, rtol=0, atol=1e-7 * np.abs(column).max())
    assert np.abs(tangent - tangent.T).max() < 1e-15 * np.abs(tangent).max()
