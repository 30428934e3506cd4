"""How long a step may be, and whether energy stays, measured by stepping small disks for very long.

A disk of 60 points: its modes are those of any lattice, and 10^6 steps take a second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.model import runtime
from taichi_disk.model.integrators import SPLITTINGS
from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Integrator, Physics
from taichi_disk.model.stability import contact_point_force, spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.newton import compress
from taichi_disk.simulate import ENERGIES
from taichi_disk.stiffness import laplacian, tangent_stiffness
from taichi_disk.study.reference import Reference

POINTS = 60
# Integrator and eta*; and for the energy: integrator, whether the disk bounces, part of the limit, steps.
LIMITS: tuple[tuple[Integrator, float], ...] = (
    ("velocity_verlet", 0.0),
    ("vefrl", 0.0),
    ("velocity_verlet", 100.0),
    ("trapezoidal", 100.0),
)
DRIFTS: tuple[tuple[Integrator, bool, float, int], ...] = (
    ("velocity_verlet", False, 0.8, 1_000_000),
    ("velocity_verlet", False, 0.4, 1_000_000),
    ("vefrl", False, 0.6, 1_000_000),
    ("velocity_verlet", True, 0.4, 1_000_000),
    ("velocity_verlet", True, 0.2, 2_000_000),
    ("vefrl", True, 0.6, 1_000_000),
)
LOAD = 0.01  # P of the disk that rests on the wall [M c^2/R], times k_a
MECHANICAL = [COLUMNS.index(name) for name in ("kinetic", "elastic", "wall", "load")]
ROWS = 2000  # looks at the energy in a long run
# Energy over its first value. At h omega = 1.96 leapfrog's swings by 1/(1 - 0.98^2) = 25; random velocities, which
# strong dashpots would stop at once, an implicit one turns into an alternation that dies out slowly.
BOUNDED, LOST = 1e3, 1e6
BELOW, ABOVE = 100_000, 20_000  # steps at 0.98 and 1.05 of the limit


@dataclass(frozen=True)
class Limit:
    """The limit of the step that a run goes by, `stated`, and the `true` one, from the whole matrix [R/c]."""

    stated: float
    true: float


class Rest:
    """A disk at rest, free or pressed on the rigid wall, whose small vibrations are stepped.

    Args:
        pressed: by a load of 0.01 k_a on the wall V0 exp(-300 y), damped by `eta_star` alone.
    """

    def __init__(self, integrator: Integrator, eta_star: float, k_a: float, pressed: bool) -> None:
        disk = disk_lattice(POINTS, 0)
        self.physics = Physics(k_a=k_a, eta=eta_star / POINTS, integrator=integrator)
        force = np.zeros(POINTS)
        x = disk.positions
        if pressed:
            self.physics = replace(self.physics, wall="rigid", load=LOAD * k_a)
            a, V0 = self.physics.a, self.physics.V0
            x = compress(disk, k_a, 0.0, a, V0, self.physics.load).positions
            force = a * V0 * np.exp(-a * x[:, 1])
        self.disk, self.positions = disk, x
        wall = np.zeros((POINTS, 2))
        wall[:, 1] = self.physics.a * force
        springs = tangent_stiffness(x, disk.bonds, disk.rest_lengths, k_a, 0.0)
        self._stiffness = springs.toarray() + np.diag(wall.ravel())
        stated = step_limit(spectrum(disk, self.physics), self.physics, float(force.max()))
        self.limit = Limit(stated, self._true(stated))
        noise = np.random.default_rng(0).standard_normal((1, POINTS, 2))
        # So slow that forces stay linear, whose frequencies the limits are about; in f32, above its rounding.
        self.velocities = (1e-6 if runtime.precision() == "f64" else 3e-5) * np.sqrt(k_a) * noise

    def _true(self, stated: float) -> float:
        if not self.physics.explicit_dashpot:
            # The implicit one does not lower it: in a mode that changes sign at every step, u = 0 and no dashpot acts.
            omega = np.sqrt(np.linalg.eigvalsh(self._stiffness).max() / self.disk.masses[0])
            return float(SPLITTINGS[self.physics.integrator].stable / omega)
        low, high = 0.95 * stated, 1.1 * stated
        while high - low > 2e-4 * stated:
            h = 0.5 * (low + high)
            low, high = (h, high) if self.factor(h) < 1.0 + 1e-6 else (low, h)
        return low

    def factor(self, h: float) -> float:
        """By how much a step h [R/c] multiplies the vibration that grows fastest: spectral radius of its matrix.

        A dense matrix from the schemes as `model.integrators` states them: with dashpots only.
        """
        m, one = self.disk.masses[0], np.eye(2 * POINTS)
        stiffness = self._stiffness / m
        damping = np.kron(laplacian(self.disk.bonds, POINTS).toarray(), np.eye(2)) * (self.physics.eta / m)
        zero = 0.0 * one
        if self.physics.explicit_dashpot:  # of (x, v_{k-1/2}, a_k)
            v = np.hstack([zero, one, h * one])
            x = np.hstack([one, zero, zero]) + h * v
            u = v + np.hstack([zero, zero, 0.5 * h * one])
            step = np.vstack([x, v, -stiffness @ x - damping @ u])
        else:  # of (x, v_{k-1/2})
            u = np.linalg.solve(one + 0.5 * h * damping, np.hstack([-0.5 * h * stiffness, one]))
            v = 2.0 * u - np.hstack([zero, one])
            step = np.vstack([np.hstack([one, zero]) + h * v, v])
        return float(np.abs(np.linalg.eigvals(step)).max())

    def world(self, dt: float, earlier: World | None = None) -> World:
        """Stepped by `dt` [R/c], in the fields of an `earlier` world if there is one."""
        arguments = self.disk, self.physics, self.velocities, dt
        if earlier is not None and earlier.restart(*arguments, positions=self.positions[None]):
            return earlier
        return World(*arguments, positions=self.positions[None])

    def growth(self, world: World, steps: int) -> tuple[float, int]:
        """Energy above rest over its first value: the largest of the second half of `steps` steps (inf where it passes
        LOST), and the step by which it does (else `steps`). What comes first is a transient.

        Not the kinetic energy alone: a mode that changes sign at every step has none at the steps.
        """
        first = world.first_row[COLUMNS.index("kinetic"), 0]
        potential = world.first_row[MECHANICAL, 0].sum() - first
        with np.errstate(over="ignore", invalid="ignore"):
            energy = (world.advance(steps // 20, 20)[:, MECHANICAL, 0].sum(axis=1) - potential) / first
        over = np.flatnonzero(~(energy < LOST))
        if len(over):
            return float("inf"), 20 * (int(over[0]) + 1)
        return float(energy[len(energy) // 2 :].max()), steps


@dataclass(frozen=True)
class Wander:
    """How an energy changed in a run, relative to that which the disk has above its rest."""

    swing: float  # largest deviation from the mean
    slope: float  # of a straight line through it, over the whole run
    slope_error: float  # one standard error, from the means of 20 stretches


def drift(
    integrator: Integrator, bouncing: bool, fraction: float, steps: int = 1_000_000
) -> tuple[Wander, Wander | None]:
    """The energy, and leapfrog's modified one, over `steps` steps of `fraction` of the limit, without dashpots.

    A free disk that vibrates at strains of some per cent, or one that bounces on the rigid wall: there energy goes
    to and from vibration for as long as one looks.
    """
    disk = disk_lattice(POINTS, 0)
    physics = Physics(k_b=1e-3, integrator=integrator)
    v = 0.003 * np.random.default_rng(0).standard_normal((1, POINTS, 2))
    v -= v.mean(axis=1, keepdims=True)
    rest, force = disk.positions, 0.0
    if bouncing:
        physics = replace(physics, wall="rigid", load=LOAD)
        disk = _lifted(disk, 0.06)
        rest = compress(disk, physics.k_a, physics.k_b, physics.a, physics.V0, LOAD).positions
        force = contact_point_force(disk, physics, 4.0 * LOAD)
    dt = fraction * step_limit(spectrum(disk, physics), physics, force)
    world = World(disk, physics, np.zeros_like(v), dt, positions=rest[None])
    lowest = world.first_row[ENERGIES, 0].sum()
    world.restart(disk, physics, v, dt)
    scale = world.first_row[ENERGIES, 0].sum() - lowest
    reference = Reference(disk, physics)
    energy, extra = np.zeros(ROWS), np.zeros(ROWS)
    for k in range(ROWS):
        energy[k] = world.advance(1, steps // ROWS)[0, ENERGIES, 0].sum()
        extra[k] = _modification(reference, world.positions()[0], world.velocities()[0], dt)
    world.destroy()
    modified = _wander((energy + extra) / scale) if integrator == "velocity_verlet" else None
    return _wander(energy / scale), modified


def _modification(reference: Reference, x: NDArray[np.float64], v: NDArray[np.float64], h: float) -> float:
    """What makes the energy at a step one that leapfrog conserves to O(h^4): h^2 (v.V''v/12 - |f|^2/(24 m)) [M c^2].

    The first term of its modified Hamiltonian (Hairer, Lubich & Wanner, Acta Numerica 12, 2003); V''v by differences.
    """
    still, d = np.zeros_like(v), 1e-4
    force = reference.force(x, still)
    bent = (reference.force(x - d * v, still) - reference.force(x + d * v, still)) / (2.0 * d)
    return float(h**2 * ((v * bent).sum() / 12.0 - (force**2).sum() / (24.0 * reference.lattice.masses[0])))


def _wander(energy: NDArray[np.float64]) -> Wander:
    from scipy.stats import linregress

    relative = energy - energy.mean()
    fit = linregress(np.linspace(0.025, 0.975, 20), relative.reshape(20, -1).mean(axis=1))
    return Wander(float(np.abs(relative).max()), float(fit.slope), float(fit.stderr))


def _lifted(disk: Lattice, height: float) -> Lattice:
    return replace(disk, positions=disk.positions + [0.0, height - disk.positions[:, 1].min()])
