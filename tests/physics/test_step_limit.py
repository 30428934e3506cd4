"""The stability limit of the step, against matrices and oscillators."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import reference
from bodies import ELASTIC, FREE, RIGID, computed, disk, disk_and_wall, non_uniform
from scipy.integrate import solve_ivp

from taichi_disk.experiments.computation.stability import (
    explicit_limit,
    impact_point_force,
    spectrum,
    step_limit,
)
from taichi_disk.experiments.computation.step_control import LIMIT_MARGIN
from taichi_disk.mechanics.integrators import INTEGRATORS, VELOCITY_VERLET
from taichi_disk.mechanics.physics import ExponentialWall, Model, Springs


def oscillator(integrator, angle):
    """Return half the trace of a step of x'' = -x: within -1..1 if stable."""
    step = np.eye(2)
    for kick, move in zip(integrator.kicks, (*integrator.moves, 0.0), strict=True):
        force = angle * (1.0 - integrator.correction * angle**2)
        step = (
            np.array([[1.0, move * angle], [0.0, 1.0]])
            @ np.array([[1.0, 0.0], [-kick * force, 1.0]])
            @ step
        )
    return 0.5 * np.trace(step)


@pytest.mark.parametrize("integrator", INTEGRATORS.values(), ids=INTEGRATORS)
def test_an_oscillator_is_stable_up_to_the_limit_and_its_phase_has_the_stated_order(
    integrator,
):
    angles = np.linspace(0.01, integrator.stable - 1e-4, 2000)
    assert max(abs(oscillator(integrator, angle)) for angle in angles) <= 1.0 + 1e-12
    assert abs(oscillator(integrator, integrator.stable + 1e-3)) > 1.0
    errors = [
        abs(np.arccos(oscillator(integrator, angle)) / angle - 1.0)
        for angle in (0.4, 0.2)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(integrator.order, abs=0.1)
    assert sum(integrator.kicks) == pytest.approx(1.0, abs=1e-14)
    assert sum(integrator.moves) == pytest.approx(1.0, abs=1e-14)


def jacobian(model, x):
    """Return -df/dx (2n, 2n) by central differences of the reference's forces."""
    d = 1e-7
    still = np.zeros_like(x)
    columns = []
    for k in range(x.size):
        step = d * np.eye(1, x.size, k).reshape(x.shape)
        change = model.force(x - step, still) - model.force(x + step, still)
        columns.append(change.ravel() / (2 * d))
    return np.array(columns).T


@pytest.mark.parametrize(
    "lattice", [disk(40), non_uniform(disk(40), 0.2, 3.0)], ids=["equal", "non-uniform"]
)
def test_highest_frequency_and_damping_rate_are_those_of_the_matrices(lattice):
    model = Model(Springs(1.0, 1.0, 0.3))
    m = lattice.masses[:, None]
    limits = spectrum(lattice, model)
    plain = reference.Model(lattice, model)
    per_mass = jacobian(plain, lattice.positions) / np.repeat(m, 2, axis=0)
    omega2 = np.linalg.eigvals(per_mass).real.max()
    assert limits.omega**2 == pytest.approx(omega2, rel=1e-6)
    # Find the dashpots' matrix column by column as the force at a unit velocity.
    unit = np.eye(40)[:, :, None] * [1.0, 0.0]
    matrix = np.array([-plain.force(lattice.positions, v)[:, 0] for v in unit])
    assert limits.damping * 0.3 == pytest.approx(
        np.linalg.eigvals(matrix / m).real.max(), rel=1e-9
    )


