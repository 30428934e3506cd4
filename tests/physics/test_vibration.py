"""Where the energy of an impact goes: translation, rotation and the normal modes."""

from pathlib import Path

import numpy as np
import pytest
from bodies import FREE, SMALL, WALL, disk, non_uniform
from scipy.special import jn_zeros

from taichi_disk import Lattice, load_scene, run
from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.physics import Springs
from taichi_disk.mechanics.statics.modes import modes


@pytest.fixture(scope="module")
def thrown():
    """Return an impact without dashpots of a disk that spins a little."""
    scene = load_scene("exponential_wall", SMALL)
    return run(scene.with_(eta_star=0, velocity=0.05, spin=0.005), lattices=1)


def test_the_parts_of_the_kinetic_energy_are_those_of_the_states(thrown):
    series = thrown.series
    lattice = thrown.lattice
    times = series["t"][:: len(series["t"]) // 12]
    for t, x, v in zip(*thrown.trajectory(times), strict=True):
        row = int(np.abs(series["t"] - t).argmin())
        m = lattice.masses
        r = x - m @ x
        w = v - m @ v
        # with the present inertia
        spin = (m @ (r[:, 0] * w[:, 1] - r[:, 1] * w[:, 0])) / (m @ (r * r).sum(axis=1))
        rotation = spin * np.stack([-r[:, 1], r[:, 0]], axis=1)
        found = [series[name][row] for name in ("translation", "rotation", "vibration")]
        true = [
            0.5 * float(m @ (velocities * velocities).sum(axis=1))
            for velocities in (v - w, rotation, w - rotation)
        ]
        assert found[0] == pytest.approx(true[0], rel=1e-9)
        assert sum(found) == pytest.approx(sum(true), rel=1e-12)
        # The inertia of a flattened disk differs from the unloaded one.
        assert found[1:] == pytest.approx(true[1:], abs=0.02 * true[1])


def test_e_squared_is_one_minus_what_vibration_and_rotation_took(thrown):
    e = thrown.restitution
    energy = thrown.summary["energy"]
    series = thrown.series
    gained = energy["rotation"] - series["rotation"][0]
    gained /= series["translation"][0]
    assert e**2 == pytest.approx(1.0 - energy["vibration_left"] - gained, abs=2e-5)
    assert energy["vibration_left"] > 0.005
    assert abs(gained) > 1e-3


def test_all_modes_hold_all_of_the_vibration_but_for_what_is_anharmonic(thrown):
    last = {name: values[-1] for name, values in thrown.series.items()}
    vibration = last["vibration"] + last["elastic"]
    n = thrown.lattice.disk_points
    few = thrown.modes(20)
    all_modes = thrown.modes(2 * n - 3)
    assert few.frequencies == pytest.approx(all_modes.frequencies[:20])
    assert few.shapes.shape == (20, n, 2)
    assert few.energies == pytest.approx(all_modes.energies[:20], abs=1e-6 * vibration)
    assert all_modes.rest == pytest.approx(0.0, abs=1e-9 * vibration)
    for result in (few, all_modes):
        assert result.energies.sum() + result.rest + result.anharmonic == pytest.approx(
            vibration, rel=1e-9
        )
    assert 0.0 < abs(all_modes.anharmonic) < 0.05 * vibration
    assert few.rest < 0.2 * vibration


@pytest.mark.validate
def test_energy_of_the_elastic_wall_is_none_of_the_disk_s_modes():
    keys = {"material.eta_star": 0, "wall.boundary": "pinned"}
    thrown = run(load_scene("absorbing_wall", WALL).with_(keys), lattices=1)
    found = thrown.modes(20)
    series = thrown.series
    both = series["vibration"][-1] + series["elastic"][-1]
    assert 0.0 < found.energies.sum() + found.rest + found.anharmonic < 0.9 * both


@pytest.mark.validate
def test_a_state_is_made_of_the_modes_that_it_was_made_from():
    body = non_uniform(disk(60))
    springs = Springs()
    small = 1e-6
    all_modes = modes(body, springs, body.positions, np.zeros((60, 2)), 117)
    shapes = all_modes.shapes
    omega = all_modes.frequencies
    m = body.masses
    assert np.einsum("aij,i,bij->ab", shapes, m, shapes) == pytest.approx(
        np.eye(117), abs=1e-9
    )
    q, p = small * np.random.default_rng(1).standard_normal((2, 117))
    x = body.positions + np.einsum("a,aij->ij", q, shapes)
    v = np.einsum("a,aij->ij", p, shapes)
    c = np.cos(2.0)
    s = np.sin(2.0)
    turn = np.array([[c, s], [-s, c]])
    found = modes(body, springs, x @ turn + [3.0, 0.4], v @ turn + [0.3, -0.1], 117)
    energies = 0.5 * (p**2 + (omega * q) ** 2)
    assert found.energies == pytest.approx(energies, abs=1e-4 * energies.max())
    assert abs(found.anharmonic) < 1e-3 * energies.sum()


def test_a_spin_and_a_flight_are_no_part_of_any_mode():
    body = disk(60)
    arm = body.positions - body.mean(body.positions)
    v = 0.1 * np.stack([-arm[:, 1], arm[:, 0]], axis=1) + [0.2, -0.3]
    found = modes(body, Springs(), body.positions, v, 40)
    assert found.energies.max() < 1e-25
    assert abs(found.rest) < 1e-15
    assert abs(found.anharmonic) < 1e-15


def test_a_body_that_is_strained_as_given_vibrates_about_its_rest():
    body = disk(60)
    longer = Lattice.from_points(
        body.positions, body.bonds, rest_lengths=1.01 * body.rest_lengths
    )
    found, plain = (
        modes(lattice, FREE.springs, 1.01 * lattice.positions, np.zeros((60, 2)), 10)
        for lattice in (longer, body)
    )
    assert found.energies.sum() + found.rest < 1e-12 < 1e-6 < plain.energies.sum()
    assert found.frequencies == pytest.approx(plain.frequencies, rel=1e-6)


def test_frequencies_are_those_of_the_continuum(monkeypatch):
    monkeypatch.syspath_prepend(Path(__file__).parents[2] / "docs" / "experiments")
    from disk_modes import exact_frequency, vibrations

    # A hexagonal lattice has E = 2/sqrt(3) k_a and nu = 1/3 exactly.
    young = 2.0 / np.sqrt(3.0)
    poisson = 1.0 / 3.0
    i, j = np.meshgrid(*2 * [np.arange(-60, 61)])
    points = 0.04 * np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=-1).reshape(-1, 2)
    body = Lattice.from_points(points[np.hypot(*points.T) <= 1.0])
    found = modes(body, Springs(), body.positions, 0.0 * body.positions, 14).frequencies
    shear = np.sqrt(0.5 * np.pi * young / (1.0 + poisson))
    exact = [shear * jn_zeros(2, 1)[0]]  # torsion
    for order in range(8):
        twice = 1 if order == 0 else 2  # sin and cos
        for near in vibrations(order, 8, young, poisson)[0][:3]:
            if near > 0.1:
                exact += twice * [exact_frequency(order, near, young, poisson)]
    assert found == pytest.approx(np.sort(exact)[:14], rel=0.011)


def test_a_wrong_count_is_refused(thrown):
    for count in (0, 1.5, 2 * thrown.lattice.disk_points - 2):
        text = rf"count: must be a whole number from 1 to .*, not {count}"
        with pytest.raises(InputError, match=text):
            thrown.modes(count)
