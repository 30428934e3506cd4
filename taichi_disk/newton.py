"""The disk at rest, pressed by a body force on the exponential wall: an energy minimum by Newton's method."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Lattice
from taichi_disk.stiffness import spring_energy, spring_forces, tangent_stiffness

Array = NDArray[np.float64]

_EPS = float(np.finfo(np.float64).eps)
_FIRST_SHIFT, _LEAST_SHIFT, _LAST_SHIFT = 1e-5, 1e-12, 1e6  # in units of the stiffest degree of freedom
_MOST_ROLL = 0.1  # [rad] in a step
_TIP = 1e-3  # [rad]


@dataclass(frozen=True)
class Equilibrium:
    positions: Array  # (n, 2) [R], wall at y = 0
    iterations: int
    residual: float  # largest force component left on any point [M c^2/R]
    roll: float  # by how much the disk has turned, counter-clockwise, against the unloaded lattice [rad]


def compress(
    lattice: Lattice,
    k_a: float,
    k_b: float,
    a: float,
    V0: float,
    pressure: float,
    start: Array | None = None,
    tolerance: float = 1e-12,
    max_iterations: int = 400,
    on_iteration: Callable[[int, float], None] | None = None,
) -> Equilibrium:
    """The disk's stable rest under a force -P/N [M c^2/R] on each point, over a wall of energy V0 exp(-a y).

    Newton's method, kept on the way downhill in energy from `start` (n, 2), by default the unloaded disk at
    the height where the wall bears it as a rigid body. The mean x stays: nothing else fixes it. A disk whose
    centre of mass is not above its contact rolls, as it would in reality, until it is; `roll` tells how far.

    Converged when no force component exceeds `tolerance` P/N or, where that is larger, the springs' rounding.
    `on_iteration` is called with the number of the iteration and the largest force component before it.
    Raises SimulationError if that takes more than `max_iterations`.
    """
    disk = _PressedDisk(lattice, k_a, k_b, a, V0, pressure)
    if start is None:
        start = lattice.positions + np.array([0.0, rigid_balance(lattice.positions[:, 1], a, V0, pressure)])
    x = start
    stiffest = float(disk.spring_tangent(x).diagonal().max())
    goal = max(tolerance * pressure / len(x), 4.0 * _EPS * stiffest)
    shift = _FIRST_SHIFT * stiffest
    for iteration in range(max_iterations + 1):
        force = disk.force(x)
        residual = float(np.abs(force).max())
        if on_iteration is not None:
            on_iteration(iteration, residual)
        tangent = disk.tangent(x)
        if residual > goal:
            x, shift = _step(disk, x, force, tangent, shift, stiffest)
        elif _factor(tangent, _LEAST_SHIFT * stiffest) is None:
            x = _moved(x, _rotation(x, _TIP))  # at rest, but balanced on a tip
        else:
            return Equilibrium(x, iteration, residual, roll_angle(lattice.positions, x))
    raise SimulationError(
        f"no equilibrium within {max_iterations} Newton iterations (force {residual:.1e}, wanted {goal:.1e}):"
        " lower compression.pressure or wall.a"
    )


def roll_angle(unloaded: Array, positions: Array) -> float:
    """The rotation [rad], -pi to pi, that best (in least squares) takes points (n, 2) into others."""
    before, after = (p - p.mean(axis=0) for p in (unloaded, positions))
    across = float(np.sum(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]))
    return math.atan2(across, float(np.sum(before * after)))


def rigid_balance(heights: Array, a: float, V0: float, pressure: float) -> float:
    """How far to lift points at `heights` (n,) [R] for the wall to bear them: sum_i a V0 exp(-a y_i) = P."""
    lowest = float(heights.min())
    crowd = float(np.exp(-a * (heights - lowest)).sum())
    return float(np.log(a * V0 * crowd / pressure)) / a - lowest


def lowest_lie(disk: Lattice, k_a: float, a: float, pressure: float) -> float:
    """The angle [rad], counter-clockwise, by which the unloaded disk has to be turned to lie lowest.

    On a wall V0 exp(-y/L) a rigid body rests where h = L ln sum_i exp(-y_i/L), y_i against the centre of mass, is
    smallest; V0 does not matter. L = 1/a + 2 P/(pi k_a) makes its contact about as wide as Hertz's. The smallest
    over all angles is taken, so that the answer does not depend on how the lattice happens to be turned.
    """
    from scipy.optimize import minimize_scalar

    depth = 1.0 / a + 2.0 * pressure / (np.pi * k_a)
    x, y = (disk.positions[disk.disk_surface] - disk.positions.mean(axis=0)).T

    def height(angle: Array) -> Array:
        below = -np.outer(np.sin(angle), x) - np.outer(np.cos(angle), y)
        lowest = below.max(axis=1)
        return np.asarray(lowest + depth * np.log(np.exp((below - lowest[:, None]) / depth).sum(axis=1)))

    angles = np.linspace(-np.pi, np.pi, max(360, 4 * len(x)), endpoint=False)
    best = float(angles[np.argmin(height(angles))])
    step = float(angles[1] - angles[0])
    found = minimize_scalar(
        lambda t: float(height(np.array([t]))[0]), bounds=(best - step, best + step), method="bounded"
    )
    return float(found.x)


def laid_down(disk: Lattice, angle: float, a: float, V0: float, load: float) -> Lattice:
    """`disk` turned by the `angle` at which it rests, and so high that the wall bears the `load`.

    A random lattice's centre of mass lies some 0.005 R beside its middle, so that a disk put down at random
    rolls. Damped by dashpots that resist rotation too, that takes 10^4 R/c, and the turned disk's lowest point
    is another: the compression would be measured against the wrong radius.
    """
    positions = _turned(disk.positions, angle)
    lift = rigid_balance(positions[:, 1], a, V0, load)
    return replace(disk, positions=positions + np.array([0.0, lift]))


def _turned(positions: Array, angle: float) -> Array:
    """`positions` (n, 2) turned about their mean."""
    c, s = np.cos(angle), np.sin(angle)
    centre = positions.mean(axis=0)
    return centre + (positions - centre) @ np.array([[c, s], [-s, c]])


class _PressedDisk:
    """Energy, force and tangent stiffness of springs, wall and load together."""

    def __init__(self, lattice: Lattice, k_a: float, k_b: float, a: float, V0: float, pressure: float) -> None:
        self.springs = (lattice.bonds, lattice.rest_lengths, k_a, k_b)
        self.a, self.V0, self.pressure = a, V0, pressure

    def wall_energy(self, x: Array) -> Array:
        with np.errstate(over="ignore"):  # a step deep into the wall: infinite energy, refused
            return self.V0 * np.exp(-self.a * x[:, 1])

    def energy(self, x: Array) -> float:
        return spring_energy(x, *self.springs) + float(self.wall_energy(x).sum() + self.pressure * x[:, 1].mean())

    def force(self, x: Array) -> Array:
        force = spring_forces(x, *self.springs)
        force[:, 1] += self.a * self.wall_energy(x) - self.pressure / len(x)
        return force

    def spring_tangent(self, x: Array) -> Any:
        return tangent_stiffness(x, *self.springs)

    def tangent(self, x: Array) -> Any:
        from scipy.sparse import diags

        wall = np.zeros_like(x)
        wall[:, 1] = self.a**2 * self.wall_energy(x)
        return self.spring_tangent(x) + diags(wall.ravel())


def _step(
    disk: _PressedDisk, x: Array, force: Array, tangent: Any, shift: float, stiffest: float
) -> tuple[Array, float]:
    """One Levenberg-Marquardt step: new positions and the next shift.

    The shift of the tangent's diagonal grows until the matrix is positive definite and the energy falls by a
    fair share of what the quadratic model promises. It shrinks tenfold after a full step that kept the
    promise, to next to nothing: rolling may be 1e-8 times as stiff as the springs, yet must converge too.
    """
    energy, residual = disk.energy(x), np.abs(force).max()
    while shift < _LAST_SHIFT * stiffest:
        factor = _factor(tangent, shift)
        if factor is None:
            shift *= 4.0
            continue
        move = factor.solve(force.ravel()).reshape(-1, 2)
        move[:, 0] -= move[:, 0].mean()  # rounding, which would make the disk slide along the wall
        slope = float(np.sum(move * force))
        curvature = slope - shift * float(np.sum(move * move))
        share = min(1.0, _MOST_ROLL / max(abs(_angle(x, move)), _EPS))
        for _ in range(12):
            trial = _moved(x, share * move)
            promised = share * slope - 0.5 * share**2 * curvature
            if promised > 64.0 * _EPS * abs(energy):
                kept = (energy - disk.energy(trial)) / promised
            else:  # below the rounding of the energy, the forces must tell
                kept = 1.0 if np.abs(disk.force(trial)).max() <= 2.0 * residual else 0.0
            if kept > 0.1:
                if share == 1.0 and kept > 0.5:
                    shift = max(shift / 10.0, _LEAST_SHIFT * stiffest)
                elif kept < 0.25:
                    shift *= 4.0
                return trial, shift
            share /= 2.0
        shift *= 8.0
    raise SimulationError("Newton's method found no way downhill to a rest: lower compression.pressure or wall.a")


def _factor(matrix: Any, shift: float) -> Any:
    """Factors of matrix + shift, or None where that is not positive definite."""
    from scipy.sparse import identity
    from scipy.sparse.linalg import splu

    # Pivots on the diagonal, so that their signs are those of the eigenvalues (Sylvester's law of inertia).
    factor = splu(
        (matrix + shift * identity(matrix.shape[0])).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    return factor if bool((factor.U.diagonal() > 0.0).all()) else None


def _angle(x: Array, move: Array) -> float:
    """The rotation [rad] about the centre of mass contained in the small displacement `move`."""
    arm = x - x.mean(axis=0)
    return float(np.sum(arm[:, 0] * move[:, 1] - arm[:, 1] * move[:, 0]) / np.sum(arm * arm))


def _rotation(x: Array, angle: float) -> Array:
    arm = x - x.mean(axis=0)
    return angle * np.stack([-arm[:, 1], arm[:, 0]], axis=1)


def _moved(x: Array, move: Array) -> Array:
    """`x` displaced by `move`, whose rotation is carried out as a finite one.

    Along the tangent, rolling by an angle would stretch the disk by half the angle's square.
    """
    angle = _angle(x, move)
    arm = x - x.mean(axis=0)
    drift = move.mean(axis=0)
    strain = move - drift - _rotation(x, angle)
    sine, versine = np.sin(angle), 2.0 * np.sin(angle / 2.0) ** 2
    # Added to x as an increment, so that a small step keeps the last digits of heights near the wall.
    turn = np.array([[-versine, sine], [-sine, -versine]])
    return x + (strain + drift + (arm + strain) @ turn)