@pytest.mark.parametrize(
    ("wall", "masses"),
    [
        (RIGID, (1.0, 1.0)),
        (RIGID, (0.2, 3.0)),
        pytest.param(ELASTIC, (0.2, 3.0), marks=pytest.mark.validate),
    ],
    ids=["rigid", "rigid, non-uniform", "elastic, non-uniform"],
)
def test_the_walls_stiffness_is_bounded_by_the_force_on_a_point(wall, masses):
    # omega^2 <= omega_lattice^2 + a F/m on a rigid wall (2 a F/m on an elastic one),
    # where F is the largest force on one point; exact where springs carry no force.
    for height in (0.02, 0.03, 0.05):
        plain = disk if wall is RIGID else partial(disk_and_wall, wall=45)
        lattice = non_uniform(plain(30, height=height), *masses)
        model = replace(FREE, wall=wall)
        other = reference.Model(lattice, model)
        x = lattice.positions
        force = np.abs(other.wall_force(x)[: lattice.disk_points]).max()
        per_mass = jacobian(other, x) / np.repeat(lattice.masses, 2)[:, None]
        omega = np.sqrt(np.linalg.eigvals(per_mass).real.max())
        limit = step_limit(spectrum(lattice, model), model, VELOCITY_VERLET, force)
        least = 0.6 if np.ptp(lattice.masses) == 0.0 else 0.3
        assert least < 0.5 * limit * omega < 1 + 1e-6


def swings(omega, rate, h):
    """Return the largest |x| in 4000 steps of x'' = -omega^2 x - rate x'."""
    x = 1.0
    v = 0.5 * h * omega**2
    a = -(omega**2)
    most = 0.0
    for _ in range(4000):
        u = v + 1.5 * h * a  # predicted for the end of the step
        v += h * a
        x += h * v
        a = -(omega**2) * x - rate * u
        most = max(most, abs(x))
        if most > 1e6:
            break
    return most


def test_the_explicit_limit_holds_for_every_mode_and_is_sharp_at_its_ends():
    assert explicit_limit(30.0, 0.0) == pytest.approx(2 / 30, rel=1e-3)
    assert explicit_limit(1e-3, 500.0) == pytest.approx(1 / 500, rel=1e-3)
    rng = np.random.default_rng(4)
    for damping in (0.0, 5.0, 30.0, 200.0):
        limit = explicit_limit(30.0, damping)
        for omega, rate in rng.random((12, 2)) * [30.0, damping]:
            assert swings(omega, rate, 0.98 * limit) < 1e4
        worst = [swings(30.0, r, 1.05 * limit) for r in (0, 0.5 * damping, damping)]
        assert max(worst) > 1e6


@pytest.mark.parametrize(
    "body", [disk(60), non_uniform(disk(60), 0.2, 3.0)], ids=["equal", "non-uniform"]
)
def test_a_hard_wall_is_expected_to_stop_the_heaviest_point_by_itself(body):
    a = 1e4
    speed = 0.3
    mass = body.masses.max()

    def motion(t, state):
        return state[1], 0.5 * a * np.exp(-a * state[0]) / mass

    start = 30.0 / a
    end = 2.0 * start / speed
    precise = {"rtol": 1e-10, "atol": 1e-12, "max_step": 0.1 / a}
    flight = solve_ivp(motion, (0.0, end), (start, -speed), **precise)
    assert flight.y[1, -1] == pytest.approx(speed, rel=1e-6)  # it has come back
    largest = (0.5 * a * np.exp(-a * flight.y[0])).max()
    model = Model(Springs(), ExponentialWall(a, 0.5))
    foreseen = impact_point_force(body, model, speed)
    # more than this point's part of the whole contact force
    assert foreseen == pytest.approx(largest, rel=1e-2)


@pytest.mark.validate
@pytest.mark.parametrize(("a", "speed"), [(100.0, 0.02), (3000.0, 0.1)])
def test_forces_on_a_point_are_known_as_well_as_step_margins_need(a, speed, kernels):
    settings = ("lattice.points=300", "time.safety=0.5", f"wall.a={a}")
    settings += (f"impact.velocity={speed}",)
    scenario, outcome = computed(kernels, "exponential_wall", *settings, estimate=False)
    integrator = INTEGRATORS[outcome.summary["integrator"]]
    # The wall's stiffness a F is at most all of omega^2, whose root sets the step.
    peak = outcome.largest_force
    limits = spectrum(scenario.lattice, scenario.model)
    assert 0.4 < peak / scenario.point_force < (LIMIT_MARGIN / 0.8) ** 2
    assert outcome.summary["dt_limit"] == step_limit(
        limits, scenario.model, integrator, peak
    )
