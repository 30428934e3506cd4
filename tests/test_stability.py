"""The stability limit of the step: what lies below stays bounded, what lies above blows up or is refused."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest
from reference import Model
from worlds import disk, disk_and_wall

from taichi_disk.dynamics import MARGIN
from taichi_disk.errors import InputError
from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import explicit_limit, spectrum, step_limit
from taichi_disk.progress import QuietProgress
from taichi_disk.scene import TimeSection
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build
from taichi_disk.simulate import make_world, simulate
from taichi_disk.study.endurance import ABOVE, BELOW, BOUNDED, DRIFTS, LIMITS, Rest, drift
from taichi_disk.time_step import choose

VV, TRAPEZOIDAL, VEFRL = "velocity_verlet", "trapezoidal", "vefrl"
N = 60


@pytest.mark.parametrize("pressed", [False, True], ids=["free", "pressed on the wall"])
@pytest.mark.parametrize(
    ("integrator", "eta_star"),
    [pytest.param(*one, marks=() if one == (VV, 0.0) else pytest.mark.validate) for one in LIMITS],
)
@pytest.mark.usefixtures("taichi")
def test_steps_below_the_limit_stay_bounded_and_above_blow_up(integrator, eta_star, pressed):
    world = None
    for k_a in (1e-3, 1.0, 1e3):
        rest = Rest(integrator, eta_star, k_a, pressed)
        # Beside the wall the limit stated is on the safe side of the true one.
        assert 0.8 < rest.limit.stated / rest.limit.true < 1.0 + 2e-4
        world = rest.world(0.98 * rest.limit.stated, world)
        assert rest.growth(world, BELOW) < (BOUNDED, BELOW + 1)
        world = rest.world(1.05 * rest.limit.true, world)
        assert rest.growth(world, ABOVE)[1] < ABOVE
        if eta_star:
            assert rest.factor(0.98 * rest.limit.true) < 1.0 + 1e-6 < rest.factor(1.05 * rest.limit.true)
    world.destroy()


@cache
def wander(*case):
    return drift(*case)


@pytest.mark.validate
@pytest.mark.parametrize(("integrator", "bouncing", "fraction", "steps"), DRIFTS)
@pytest.mark.usefixtures("taichi")
def test_energy_does_not_drift_in_a_million_steps(integrator, bouncing, fraction, steps):
    energy, modified = wander(integrator, bouncing, fraction, steps)
    # Leapfrog's energy swings by up to (h omega/2)^2 for the fastest mode, the mean over all modes far less.
    assert energy.swing < 0.25
    if bouncing:
        # Some 2,500 bounces, each with the error of an impact; and see below.
        assert abs(energy.slope) < 0.02
    else:
        assert abs(energy.slope) < 4.0 * energy.slope_error
        assert energy.slope_error < 2e-3
    if modified is not None:
        assert modified.swing < 0.5 * energy.swing


@pytest.mark.validate
@pytest.mark.usefixtures("taichi")
def test_what_energy_bounces_lose_to_fast_modes_is_of_order_2_and_the_modified_energy_keeps_it_to_order_4():
    # Leapfrog conserves E + (h omega)^2 E/24 of a mode: as the bounces' energy goes over to faster modes, E falls.
    coarse, fine = wander(VV, True, 0.4, 1_000_000), wander(VV, True, 0.2, 2_000_000)
    assert coarse[0].slope < -3.0 * coarse[0].slope_error
    # The motion is chaotic: another step gives another course of the same kind.
    assert np.log2(coarse[0].swing / fine[0].swing) == pytest.approx(2.0, abs=0.5)
    assert np.log2(coarse[1].swing / fine[1].swing) == pytest.approx(4.0, abs=0.5)


def oscillator(splitting, angle):
    """Half the trace of one step of x'' = -x by h = `angle`: cos of the phase it turns by, at most 1 while stable."""
    step = np.eye(2)
    for kick, move in zip(splitting.kicks, (*splitting.moves, 0.0), strict=True):
        step = np.array([[1.0, move * angle], [0.0, 1.0]]) @ np.array([[1.0, 0.0], [-kick * angle, 1.0]]) @ step
    return 0.5 * np.trace(step)


@pytest.mark.parametrize("splitting", SPLITTINGS.values(), ids=SPLITTINGS)
def test_an_oscillator_is_stable_up_to_the_stated_limit_and_its_phase_has_the_stated_order(splitting):
    angles = np.linspace(0.01, splitting.stable - 1e-4, 2000)
    assert max(abs(oscillator(splitting, angle)) for angle in angles) <= 1.0 + 1e-12
    assert abs(oscillator(splitting, splitting.stable + 1e-3)) > 1.0
    errors = [abs(np.arccos(oscillator(splitting, angle)) / angle - 1.0) for angle in (0.4, 0.2)]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(splitting.order, abs=0.1)
    assert sum(splitting.kicks) == pytest.approx(1.0, abs=1e-14)
    assert sum(splitting.moves) == pytest.approx(1.0, abs=1e-14)


def jacobian(model, x):
    """-df/dx (2n, 2n) by central differences of the reference's forces."""
    d, still = 1e-7, np.zeros_like(x)
    columns = []
    for k in range(x.size):
        step = np.zeros(x.size)
        step[k] = d
        step = step.reshape(x.shape)
        columns.append((model.force(x - step, still) - model.force(x + step, still)).ravel() / (2 * d))
    return np.array(columns).T


