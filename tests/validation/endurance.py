"""How long a step may be, and whether energy stays, measured by stepping small disks for very long.

A disk of 60 points: its modes are those of any lattice, and 10^6 steps take a second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import bisect
from scipy.stats import linregress

from taichi_disk.integrators import TRAPEZOIDAL, VEFRL, VELOCITY_VERLET, Integrator
from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.lattice.network import laplacian
from taichi_disk.physics import ExponentialWall, Load, Model, Springs
from taichi_disk.simulation.equilibrium import solve_equilibrium
from taichi_disk.simulation.observables import ENERGY_INDICES, INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.simulation.stability import contact_point_force, spectrum, step_limit

Array = NDArray[np.float64]

POINTS = 60
WALL = ExponentialWall(300.0, 150.0)
LIMITS = ((VELOCITY_VERLET, 0.0), (VEFRL, 0.0), (VELOCITY_VERLET, 100.0), (TRAPEZOIDAL, 100.0))  # with eta*
STIFFNESSES = (1e-3, 1.0, 1e3)  # k_a
# Integrator, whether the disk bounces, part of the limit, steps.
DRIFTS = (
    (VELOCITY_VERLET, False, 0.8, 1_000_000),
    (VELOCITY_VERLET, False, 0.4, 1_000_000),
    (VEFRL, False, 0.6, 1_000_000),
    (VELOCITY_VERLET, True, 0.4, 1_000_000),
    (VELOCITY_VERLET, True, 0.2, 2_000_000),
    (VEFRL, True, 0.6, 1_000_000),
)
LOAD = 0.01  # P of the disk that rests on the wall [M c^2/R], times k_a
MECHANICAL = [INDEX[name] for name in ("kinetic", "elastic", "wall", "load")]
ROWS = 2000  # looks at the energy in a long run
# Energy over its first value. At h omega = 1.96 leapfrog's swings by 1/(1 - 0.98^2) = 25; random velocities, which
# strong dashpots would stop at once, an implicit one turns into an alternation that dies out slowly.
BOUNDED, LOST = 1e3, 1e6
BELOW, ABOVE = 100_000, 20_000  # steps at 0.98 and 1.05 of the limit


class Rest:
    """A disk at rest, free or `pressed` on the rigid wall, whose small vibrations are stepped.

    Attributes:
        stated: the limit of the step that a run goes by [R/c].
        true: that of the whole matrix of a step [R/c].
    """

    def __init__(self, integrator: Integrator, eta_star: float, k_a: float, pressed: bool) -> None:
        disk, springs = disk_lattice(POINTS, 0), Springs(k_a, 0.0, eta_star / POINTS)
        self.integrator, self.model, point_force = integrator, Model(springs), 0.0
        self.lattice = disk
        if pressed:
            self.model = Model(springs, WALL, Load(LOAD * k_a))
            self.lattice = replace(disk, positions=solve_equilibrium(disk, self.model).positions)
            point_force = float(WALL.forces(self.lattice, self.lattice.positions).max())
        self.stated = step_limit(spectrum(disk, self.model), self.model, integrator, point_force)
        stiffness = self.model.stiffness(self.lattice, self.lattice.positions).toarray() / disk.masses[0]
        if springs.damped and integrator.dashpots == "explicit":
            damping = springs.eta * np.kron(laplacian(disk.bonds, POINTS).toarray(), np.eye(2)) / disk.masses[0]
            low, high = 0.95 * self.stated, 1.1 * self.stated
            self.true = bisect(lambda h: _radius(stiffness, damping, h) - 1.0 - 1e-6, low, high, rtol=2e-4)
        else:
            # Implicit dashpots do not lower it: in a mode that changes sign at every step, u = 0 and none acts.
            self.true = float(integrator.stable / np.sqrt(np.linalg.eigvalsh(stiffness).max()))
        # So slow that forces stay linear, whose frequencies the limits are about.
        self.velocities = 1e-6 * np.sqrt(k_a) * np.random.default_rng(0).standard_normal((POINTS, 2))

    def growth(self, kernels: KernelCache, dt: float, steps: int) -> tuple[float, int]:
        """Energy above rest over its first value: the largest of the second half of `steps` steps of `dt` [R/c].

        inf where it passes LOST; then also the step by which it does, else `steps`. What comes first is a transient.
        (Not the kinetic energy alone: a mode that changes sign at every step has none at the steps.)
        """
        simulation = kernels.simulation(self.lattice, self.model, self.integrator, self.velocities, dt)
        first = simulation.first_row[INDEX["kinetic"]]
        potential = simulation.first_row[MECHANICAL].sum() - first
        with np.errstate(over="ignore", invalid="ignore"):
            energy = (simulation.advance(steps, 20)[0][:, MECHANICAL].sum(axis=1) - potential) / first
        over = np.flatnonzero(~(energy < LOST))
        if len(over):
            return float("inf"), 20 * (int(over[0]) + 1)
        return float(energy[len(energy) // 2 :].max()), steps


def _radius(stiffness: Array, damping: Array, h: float) -> float:
    """By how much a step h [R/c] of `velocity_verlet` multiplies the vibration that grows fastest.

    Spectral radius of its matrix for (x, v_{k-1/2}, a_k); the arguments are over the mass.
    """
    one = np.eye(len(stiffness))
    zero = 0.0 * one
    v = np.hstack([zero, one, h * one])
    x = np.hstack([one, zero, zero]) + h * v
    u = v + np.hstack([zero, zero, 0.5 * h * one])
    return float(np.abs(np.linalg.eigvals(np.vstack([x, v, -stiffness @ x - damping @ u]))).max())


@dataclass(frozen=True)
class Wander:
    """How an energy changed in a run, relative to that which the disk has above its rest.

    Attributes:
        swing: largest deviation from the mean.
        slope: of a straight line through it, over the whole run.
        slope_error: one standard error, from the means of 20 stretches.
    """

    swing: float
    slope: float
    slope_error: float


def drift(
    kernels: KernelCache, integrator: Integrator, bouncing: bool, fraction: float, steps: int
) -> tuple[Wander, Wander | None]:
    """The energy, and leapfrog's modified one, over `steps` steps of `fraction` of the limit, without dashpots.

    A free disk that vibrates at strains of some per cent, or one that bounces on the rigid wall: there energy goes
    to and from vibration for as long as one looks.
    """
    disk, model, force = disk_lattice(POINTS, 0), Model(Springs(1.0, 1e-3)), 0.0
    v = 0.003 * np.random.default_rng(0).standard_normal((POINTS, 2))
    v -= v.mean(axis=0)
    rest = disk.positions
    if bouncing:
        model = Model(Springs(1.0, 1e-3), WALL, Load(LOAD))
        disk = replace(disk, positions=disk.positions + [0.0, 0.06 - disk.positions[:, 1].min()])
        rest = solve_equilibrium(disk, model).positions
        force = contact_point_force(disk, model, 4.0 * LOAD)
    dt = fraction * step_limit(spectrum(disk, model), model, integrator, force)
    simulation = kernels.simulation(disk, model, integrator, v, dt)
    scale = simulation.first_row[ENERGY_INDICES].sum() - model.energy(disk, rest)
    energy, extra = np.zeros(ROWS), np.zeros(ROWS)
    for k in range(ROWS):
        simulation.advance(steps // ROWS, steps // ROWS)
        energy[k] = simulation.now[ENERGY_INDICES].sum()
        extra[k] = _modification(disk, model, simulation.positions(), simulation.velocities(), dt)
    modified = _wander((energy + extra) / scale) if integrator is VELOCITY_VERLET else None
    return _wander(energy / scale), modified


def _modification(disk: Lattice, model: Model, x: Array, v: Array, h: float) -> float:
    """What makes the energy at a step one that leapfrog conserves to O(h^4): h^2 (v.V''v/12 - |f|^2/(24 m)) [M c^2].

    The first term of its modified Hamiltonian (Hairer, Lubich & Wanner, Acta Numerica 12, 2003); V''v by differences.
    """
    force, d = model.forces(disk, x), 1e-4
    bent = (model.forces(disk, x - d * v) - model.forces(disk, x + d * v)) / (2.0 * d)
    return float(h**2 * ((v * bent).sum() / 12.0 - (force**2).sum() / (24.0 * disk.masses[0])))


def _wander(energy: Array) -> Wander:
    relative = energy - energy.mean()
    fit = linregress(np.linspace(0.025, 0.975, 20), relative.reshape(20, -1).mean(axis=1))
    return Wander(float(np.abs(relative).max()), float(fit.slope), float(fit.stderr))
