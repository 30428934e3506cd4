"""The largest stable time step, and one that resolves resets, from the lattice, the
dashpots and the wall.

Without damping a step h is stable if h omega is below the integrator's limit, where
omega is the highest frequency. A wall that exerts the force F on a point adds at most
the stiffness a F at this point: omega^2 <= omega_lattice^2 + a F/m (2 a F/m for an
elastic wall, where two points of mass m approach each other). Trapezoidal dashpots do
not lower the limit; predicted ones do, see `explicit_limit`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import inf, sqrt

import numpy as np

from taichi_disk.mechanics.integrators import Integrator
from taichi_disk.mechanics.lattice import Lattice
from taichi_disk.mechanics.lattice.network import laplacian, largest_eigenvalue
from taichi_disk.mechanics.physics import Model

# Ratio of the largest force on one point to the force on a point of a smooth rim.
# Measured: 0.06 to 1.5, with
# 0.005 <= v <= 0.1, 30 <= a <= 30,000 and N = 300, 1099, 4000. The margin of an
# automatic step allows another 1.4.
ROUGHNESS = 1.2
MODULUS = 1.2  # Young's modulus over `Springs.modulus`, for estimates of contact forces


@dataclass(frozen=True)
class Spectrum:
    """Quantities of a lattice that limit the step."""

    omega: float  # highest frequency [c/R]
    damping: float  # largest damping rate over eta, lambda_max(L)/m [1/(M c/R) c/R]
    mass: float  # smallest point mass [M]
    points: int  # number of points


@dataclass(frozen=True)
class TimeStep:
    """The step of one run.

    Attributes:
        integrator: how a step is made.
        dt: step [R/c].
        limit: largest stable step [R/c] with the estimated force of the wall.
        limit_under: returns the largest stable step [R/c] if no force of the wall on a
            point exceeds its argument [M c^2/R].
    """

    integrator: Integrator
    dt: float
    limit: float
    limit_under: Callable[[float], float]


def spectrum(lattice: Lattice, model: Model) -> Spectrum:
    stiffness = model.springs.stiffness(lattice, lattice.positions)
    masses = lattice.masses
    damping = 0.0
    if model.springs.damped:
        damping = largest_eigenvalue(laplacian(lattice), masses)
    omega = sqrt(largest_eigenvalue(stiffness, masses))
    return Spectrum(omega, damping, float(masses.min()), len(lattice.positions))


def step_limit(
    spectrum: Spectrum, model: Model, integrator: Integrator, point_force: float
) -> float:
    """Return the largest stable step [R/c] if no force of the wall on a point exceeds
    `point_force` [M c^2/R]."""
    added = 0.0
    if model.wall:
        added = model.wall.added_stiffness(point_force) / spectrum.mass
    omega = sqrt(spectrum.omega**2 + added)
    if model.springs.damped and integrator.dashpots == "explicit":
        return explicit_limit(omega, model.springs.eta * spectrum.damping)
    return integrator.stable / omega


def explicit_limit(omega: float, damping: float) -> float:
    """Return the largest stable step of `velocity_verlet` for x'' = -omega^2 x -
    damping x' and all lower modes."""
    # With w = h v_{k-1/2} and p = h^2 a_k a step is linear, x+ = x + w', w' = w + p, p+
    # = -W x+ - g (w' + p/2) with W = (h omega)^2, g = h damping: z^3 + (W + 3/2 g - 2)
    # z^2 + (1 - 2 g) z + g/2 = 0. By Jury's criterion its roots lie within the unit
    # circle while W + 4 g < 4, so that the highest frequency and the highest rate bound
    # all modes.
    return 2.0 / (damping + sqrt(damping**2 + omega**2))


def reset_step(
    spectrum: Spectrum, model: Model, integrator: Integrator, error: float
) -> float:
    """Return the longest step [R/c] at which resets combined with dashpots change e by
    at most about `error`."""
    # A reset excites the lattice's fastest vibration omega, which dashpots of the
    # highest rate r damp. Measured, with N = 100 to 4000 and intervals of 0.001 to 0.03
    # R/c: the error of e is 0.008 to 0.02 r omega h^2 with explicit dashpots. With
    # implicit ones it is a quarter of that, and rates above 1/(3 interval) have no
    # further effect.
    if not (model.reset_interval and model.springs.damped):
        return inf
    part = 0.015
    rate = model.springs.eta * spectrum.damping
    if integrator.dashpots == "implicit":
        part = 0.004
        rate = min(rate, 1.0 / (3.0 * model.reset_interval))
    return sqrt(error / (part * rate * spectrum.omega))


def impact_point_force(lattice: Lattice, model: Model, velocity: float) -> float:
    """Estimate the largest force of the wall on one point in an impact [M c^2/R]; a run
    checks it."""
    # The quasi-static energy balance v^2/2 = pi E* xi^2/(2 ln(4/xi)) gives the largest
    # compression and its force. Stopping a single point within the decay length takes
    # at least m v^2/2 over this length, which is more on a hard wall at high speed.
    assert model.wall is not None
    e_star = MODULUS * model.springs.modulus
    xi = velocity
    for _ in range(50):
        logarithm = np.log(4.0 / min(xi, 1.0))
        xi = min(velocity * np.sqrt(logarithm / (np.pi * e_star)), 1.0)
    contact_force = np.pi * e_star * xi / np.log(4.0 / xi)
    hardness = 1.0 / model.wall.decay_length
    force_on_lone_point = 0.5 * hardness * lattice.masses.max() * velocity**2
    force_on_point = contact_point_force(lattice, model, contact_force)
    return max(force_on_point, force_on_lone_point)


def contact_point_force(lattice: Lattice, model: Model, force: float) -> float:
    """Estimate the largest force on one point [M c^2/R] if the contact force is
    `force`."""
    # The point bears the peak of a Gaussian over its chord, and ROUGHNESS times that if
    # it protrudes. The variance of the Gaussian is the sum of F R/(pi E*) of Hertz's
    # contact and R/a of a soft wall along a circle.
    assert model.wall is not None
    of_contact = force / (np.pi * MODULUS * model.springs.modulus)
    variance = of_contact + model.wall.decay_length
    peak = ROUGHNESS * force / np.sqrt(2.0 * np.pi * variance)  # [M c^2/R^2]
    surface = lattice.positions[lattice.disk_surface]
    chords = np.hypot(*(surface - np.roll(surface, 1, axis=0)).T)
    return min(force, peak * chords.max())