def test_highest_frequency_and_damping_rate_are_those_of_the_matrices():
    lattice = disk(40)
    physics = Physics(k_b=1.0, eta=0.3)
    modes = spectrum(lattice, physics)
    model, m = Model.of(lattice, physics), lattice.masses[0]
    stiffness = jacobian(model, lattice.positions)
    assert modes.omega**2 == pytest.approx(np.linalg.eigvals(stiffness).real.max() / m, rel=1e-6)
    # The dashpots' matrix, column by column: force of a unit velocity.
    unit = np.eye(40)[:, :, None] * [1.0, 0.0]
    matrix = np.array([-model.force(lattice.positions, v)[:, 0] for v in unit])
    assert modes.damping * 0.3 == pytest.approx(np.linalg.eigvalsh(matrix).max() / m, rel=1e-9)


@pytest.mark.parametrize("wall", ["rigid", "elastic"])
def test_wall_stiffness_is_bounded_by_the_force_on_a_point(wall):
    # omega^2 <= omega_lattice^2 + a F/m beside a rigid wall (twice that against an elastic one), F the largest force
    # on one point: exact for the undeformed lattice, whose springs carry nothing.
    for height in (0.02, 0.03, 0.05):
        lattice = disk(30, height=height) if wall == "rigid" else disk_and_wall(30, 45, height=height)
        physics = Physics(wall=wall)
        model = Model.of(lattice, physics)
        x, m = lattice.positions, lattice.masses[0]
        pushes = [300.0 * 150.0 * np.exp(-300.0 * c[4]) for c in model.contacts(x)]
        force = max(pushes) if wall == "elastic" else 300.0 * 150.0 * np.exp(-300.0 * x[:, 1].min())
        omega = np.sqrt(np.linalg.eigvals(jacobian(model, x)).real.max() / m)
        limit = step_limit(spectrum(lattice, physics), physics, force)
        assert 0.6 * 2.0 / omega < limit < 2.0 / omega * (1 + 1e-6)


@pytest.mark.usefixtures("taichi")
def test_the_force_on_a_point_is_foreseen_as_well_as_the_margin_of_the_step_asks():
    world = None
    for a, v in product((100.0, 300.0, 1000.0, 3000.0), (0.02, 0.1)):
        setup = build(load_scene("exponential_wall", ["lattice.points=300", f"wall.a={a}", f"impact.velocity={v}"]))
        step = choose(TimeSection(safety=0.5), setup.physics, spectrum(setup.lattice, setup.physics), setup.point_force)
        world = make_world(setup, step, world)
        force = simulate(setup, world, step, setup.sample_interval, QuietProgress()).peak_point_force
        # The wall's stiffness a F makes up at most all of omega^2, and the step goes as its root.
        assert 0.4 < force / setup.point_force < (MARGIN / TimeSection().safety) ** 2
    world.destroy()


