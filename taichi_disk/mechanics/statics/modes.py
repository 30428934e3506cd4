"""Normal modes of the free disk, and the distribution over them of the energy of a
state, such as after an impact."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.base.errors import whole_number
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.network import softest_modes
from taichi_disk.mechanics.physics import Springs
from taichi_disk.mechanics.statics.equilibrium import relaxed

_RIGID_MODES = 3  # modes of zero frequency: two translations and a rotation


@dataclass(frozen=True)
class Modes:
    """The lowest normal modes of the free disk, and a state's energy in each.

    `energies`, `rest` and `anharmonic` add up to the energy without translation and
    rotation.

    Attributes:
        frequencies: (count,) angular frequencies, ascending [c/R].
        shapes: (count, n, 2) displacements in the orientation at t = 0, with
            sum m shape^2 = 1 M.
        energies: (count,) kinetic and elastic energy of each mode [M c^2].
        rest: energy of all higher modes [M c^2].
        anharmonic: energy beyond the linear modes [M c^2]: changed directions of
            springs, k_b and, with a spin, centrifugal forces.
    """

    frequencies: Array
    shapes: Array
    energies: Array
    rest: float
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
    whole_number(count, "count", most, meaning=", the vibrations of this disk")
    disk = relaxed(disk, springs)
    masses = disk.masses
    stiffness = springs.stiffness(disk, disk.positions)
    frequencies, shapes = _vibrations(stiffness, masses, count)
    at_rest = _complex(disk, disk.positions)
    x = _complex(disk, positions)
    v = _complex(disk, velocities)
    strained = springs.energy(disk, positions) - springs.energy(disk, disk.positions)
    energy = _inner_kinetic(masses, at_rest, x, v) + strained
    displacement, velocity = _in_eckart_frame(masses, at_rest, x, v)
    u = displacement.ravel()
    twice_kinetic = (masses[:, None] * velocity * velocity).sum()
    twice_elastic = u @ (stiffness @ u)
    harmonic = 0.5 * (twice_kinetic + twice_elastic)
    q = np.einsum("kij,i,ij->k", shapes, masses, displacement)
    p = np.einsum("kij,i,ij->k", shapes, masses, velocity)
    energies = 0.5 * (p * p + (frequencies * q) ** 2)
    return Modes(
        frequencies=frequencies,
        shapes=shapes,
        energies=energies,
        rest=float(harmonic - energies.sum()),
        anharmonic=float(energy - harmonic),
    )


# Vectors are complex numbers in the next two functions: conj(a) b is the dot product of
# a and b plus i times their cross product.
Vectors = NDArray[np.complex128]


def _inner_kinetic(masses: Array, at_rest: Vectors, x: Vectors, v: Vectors) -> float:
    """Return the kinetic energy without translation and rotation [M c^2]."""
    inertia = (masses * at_rest.conj() * at_rest).sum().real
    angular_momentum = (masses * x.conj() * v).sum().imag
    kinetic = masses @ np.abs(v) ** 2 - angular_momentum**2 / inertia
    return 0.5 * kinetic


def _in_eckart_frame(
    masses: Array, at_rest: Vectors, x: Vectors, v: Vectors
) -> tuple[Array, Array]:
    """Return displacements and velocities (n, 2) of a state in the frame of Eckart."""
    overlap = (masses * at_rest.conj() * x).sum()
    rotation = abs(overlap) / overlap
    turning = (masses * at_rest.conj() * v * rotation).sum().imag
    spin = turning / abs(overlap)
    displacement = x * rotation - at_rest
    velocity = (v - 1j * spin * x) * rotation
    return _vectors(displacement), _vectors(velocity)


def _complex(disk: Lattice, values: Array) -> Vectors:
    """Return vectors (n, 2), relative to their mean over the disk, as complex numbers
    (n,)."""
    return (values - disk.mean(values)) @ [1.0, 1.0j]


def _vectors(values: Vectors) -> Array:
    return np.stack([values.real, values.imag], axis=1)


def _vibrations(stiffness: Any, masses: Array, count: int) -> tuple[Array, Array]:
    """Return the `count` lowest frequencies above the rigid modes, and the shapes
    (count, n, 2)."""
    from scipy.sparse import diags

    scale = 1.0 / np.sqrt(np.repeat(masses, 2))
    matrix = diags(scale) @ stiffness @ diags(scale)
    squares, vectors = softest_modes(matrix, count + _RIGID_MODES)
    frequencies = np.sqrt(np.maximum(squares[_RIGID_MODES:], 0.0))
    shapes = scale[:, None] * vectors[:, _RIGID_MODES:]
    return frequencies, shapes.T.reshape(count, -1, 2)
