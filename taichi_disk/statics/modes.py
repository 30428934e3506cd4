"""Normal modes of the free disk, and the distribution over them of the energy of a
state, such as after an impact."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_disk.errors import InputError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import Model, Springs
from taichi_disk.statics.equilibrium import solve_equilibrium

# largest strain of a spring; a disk with more is first brought to equilibrium
MAX_STRAIN = 1e-9
_RIGID_MODES = 3  # modes of zero frequency: two translations and a rotation
# a dense solver is faster if more than this fraction of all modes is requested
_DENSE_FRACTION = 0.2


@dataclass(frozen=True)
class Modes:
    """The lowest normal modes of the free disk, and a state's energy in each.

    `energies`, `rest` and `anharmonic` add up to the energy without translation and
    rotation.
    """

    frequencies: Array  # (count,) angular frequencies, ascending [c/R]
    # (count, n, 2) displacements in the orientation at t = 0, with sum m shape^2 = 1 M
    shapes: Array
    energies: Array  # (count,) kinetic and elastic energy of each mode [M c^2]
    rest: float  # energy of all higher modes [M c^2]
    # Energy beyond the linear modes [M c^2]: changed directions of springs, k_b and,
    # with a spin, centrifugal forces.
    anharmonic: float


def modes(
    disk: Lattice, springs: Springs, positions: Array, velocities: Array, count: int
) -> Modes:
    """Compute `count` modes of the unloaded `disk`, and the energy that each has in a
    state (n, 2) [R], (n, 2) [c].

    The state is rotated into the frame of Eckart, Phys. Rev. 47, 552 (1935), where the
    sum of m x_0 × x is 0 and no mode contains rotation. Raises InputError unless
    `count` is from 1 to 2 n - 3.
    """
    most = 2 * len(disk.masses) - _RIGID_MODES
    if count not in range(1, most + 1):
        bounds = f"from 1 to {most}, the number of vibrations of this disk"
        raise InputError(f"count: must be a whole number {bounds}, not {count!r}")
    if np.abs(springs.strain(disk, disk.positions)).max() > MAX_STRAIN:
        disk = replace(
            disk,
            positions=solve_equilibrium(disk, Model(springs), disk.positions).positions,
        )
    masses, matrix = disk.masses, springs.stiffness(disk, disk.positions)
    frequencies, shapes = _vibrations(matrix, masses, count)

    # Vectors are complex numbers: conj(a) b is the dot product of a and b plus i times
    # their cross product.
    at_rest, x, v = (
        (a - disk.mean(a)) @ [1.0, 1.0j]
        for a in (disk.positions, positions, velocities)
    )
    inertia, momentum = (
        (masses * a.conj() * b).sum() for a, b in ((at_rest, at_rest), (x, v))
    )
    energy = 0.5 * float(masses @ np.abs(v) ** 2 - momentum.imag**2 / inertia.real)
    energy += springs.energy(disk, positions) - springs.energy(disk, disk.positions)

    overlap = (masses * at_rest.conj() * x).sum()
    rotation = abs(overlap) / overlap
    spin = (masses * at_rest.conj() * v * rotation).sum().imag / abs(overlap)
    u, w = (
        np.stack([a.real, a.imag], axis=1)
        for a in (x * rotation - at_rest, (v - 1j * spin * x) * rotation)
    )
    harmonic = 0.5 * float(
        (masses[:, None] * w * w).sum() + u.ravel() @ (matrix @ u.ravel())
    )
    q, p = (np.einsum("kij,i,ij->k", shapes, masses, a) for a in (u, w))
    energies = 0.5 * (p * p + (frequencies * q) ** 2)
    return Modes(
        frequencies,
        shapes,
        energies,
        harmonic - float(energies.sum()),
        energy - harmonic,
    )


def _vibrations(stiffness: Any, masses: Array, count: int) -> tuple[Array, Array]:
    """Return the `count` lowest frequencies above the rigid modes, and the shapes
    (count, n, 2)."""
    from scipy.linalg import eigh
    from scipy.sparse import diags
    from scipy.sparse.linalg import eigsh

    scale, solutions = 1.0 / np.sqrt(np.repeat(masses, 2)), count + _RIGID_MODES
    matrix = (diags(scale) @ stiffness @ diags(scale)).tocsc()
    if solutions > _DENSE_FRACTION * len(scale):
        squares, vectors = eigh(matrix.toarray(), subset_by_index=(0, solutions - 1))
    else:
        start = np.random.default_rng(0).standard_normal(len(scale))
        squares, vectors = eigsh(
            matrix, k=solutions, sigma=-1e-6 * matrix.diagonal().max(), v0=start
        )
    vibrations = squares.argsort()[_RIGID_MODES:]
    shapes = (scale[:, None] * vectors[:, vibrations]).T.reshape(count, -1, 2)
    return np.sqrt(np.maximum(squares[vibrations], 0.0)), shapes
