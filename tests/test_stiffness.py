"""The spring network's mechanics against central differences, dense algebra and the laws of mechanics."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.lattice import disk_lattice
from taichi_disk.stiffness import (
    laplacian,
    largest_eigenvalue,
    spring_energy,
    spring_forces,
    tangent_stiffness,
)

K_A, K_B = 1.3, 40.0  # a cubic term that matters at the strains below
DISK = disk_lattice(60, 0)
SPRINGS = (DISK.bonds, DISK.rest_lengths, K_A, K_B)
STRAINED = DISK.positions + 0.03 * np.random.default_rng(1).standard_normal(DISK.positions.shape)


def turned(x, angle):
    c, s = np.cos(angle), np.sin(angle)
    return x @ np.array([[c, s], [-s, c]])


def test_energy_is_the_sum_over_bonds():
    # U = sum k_a s^2/2 + k_b s^4/4, bond by bond.
    total = 0.0
    for (i, j), rest in zip(DISK.bonds, DISK.rest_lengths, strict=True):
        s = np.linalg.norm(STRAINED[i] - STRAINED[j]) - rest
        total += K_A * s**2 / 2 + K_B * s**4 / 4
    assert spring_energy(STRAINED, *SPRINGS) == pytest.approx(total, rel=1e-13)


def test_forces_are_minus_the_gradient_of_the_energy():
    force = spring_forces(STRAINED, *SPRINGS)
    step = 1e-5  # truncation ~ step^2 = 1e-10, rounding ~ 1e-16 U/step = 1e-11
    for i in range(0, 60, 7):
        for a in (0, 1):
            shift = np.zeros_like(STRAINED)
            shift[i, a] = step
            ahead, behind = (spring_energy(STRAINED + sign * shift, *SPRINGS) for sign in (1, -1))
            assert force[i, a] == pytest.approx(-(ahead - behind) / (2 * step), abs=1e-7 * np.abs(force).max())


def test_stiffness_is_minus_the_derivative_of_the_forces():
    tangent = tangent_stiffness(STRAINED, *SPRINGS).toarray()
    step = 1e-5
    for k in range(0, 120, 11):
        shift = np.zeros(120)
        shift[k] = step
        ahead, behind = (spring_forces(STRAINED + sign * shift.reshape(-1, 2), *SPRINGS) for sign in (1, -1))
        column = -(ahead - behind).ravel() / (2 * step)
        assert tangent[:, k] == pytest.approx(column, abs=1e-7 * np.abs(column).max())
    assert np.abs(tangent - tangent.T).max() < 1e-15 * np.abs(tangent).max()


def test_energy_does_not_change_and_forces_turn_under_rigid_motion():
    moved = turned(STRAINED, 1.1) + np.array([3.0, -2.0])
    assert spring_energy(moved, *SPRINGS) == pytest.approx(spring_energy(STRAINED, *SPRINGS), rel=1e-12)
    expected = turned(spring_forces(STRAINED, *SPRINGS), 1.1)
    assert spring_forces(moved, *SPRINGS) == pytest.approx(expected, abs=1e-13)


def test_forces_have_no_resultant_and_no_torque():
    force = spring_forces(STRAINED, *SPRINGS)
    torque = STRAINED[:, 0] * force[:, 1] - STRAINED[:, 1] * force[:, 0]
    assert np.abs(force.sum(axis=0)).max() < 1e-13
    assert abs(torque.sum()) < 1e-13


def test_unloaded_disk_has_no_force_and_just_three_rigid_modes():
    assert np.abs(spring_forces(DISK.positions, *SPRINGS)).max() == 0.0
    value = np.linalg.eigvalsh(tangent_stiffness(DISK.positions, *SPRINGS).toarray())
    assert np.abs(value[:3]).max() < 1e-12
    assert value[3] > 1e-3


def test_laplacian_is_degree_minus_adjacency():
    dense = np.zeros((60, 60))
    for i, j in DISK.bonds:
        dense[[i, j], [i, j]] += 1
        dense[i, j] = dense[j, i] = -1
    assert (laplacian(DISK.bonds, 60).toarray() == dense).all()


@pytest.mark.parametrize("points", [5, 60, 300])
def test_largest_eigenvalue_is_that_of_the_dense_matrix(points):
    disk = disk_lattice(points, 0)
    masses = np.random.default_rng(0).uniform(0.5, 1.5, points) / points
    stiffness = tangent_stiffness(1.01 * disk.positions, disk.bonds, disk.rest_lengths, K_A, K_B)
    for matrix, each in ((stiffness, 2), (laplacian(disk.bonds, points), 1)):
        root = np.sqrt(np.repeat(masses, each))
        dense = np.linalg.eigvalsh(matrix.toarray() / root / root[:, None])[-1]
        assert largest_eigenvalue(matrix, masses) == pytest.approx(dense, rel=1e-9)


def test_largest_eigenvalue_repeats_to_the_bit():
    disk = disk_lattice(1099, 0)
    stiffness = tangent_stiffness(disk.positions, disk.bonds, disk.rest_lengths, 1.0, 1e-3)
    assert largest_eigenvalue(stiffness, disk.masses) == largest_eigenvalue(stiffness, disk.masses)


def test_chain_of_springs_has_the_frequencies_of_the_textbook():
    # n points in a row, springs k, masses m: omega_max^2 = 4 k/m cos^2(pi/(2 n)).
    n = 200
    positions = np.stack([np.arange(n), np.zeros(n)], axis=1).astype(float)
    bonds = np.stack([np.arange(n - 1), np.arange(1, n)], axis=1).astype(np.int32)
    stiffness = tangent_stiffness(positions, bonds, np.ones(n - 1), 3.0, 0.0)
    expected = 4 * 3.0 / 0.5 * np.cos(np.pi / (2 * n)) ** 2
    assert largest_eigenvalue(stiffness, np.full(n, 0.5)) == pytest.approx(expected, rel=1e-9)
