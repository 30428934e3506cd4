"""What a free lattice keeps, and small bodies whose motion is known in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from worlds import again, by_hand, disk

from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Physics

pytestmark = pytest.mark.usefixtures("taichi")

VV, TRAPEZOIDAL = "velocity_verlet", "trapezoidal"


def world_of(lattice, physics, velocities, dt):
    from taichi_disk.model.world import World

    return World(lattice, physics, velocities[None], dt)


def momenta(mass, x, v):
    return mass * v.sum(axis=0), mass * np.sum(x[:, 0] * v[:, 1] - x[:, 1] * v[:, 0])


@pytest.mark.parametrize(("eta_star", "integrator"), [(0.0, VV), (50.0, VV), (50.0, TRAPEZOIDAL)])
def test_a_free_disk_keeps_its_momentum(eta_star, integrator):
    # Every force comes in pairs: linear momentum to rounding, with dashpots too. Central forces make no torque, so
    # that angular momentum stays as well; vector dashpots resist rotation, so that it does not with them.
    lattice = disk(80)
    m = lattice.masses[0]
    x, v = lattice.positions, np.random.default_rng(0).standard_normal((80, 2)) * 0.05 + [0.3, -0.2]
    x = x + 0.02 * np.random.default_rng(1).standard_normal((80, 2))
    world = world_of(replace(lattice, positions=x), Physics(k_b=1.0, eta=eta_star / 80, integrator=integrator), v, 1e-3)
    linear, angular = momenta(m, x, v)
    row = dict(zip(COLUMNS, world.advance(1, 3000)[0, :, 0], strict=True))
    after, spin = momenta(m, world.positions()[0], world.velocities()[0])
    np.testing.assert_allclose(after, linear, rtol=0, atol=1e-12)
    np.testing.assert_allclose([row["com_vx"], row["com_vy"]], linear, rtol=0, atol=1e-12)
    # The centre of mass flies straight: x_0 + v t.
    np.testing.assert_allclose([row["com_x"], row["com_y"]], x.mean(axis=0) + 3.0 * linear, rtol=0, atol=1e-12)
    arm = world.positions()[0] - world.positions()[0].mean(axis=0)
    own = m * np.sum(arm[:, 0] * world.velocities()[0][:, 1] - arm[:, 1] * world.velocities()[0][:, 0])
    assert row["angular_momentum"] == pytest.approx(own, abs=1e-13)
    if eta_star == 0.0:
        assert spin == pytest.approx(angular, abs=1e-12)
    else:
        assert abs(spin - angular) > 1e-6
        assert row["kinetic"] < 0.5 * m * np.sum(v**2)
    world.destroy()


def test_a_disk_in_translation_feels_nothing():
    lattice = disk(60)
    v = np.tile([0.4, -0.7], (60, 1))
    world = world_of(lattice, Physics(eta=1.0), v, 1e-3)
    world.advance(1, 500)
    np.testing.assert_allclose(world.positions()[0], lattice.positions + 0.5 * v, rtol=0, atol=1e-13)
    world.destroy()


@pytest.mark.parametrize("integrator", [VV, pytest.param(TRAPEZOIDAL, marks=pytest.mark.validate)])
def test_dashpots_brake_a_rotation(integrator):
    # The dashpot takes the full relative velocity, eq. (3): v_i - v_j = Omega x r_ij. Power eta Omega^2 sum r_ij^2,
    # torque -eta Omega sum r_ij^2. (A dashpot along the spring would leave a rotation alone.)
    lattice = disk(60)
    eta, spin, h, steps = 0.05, 0.02, 1e-5, 20
    x = lattice.positions - lattice.positions.mean(axis=0)
    v = spin * np.stack([-x[:, 1], x[:, 0]], axis=1)
    world = world_of(replace(lattice, positions=x), Physics(eta=eta, integrator=integrator), v, h)
    start = dict(zip(COLUMNS, world.first_row[:, 0], strict=True))
    end = dict(zip(COLUMNS, world.advance(1, steps)[0, :, 0], strict=True))
    squares, t = np.sum(lattice.rest_lengths**2), steps * h
    assert start["angular_momentum"] == pytest.approx(spin * np.sum(x**2) / 60, rel=1e-12)
    # The rates at t = 0; they change once the disk is no longer in rigid rotation, after 1/(11 eta/m) ~ 0.03 R/c.
    loss = start["angular_momentum"] - end["angular_momentum"]
    assert loss == pytest.approx(eta * spin * squares * t, rel=1e-2)
    assert end["dissipated"] == pytest.approx(eta * spin**2 * squares * t, rel=1e-2)
    world.destroy()


def test_two_points_on_a_spring_swing_as_leapfrog_must():
    # s'' = -(2 k/m) s. Leapfrog's own solution is s_k = s_0 cos(k theta), theta = 2 asin(h omega/2), exactly, up to
    # its limit h omega = 2.
    m, k, length, s0 = 0.3, 1.7, 0.8, 0.05
    lattice = by_hand([(0.0, 0.0), (length, 0.0)], [(0, 1)], m)
    stretched = replace(lattice, positions=np.array([[-s0 / 2, 0.0], [length + s0 / 2, 0.0]]))
    omega = np.sqrt(2 * k / m)
    world = world_of(stretched, Physics(k_a=k), np.zeros((2, 2)), 1.0)
    for h in (0.01, 1.9 / omega):
        again(world, stretched.positions[None], np.zeros((1, 2, 2)), h)
        theta = 2 * np.arcsin(h * omega / 2)
        for steps in (1, 7, 300):
            again(world, stretched.positions[None], np.zeros((1, 2, 2)), h)
            world.advance(1, steps)
            x = world.positions()[0, :, 0]
            assert x[1] - x[0] - length == pytest.approx(s0 * np.cos(steps * theta), abs=1e-12)
            v = world.velocities()[0, :, 0]
            # v_k = (x_{k+1} - x_{k-1})/2h
            expected = -s0 * np.sin(steps * theta) * np.sin(theta) / h
            assert v[1] - v[0] == pytest.approx(expected, abs=1e-11)
    world.destroy()


@pytest.mark.parametrize("integrator", [TRAPEZOIDAL, pytest.param(VV, marks=pytest.mark.validate)])
def test_two_points_with_a_dashpot_swing_down(integrator):
    # s'' = -(2 k/m) s - (2 eta/m) s': s = s_0 exp(-g t) (cos w t + g/w sin w t), g = eta/m, w^2 = 2 k/m - g^2.
    m, k, eta, length, s0 = 0.3, 1.7, 0.2, 0.8, 0.05
    lattice = by_hand([(0.0, 0.0), (length, 0.0)], [(0, 1)], m)
    stretched = replace(lattice, positions=np.array([[-s0 / 2, 0.0], [length + s0 / 2, 0.0]]))
    world = world_of(stretched, Physics(k_a=k, eta=eta, integrator=integrator), np.zeros((2, 2)), 1e-3)
    world.advance(1, 1500)
    g = eta / m
    w = np.sqrt(2 * k / m - g * g)
    t = 1.5
    exact = s0 * np.exp(-g * t) * (np.cos(w * t) + g / w * np.sin(w * t))
    x = world.positions()[0, :, 0]
    # h^2 omega^2/24 of phase per radian: about 2e-6 of s_0.
    assert x[1] - x[0] - length == pytest.approx(exact, abs=1e-5 * s0)
    world.destroy()


def test_three_points_breathe():
    # Equilateral triangle: three springs stretched alike pull each corner inwards with 3 k rho: omega^2 = 3 k/m.
    m, rho = 0.5, 0.04
    angle = np.pi / 2 + np.arange(3) * 2 * np.pi / 3
    corner = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    lattice = by_hand([tuple(c) for c in corner], [(0, 1), (0, 2), (1, 2)], m)
    world = world_of(replace(lattice, positions=(1 + rho) * corner), Physics(), np.zeros((3, 2)), 0.05)
    world.advance(1, 200)
    theta = 2 * np.arcsin(0.05 * np.sqrt(3 / m) / 2)
    expected = (1 + rho * np.cos(200 * theta)) * corner
    np.testing.assert_allclose(world.positions()[0], expected, rtol=0, atol=1e-12)
    world.destroy()


def test_a_body_of_two_level_points_bounces_as_a_particle_on_an_exponential_wall():
    # m y'' = a V0 exp(-a y): exp(-a y) = (m v^2/2 V0) / cosh^2(a v (t - t_0)/2), t_0 the turning time.
    m, a, V0, v = 0.4, 20.0, 3.0, 0.5
    crest = m * v * v / (2 * V0)

    def height(t):
        return (2 * np.log(np.cosh(a * v * t / 2)) - np.log(crest)) / a

    lattice = by_hand([(0.0, height(-0.8)), (1.0, height(-0.8))], [(0, 1)], m)
    down = np.array([[0.0, -v * np.tanh(a * v * 0.8 / 2)]] * 2)
    world = world_of(lattice, Physics(wall="rigid", a=a, V0=V0), down, 1e-3)
    for t in (-0.4, 0.0, 0.1, 0.8):
        world.advance(1, round((t + 0.8) / 1e-3) - world.step_number)
        # Phase error (h a v)^2/24 ~ 4e-6.
        np.testing.assert_allclose(world.positions()[0, :, 1], height(t), rtol=0, atol=3e-6)
        np.testing.assert_allclose(world.velocities()[0, :, 1], v * np.tanh(a * v * t / 2), rtol=0, atol=3e-5)
    world.destroy()


def test_a_load_makes_a_disk_fall():
    # P/N on every point: com falls by P t^2/2 (M = 1), whatever the springs do; without a wall, no force else.
    lattice = disk(60)
    world = world_of(lattice, Physics(load=0.3), np.zeros((60, 2)), 1e-3)
    row = dict(zip(COLUMNS, world.advance(1, 400)[0, :, 0], strict=True))
    assert row["com_y"] - lattice.positions[:, 1].mean() == pytest.approx(-0.5 * 0.3 * 0.4**2, rel=1e-10)
    assert row["com_vy"] == pytest.approx(-0.3 * 0.4, rel=1e-10)
    assert row["load"] == pytest.approx(0.3 * row["com_y"], rel=1e-12)
    world.destroy()
