"""How long a step may be, and whether energy stays, measured by stepping small disks for very long.

A disk of 60 points: its modes are those of any lattice, and 10^6 steps take a second.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.model.observables import COLUMNS
from taichi_disk.model.physics import Integrator, Physics
from taichi_disk.model.stability import Spectrum, contact_point_force, spectrum, step_limit
from taichi_disk.model.world import World
from taichi_disk.newton import compress
from taichi_disk.simulate import ENERGIES
from taichi_disk.stiffness import largest_eigenvalue, tangent_stiffness

POINTS = 60
# Integrator and eta*; and for the energy: integrator, whether the disk bounces, part of the limit.
LIMITS: tuple[tuple[Integrator, float], ...] = (
    ("velocity_verlet", 0.0),
    ("vefrl", 0.0),
    ("velocity_verlet", 100.0),
    ("trapezoidal", 100.0),
)
DRIFTS: tuple[tuple[Integrator, bool, float], ...] = (
    ("velocity_verlet", False, 0.8),
    ("velocity_verlet", False, 0.4),
    ("vefrl", False, 0.6),
    ("velocity_verlet", True, 0.4),
    ("vefrl", True, 0.6),
)
LOAD = 0.01  # P of the disk that rests on the wall [M c^2/R], times k_a
BOUNDED, LOST = 50.0, 1e6  # energy over its first value: at h omega = 1.96 leapfrog's swings by 1/(1 - 0.98^2) = 25


@dataclass(frozen=True)
class Limit:
    """The limit of the step that a run goes by, `stated`, and the true one, from all eigenvalues [R/c]."""

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
        modes = spectrum(disk, self.physics)
        self.limit = Limit(step_limit(modes, self.physics, float(force.max())), self._true(modes, force))
        noise = np.random.default_rng(0).standard_normal((1, POINTS, 2))
        # So slow that forces stay linear, whose frequencies the limits are about.
        self.velocities = 1e-6 * np.sqrt(k_a) * noise

    def _true(self, modes: Spectrum, force: NDArray[np.float64]) -> float:
        from scipy.sparse import diags

        wall = np.zeros((POINTS, 2))
        wall[:, 1] = self.physics.a * force
        springs = tangent_stiffness(self.positions, self.disk.bonds, self.disk.rest_lengths, self.physics.k_a, 0.0)
        omega = float(np.sqrt(largest_eigenvalue(springs + diags(wall.ravel()), self.disk.masses)))
        return step_limit(replace(modes, omega=omega), self.physics, 0.0)

    def world(self, dt: float, earlier: World | None = None) -> World:
        """Stepped by `dt` [R/c], in the fields of an `earlier` world if there is one."""
        arguments = self.disk, self.physics, self.velocities, dt
        if earlier is not None and earlier.restart(*arguments, positions=self.positions[None]):
            return earlier
        return World(*arguments, positions=self.positions[None])

    def growth(self, world: World, steps: int) -> tuple[float, int]:
        """Kinetic energy over its first value: the largest of the second half of `steps` steps (inf where it passes
        LOST), and the step by which it does (else `steps`). What comes first is a transient."""
        first = world.first_row[COLUMNS.index("kinetic"), 0]
        kinetic = world.advance(steps // 20, 20)[:, COLUMNS.index("kinetic"), 0]
        over = np.flatnonzero(~(kinetic < LOST * first))
        if len(over):
            return float("inf"), 20 * (int(over[0]) + 1)
        return float(kinetic[len(kinetic) // 2 :].max() / first), steps


@dataclass(frozen=True)
class Drift:
    """Energy over `steps` steps of h = `fraction` of the limit, relative to the vibration's own."""

    steps: int
    fraction: float
    swing: float  # largest deviation from the mean
    slope: float  # of a straight line through it, per 10^6 steps
    slope_error: float  # one standard error, from the means of 20 stretches


def drift(integrator: Integrator, bouncing: bool, fraction: float, steps: int = 1_000_000) -> Drift:
    """Without dashpots, at strains of some per cent: a free disk that vibrates, or one that bounces on the rigid wall.

    In a bounce energy goes to and from vibration: there is no rest for 10^6 steps.
    """
    disk = disk_lattice(POINTS, 0)
    physics = Physics(k_b=1e-3, integrator=integrator)
    v = 0.003 * np.random.default_rng(0).standard_normal((1, POINTS, 2))
    v -= v.mean(axis=1, keepdims=True)
    force = 0.0
    if bouncing:
        physics = replace(physics, wall="rigid", load=LOAD)
        disk = _lifted(disk, 0.06)
        force = contact_point_force(disk, physics, 4.0 * LOAD)
    dt = fraction * step_limit(spectrum(disk, physics), physics, force)
    world = World(disk, physics, v, dt)
    rows = 2000
    energy = world.advance(rows, steps // rows)[:, ENERGIES, 0].sum(axis=1)
    load = LOAD * world.first_row[COLUMNS.index("com_y"), 0] if bouncing else 0.0
    scale = world.first_row[ENERGIES, 0].sum() - load
    world.destroy()
    relative = (energy - energy.mean()) / scale
    means = relative.reshape(20, -1).mean(axis=1)
    slope, error = _line(np.linspace(0.025, 0.975, 20) * steps / 1e6, means)
    return Drift(steps, fraction, float(np.abs(relative).max()), slope, error)


def _lifted(disk: Lattice, height: float) -> Lattice:
    return replace(disk, positions=disk.positions + [0.0, height - disk.positions[:, 1].min()])


def _line(x: NDArray[np.float64], y: NDArray[np.float64]) -> tuple[float, float]:
    """Slope of the line of least squares through (x, y), and its standard error."""
    from scipy.stats import linregress

    fit = linregress(x, y)
    return float(fit.slope), float(fit.stderr)
