"""tau0 of eq. (4) from the lattice itself: dissipated over elastic power at the same rate of deformation.

The dashpots are the matrix eta L (L the graph Laplacian, the same for x and y), the springs the matrix K. Where
all points move as du, tau0 = eta du.L du/(du.K du). It depends on the deformation: the dashpots also resist
shear and rotation, which springs resist less or not at all. Per unit of eta* = eta N, since m = 1/N.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.newton import compress, laid_down, lowest_lie
from taichi_disk.stiffness import laplacian, tangent_stiffness

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Viscosity:
    """tau0/eta* [R/c] of three deformations of one lattice."""

    stretch: float  # uniform, in x, with the lateral contraction of the bulk
    lowest_mode: float  # of the free disk
    contact: float  # of the disk pressed on the wall, its roll held


def measured_viscosity(
    seed: int, poisson: float, points: int = 1099, k_a: float = 1.0, pressure: float = 0.01, a: float = 300.0
) -> Viscosity:
    """Of the default lattice of `seed`; `poisson` is nu of the bulk. Raises SimulationError as `compress` does."""
    disk = disk_lattice(points, seed)
    springs = tangent_stiffness(disk.positions, disk.bonds, disk.rest_lengths, k_a, 0.0)
    uniform = disk.positions * np.array([1.0, -poisson])
    return Viscosity(
        stretch=_ratio(disk, springs, uniform),
        lowest_mode=_ratio(disk, springs, lowest_mode(disk, springs)),
        contact=contact_viscosity(seed, points, k_a, pressure, a),
    )


def lowest_mode(disk: Lattice, springs: object) -> Array:
    """(n, 2), the free disk's vibration of lowest frequency; points of equal mass."""
    from scipy.sparse.linalg import eigsh

    size = 2 * len(disk.positions)
    # Below zero, so that the shifted matrix can be factorised: three modes are rigid motions.
    start = np.random.default_rng(0).standard_normal(size)
    values, vectors = eigsh(springs, k=4, sigma=-1e-4, v0=start)
    return np.asarray(vectors[:, np.argmax(values)].reshape(-1, 2))


def _ratio(disk: Lattice, springs: object, motion: Array) -> float:
    damping = laplacian(disk.bonds, len(motion))
    flat = motion.ravel()
    lost = sum(float(motion[:, c] @ (damping @ motion[:, c])) for c in (0, 1))
    return lost / float(flat @ (springs @ flat)) / len(motion)  # type: ignore[operator]


def contact_viscosity(
    seed: int, points: int = 1099, k_a: float = 1.0, pressure: float = 0.01, a: float = 300.0
) -> float:
    """tau0/eta* [R/c] of the change of the pressed shape with the pressure, as in the middle of a slow impact.

    Of the default lattice of `seed`. Raises SimulationError as `compress` does.
    """
    from scipy.sparse import diags, identity
    from scipy.sparse.linalg import splu

    disk, V0 = disk_lattice(points, seed), 0.5 * a
    disk = laid_down(disk, lowest_lie(disk, k_a, a, pressure), a, V0, pressure)
    rest = compress(disk, k_a, 0.0, a, V0, pressure, start=disk.positions).positions
    springs = tangent_stiffness(rest, disk.bonds, disk.rest_lengths, k_a, 0.0)
    wall = np.zeros_like(rest)
    wall[:, 1] = a * a * V0 * np.exp(-a * rest[:, 1])
    held = springs + diags(wall.ravel()) + 1e-9 * identity(rest.size)
    factor = splu(held.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
    arm = rest - rest.mean(axis=0)
    turn = np.stack([-arm[:, 1], arm[:, 0]], axis=1).ravel()
    push = np.tile([0.0, -1.0 / len(rest)], len(rest))
    motion, roll = factor.solve(push), factor.solve(turn)
    # A slow impact is too short for the disk to roll: hold the rotation by the torque that this takes.
    motion -= roll * float(turn @ motion) / float(turn @ roll)
    return _ratio(disk, springs, motion.reshape(-1, 2))
