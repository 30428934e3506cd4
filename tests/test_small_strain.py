"""The linear lattice on a hard wall: the minimum of its energy above the wall, and near the continuum."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from taichi_disk import theory
from taichi_disk.lattice import disk_lattice
from taichi_disk.newton import laid_down, lowest_lie
from taichi_disk.stiffness import tangent_stiffness
from taichi_disk.study.small_strain import hard_compression


@pytest.mark.parametrize("pressure", [3e-3, 3e-2])
def test_it_is_the_least_energy_of_all_displacements_that_stay_above_the_wall(pressure):
    disk = disk_lattice(80, 3)
    x = laid_down(disk, lowest_lie(disk, 1.0, 1e9, pressure), 1.0, 1.0, 1.0).positions
    x = x - [x[:, 0].mean(), x[:, 1].min()]
    stiffness = tangent_stiffness(x, disk.bonds, disk.rest_lengths, 1.0, 0.0).toarray()
    # Neither slides nor rolls: u_x of one point is 0, u_y of two is the same.
    left, right = np.argmin(x[:, 0]), np.argmax(x[:, 0])
    tie = np.delete(np.eye(160), [2 * left, 2 * right + 1], axis=1)
    tie[2 * right + 1] = tie[2 * left + 1]
    reduced = tie.T @ stiffness @ tie
    load = tie.T @ np.tile([0.0, -pressure / 80], 80)
    low = np.full(160, -np.inf)
    low[1::2] = -x[:, 1]
    # As least squares: u.K u/2 - u.f = |A u - b|^2/2 + const, K = A^T A, b = A^-T f; softly grounded, or K is singular.
    root = np.linalg.cholesky(reduced + 1e-10 * np.eye(158)).T
    bounds = np.delete(low, [2 * left, 2 * right + 1]), np.full(158, np.inf)
    found = lsq_linear(root, np.linalg.solve(root.T, load), bounds, method="bvls", tol=1e-15)
    sink = -(tie @ found.x)[1::2].mean()
    assert hard_compression(disk, 1.0, [pressure]) == pytest.approx([sink], rel=1e-6)


def test_several_forces_are_as_one_by_one_and_the_contact_stiffens():
    disk = disk_lattice(400, 0)
    both = hard_compression(disk, 1.0, [2e-3, 1e-2])
    assert hard_compression(disk, 1.0, [1e-2]) == pytest.approx(both[1:], rel=1e-12)
    assert 3.5 < both[1] / both[0] < 5.0


@pytest.mark.validate
def test_fine_lattices_obey_the_exact_law_to_1_percent():
    E, nu = 1.1025, 0.287  # of 16 stretched samples of 17,600 points: +- 0.2 %
    xi = np.array([hard_compression(disk_lattice(70_400, seed), 1.0, [4e-3, 1e-2]) for seed in range(4)])
    law = theory.exact_compression([4e-3, 1e-2], E, nu)
    error = xi.std(axis=0, ddof=1) / 2.0
    assert (np.abs(xi.mean(axis=0) - law) < 0.01 * law + error).all()


def test_rim_springs_weigh_as_they_are_told():
    disk = disk_lattice(400, 0)
    outer = np.isin(disk.bonds, disk.disk_surface).all(axis=1)
    assert outer.sum() == len(disk.disk_surface)
    # A hoop of springs stiffens the disk: with half or a quarter of it, the disk gives way more.
    quarter, half, whole = (hard_compression(disk, 1.0, [4e-3], share)[0] for share in (0.25, 0.5, 1.0))
    assert quarter > half > whole and half / whole < 1.1
    assert whole == hard_compression(disk, 1.0, [4e-3])[0]
