"""The largest stable time step, and one that resolves resets, from the lattice, the dashpots and the wall.

Without damping a step is bounded while h omega for the highest frequency omega is below the integrator's own limit. The
wall adds the stiffness a F of the point that carries the force F, at most to the point's own mass: omega^2 <=
omega_lattice^2 + a F/m (twice that against an elastic wall, where two points of mass m approach each other). The
trapezoidal dashpot does not lower the limit, the predicted one does: `explicit_limit`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from taichi_disk.integrators import Integrator
from taichi_disk.lattice import Lattice
from taichi_disk.lattice.network import laplacian, largest_eigenvalue
from taichi_disk.physics import Model
from taichi_disk.signals import interruptible

# Of the largest force on one point over that of a smooth rim. Measured with 0.005 <= v <= 0.1, 30 <= a <= 30,000 and
# N = 300, 1099, 4000 it is 0.06 to 1.5; the margin between an automatic step and the limit is good for another 1.4.
ROUGHNESS = 1.2
MODULUS = 1.2  # Young's modulus over `Springs.modulus`, for estimates of contact forces


@dataclass(frozen=True)
class Spectrum:
    """What bounds the step: the lattice's highest frequency omega [c/R], its damping rate, least point mass [M], size.

    `damping`: largest rate over eta, lambda_max(L)/m [1/(M c/R) c/R].
    """

    omega: float
    damping: float
    mass: float
    points: int


def spectrum(lattice: Lattice, model: Model) -> Spectrum:
    """Largest eigenvalues of the stiffness matrix at rest and, where there are dashpots, of the Laplacian."""
    stiffness = model.springs.stiffness(lattice, lattice.positions)
    masses, damping = lattice.masses, 0.0
    if model.springs.damped:
        damping = interruptible(largest_eigenvalue, laplacian(lattice), masses)
    omega = float(np.sqrt(interruptible(largest_eigenvalue, stiffness, masses)))
    return Spectrum(omega, damping, float(masses.min()), len(lattice.positions))


def step_limit(spectrum: Spectrum, model: Model, integrator: Integrator, point_force: float) -> float:
    """Largest stable step [R/c] while no point takes more than `point_force` [M c^2/R] from the wall."""
    added = model.wall.added_stiffness(point_force) / spectrum.mass if model.wall else 0.0
    omega = float(np.sqrt(spectrum.omega**2 + added))
    if model.springs.damped and integrator.dashpots == "explicit":
        return explicit_limit(omega, model.springs.eta * spectrum.damping)
    return integrator.stable / omega


def explicit_limit(omega: float, damping: float) -> float:
    """Largest stable step of `velocity_verlet` for x'' = -omega^2 x - damping x', every mode up to these.

    With w = h v_{k-1/2} and p = h^2 a_k a step is linear, x+ = x + w', w' = w + p, p+ = -W x+ - g (w' + p/2) with
    W = (h omega)^2, g = h damping: z^3 + (W + 3/2 g - 2) z^2 + (1 - 2 g) z + g/2 = 0. By Jury's criterion its roots lie
    within the unit circle while W + 4 g < 4, so that the highest frequency and the highest rate bound all modes.
    """
    return float(2.0 / (damping + np.sqrt(damping**2 + omega**2)))


def reset_step(spectrum: Spectrum, model: Model, integrator: Integrator, error: float) -> float:
    """Longest step [R/c] at which dashpots beside a `reset` boundary put e off by no more than `error`, about.

    A reset stirs up the lattice's fastest vibration omega, on which dashpots of the highest rate r act. Measured, with
    N = 100 to 4000 and intervals of 0.001 to 0.03 R/c: e is off by 0.008 to 0.02 r omega h^2 where their velocities are
    predicted. Where they are solved for it is a quarter of that, and a rate above 1/(3 interval) counts no more.
    """
    if not (model.reset_interval and model.springs.damped):
        return np.inf
    part, rate = 0.015, model.springs.eta * spectrum.damping
    if integrator.dashpots == "implicit":
        part, rate = 0.004, min(rate, 1.0 / (3.0 * model.reset_interval))
    return float(np.sqrt(error / (part * rate * spectrum.omega)))


def impact_point_force(lattice: Lattice, model: Model, velocity: float) -> float:
    """Estimate of the largest force of the wall on one point in an impact [M c^2/R]; a run checks it.

    Quasi-static energy balance v^2/2 = pi E* xi^2/(2 ln(4/xi)) gives the peak compression and its force. A single point
    is stopped by a m v^2/2 at the least: into a hard wall, at high speed, that is more.
    """
    assert model.wall is not None
    e_star = MODULUS * model.springs.modulus
    xi = velocity
    for _ in range(50):
        xi = min(velocity * np.sqrt(np.log(4.0 / min(xi, 1.0)) / (np.pi * e_star)), 1.0)
    alone = 0.5 * model.wall.a * float(lattice.masses.max()) * velocity**2
    return max(contact_point_force(lattice, model, np.pi * e_star * xi / np.log(4.0 / xi)), alone)


def contact_point_force(lattice: Lattice, model: Model, force: float) -> float:
    """Estimate of the share of a total contact force that one point carries [M c^2/R], at most all.

    It carries over its chord the peak of a Gaussian, which has the variance of Hertz's contact, F R/(pi E*), and that
    of a soft wall along a circle, R/a; somewhat more where it sticks out.
    """
    assert model.wall is not None
    variance = force / (np.pi * MODULUS * model.springs.modulus) + model.wall.decay_length
    surface = lattice.positions[lattice.disk_surface]
    chords = np.hypot(*(surface - np.roll(surface, 1, axis=0)).T)
    return float(min(force, ROUGHNESS * force / np.sqrt(2.0 * np.pi * variance) * chords.max()))