def swings(omega, rate, h, steps=4000):
    """Largest |x| of x'' = -omega^2 x - rate x' under velocity_verlet as `model.world` states it."""
    x, v, a, most = 1.0, 0.0, -(omega**2), 0.0
    v -= h / 2 * a
    for _ in range(steps):
        u = v + h * a + h / 2 * a  # predicted for the end of the step
        v += h * a
        x += h * v
        a = -(omega**2) * x - rate * u
        most = max(most, abs(x))
        if most > 1e6:
            break
    return most


def test_explicit_limit_holds_for_every_mode_and_is_sharp_at_its_ends():
    assert explicit_limit(30.0, 0.0) == pytest.approx(2 / 30, rel=1e-3)
    assert explicit_limit(1e-3, 500.0) == pytest.approx(1 / 500, rel=1e-3)
    rng = np.random.default_rng(4)
    for damping in (0.0, 5.0, 30.0, 200.0):
        limit = explicit_limit(30.0, damping)
        for omega, rate in zip(30.0 * rng.random(12), damping * rng.random(12), strict=True):
            assert swings(omega, rate, 0.98 * limit) < 1e4
        assert max(swings(30.0, r, 1.05 * limit) for r in (0.0, 0.5 * damping, damping)) > 1e6


def modes_and_physics(eta_star=0.0, **changes):
    lattice = disk(N)
    physics = Physics(eta=eta_star / N, wall="rigid", **changes)
    return spectrum(lattice, physics), physics


def test_a_step_beyond_the_limit_is_refused_with_the_limit_named_unless_forced():
    modes, physics = modes_and_physics()
    limit = choose(TimeSection(), physics, modes, 0.01).limit
    with pytest.raises(InputError, match=f"{limit:.6g}"):
        choose(TimeSection(dt=1.001 * limit), physics, modes, 0.01)
    assert choose(TimeSection(dt=1.001 * limit), physics, modes, 0.01, force=True).dt == 1.001 * limit
    assert choose(TimeSection(dt=0.999 * limit), physics, modes, 0.01).dt == 0.999 * limit
    assert choose(TimeSection(safety=0.5), physics, modes, 0.01).dt == pytest.approx(0.5 * limit, rel=1e-12)


def test_the_automatic_integrator_takes_strong_dashpots_implicitly():
    for eta_star, expected in ((0.0, VV), (1.0, VV), (100.0, TRAPEZOIDAL)):
        modes, physics = modes_and_physics(eta_star)
        assert choose(TimeSection(), physics, modes, 0.01).integrator == expected
        for asked in (VV, TRAPEZOIDAL):
            assert choose(TimeSection(integrator=asked), physics, modes, 0.01).integrator == asked


@pytest.mark.parametrize("points", [60, 1_000_000], ids=["a factor", "sweeps"])
def test_dashpots_are_taken_implicitly_where_a_solve_costs_less_than_the_steps_that_it_saves(points):
    # A step with a factor costs 2.8 explicit ones at this size, one with K sweeps 0.94 + 0.42 K: 2.2 and 3.5 here.
    for eta_star, saved, expected in ((1.5, 2.03, VV), (6.0, 6.3, TRAPEZOIDAL)):
        modes, physics = modes_and_physics(eta_star)
        implicit = step_limit(modes, replace(physics, integrator=TRAPEZOIDAL), 0.0)
        assert implicit / step_limit(modes, physics, 0.0) == pytest.approx(saved, rel=0.01)
        assert choose(TimeSection(), physics, replace(modes, points=points), 0.0).integrator == expected


@pytest.mark.parametrize("interval", [3e-3, 0.02, 0.05, 0.0777, 0.3, 1.0])
def test_a_whole_number_of_steps_fits_the_reset_interval(interval):
    modes, physics = modes_and_physics()
    physics = replace(physics, boundary="reset", reset_interval=interval)
    step = choose(TimeSection(), physics, modes, 0.01)
    count = interval / step.dt
    assert count == pytest.approx(round(count), abs=1e-9)
    assert step.dt <= 0.8 * step.limit * (1 + 1e-12)
    assert round(count) == 1 or interval / (round(count) - 1) > 0.8 * step.limit
    # What was taken, written as dt, is taken again, however the division was rounded.
    for part in range(1, 100):
        dt = interval / part
        assert choose(TimeSection(dt=dt), physics, modes, 0.01, force=True).dt == dt
