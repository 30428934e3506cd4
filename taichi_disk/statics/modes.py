"""The normal modes of the free disk, and what each of them holds of a state's energy: where that of an impact stays."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_disk.errors import InputError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model, Springs
from taichi_disk.statics.equilibrium import solve_equilibrium

STRAINED = 1e-9  # a disk with a spring of a larger strain is not at rest as it is given
_RIGID = 3  # modes without a frequency: two translations and the rotation
_MANY = 0.2  # of all modes, from which they are computed all at once


@dataclass(frozen=True)
class Modes:
    """The lowest normal modes of the free disk, and the energy of a state.

    `energies`, `rest` and `anharmonic` add up to all that is neither translation nor rotation.

    Attributes:
        frequencies: (count,) omega, ascending [c/R].
        shapes: (count, n, 2) displacements of the disk's points, as it lies at t = 0; the sum of m shape^2 is 1 M.
        energies: (count,) of each mode, kinetic and elastic [M c^2].
        rest: of all higher modes [M c^2].
        anharmonic: by which the energy differs from that of all modes [M c^2]: the springs' directions, and k_b. Of a
            disk that spins most of it is centrifugal, because the modes are those of the disk at rest.
    """

    frequencies: Array
    shapes: Array
    energies: Array
    rest: float
    anharmonic: float


def modes(disk: Lattice, springs: Springs, positions: Array, velocities: Array, count: int) -> Modes:
    """Modes of the `disk`, unloaded, and the energy of the state (n, 2) [R] and [c], turned back by its mean rotation.

    The frame is that of C. Eckart, Phys. Rev. 47, 552 (1935): the sum of m x_0 × x is 0,
    so that rotation is no part of any mode.

    Raises InputError unless `count` is from 1 to 2 n - 3.
    """
    if not 1 <= count <= 2 * len(disk.masses) - _RIGID:
        raise InputError(f"count: must be from 1 to {2 * len(disk.masses) - _RIGID}, not {count}")
    if np.abs(springs.strain(disk, disk.positions)).max() > STRAINED:
        disk = replace(disk, positions=solve_equilibrium(disk, Model(springs), disk.positions).positions)
    masses, matrix = disk.masses, springs.stiffness(disk, disk.positions)
    frequencies, shapes = _vibrations(matrix, masses, count)

    # A vector is a complex number: its product with the conjugate of another is dot + i cross.
    at_rest, x, v = ((one - disk.mean(one)) @ [1.0, 1.0j] for one in (disk.positions, positions, velocities))
    inertia, momentum = ((masses * a.conj() * b).sum() for a, b in ((at_rest, at_rest), (x, v)))
    energy = 0.5 * float(masses @ np.abs(v) ** 2 - momentum.imag**2 / inertia.real)
    energy += springs.energy(disk, positions) - springs.energy(disk, disk.positions)

    overlap = (masses * at_rest.conj() * x).sum()
    back = abs(overlap) / overlap
    spin = (masses * at_rest.conj() * v * back).sum().imag / abs(overlap)
    u, w = (np.stack([one.real, one.imag], axis=1) for one in (x * back - at_rest, (v - 1j * spin * x) * back))
    harmonic = 0.5 * float((masses[:, None] * w * w).sum() + u.ravel() @ (matrix @ u.ravel()))
    q, p = (np.einsum("kij,i,ij->k", shapes, masses, one) for one in (u, w))
    energies = 0.5 * (p * p + (frequencies * q) ** 2)
    return Modes(frequencies, shapes, energies, harmonic - float(energies.sum()), energy - harmonic)


def _vibrations(stiffness: Any, masses: Array, count: int) -> tuple[Array, Array]:
    """The lowest `count` frequencies but those of rigid motion, and the shapes (count, n, 2) of their modes."""
    from scipy.linalg import eigh
    from scipy.sparse import diags
    from scipy.sparse.linalg import eigsh

    scale, wanted = 1.0 / np.sqrt(np.repeat(masses, 2)), count + _RIGID
    matrix = (diags(scale) @ stiffness @ diags(scale)).tocsc()
    if wanted > _MANY * len(scale):
        squares, vectors = eigh(matrix.toarray(), subset_by_index=(0, wanted - 1))
    else:
        start = np.random.default_rng(0).standard_normal(len(scale))
        squares, vectors = eigsh(matrix, k=wanted, sigma=-1e-6 * matrix.diagonal().max(), v0=start)
    vibrations = squares.argsort()[_RIGID:]
    shapes = (scale[:, None] * vectors[:, vibrations]).T.reshape(count, -1, 2)
    return np.sqrt(np.maximum(squares[vibrations], 0.0)), shapes
