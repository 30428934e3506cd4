"""The disk at rest, pressed by a body force on the exponential wall: an energy minimum by Newton's method."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_disk.errors import SimulationError
from taichi_disk.lattice import Array, Lattice
from taichi_disk.lattice.network import symmetric_factors
from taichi_disk.physics import ExponentialWall, Model
from taichi_disk.signals import raise_if_interrupted

_EPS = float(np.finfo(np.float64).eps)
_TOLERANCE = 1e-12  # of the load on a point
_FIRST_SHIFT, _LEAST_SHIFT, _LAST_SHIFT = 1e-5, 1e-12, 1e6  # in units of the stiffest degree of freedom
_MOST_ROLL = 0.1  # [rad] in a step
_TIP = 1e-3  # [rad]


@dataclass(frozen=True)
class Equilibrium:
    """An energy minimum.

    Attributes:
        positions: (n, 2) [R], wall at y = 0.
        iterations: of Newton's method.
        residual: largest force component left on any point [M c^2/R].
        roll: by how much the disk has turned, counter-clockwise, against the unloaded lattice [rad].
    """

    positions: Array
    iterations: int
    residual: float
    roll: float


def solve_equilibrium(
    lattice: Lattice, model: Model, start: Array, max_iterations: int = 400, near: bool = False
) -> Equilibrium:
    """The stable rest of a disk under its load, on the exponential wall; or of a free disk.

    Newton's method, kept on the way downhill in energy from `start` (n, 2). The mean x stays: nothing else fixes it. A
    disk whose centre of mass is not above its contact rolls, as it would in reality, until it is.

    `near`: `start` is the rest under a load that is not much larger, so that the first steps may be whole ones.

    Raises SimulationError where the forces do not vanish within `max_iterations`.
    """
    x, load = start, model.load.force if model.load else 0.0
    stiffest = float(model.springs.stiffness(lattice, x).diagonal().max())
    shift = (_LEAST_SHIFT if near else _FIRST_SHIFT) * stiffest
    for iteration in range(max_iterations + 1):
        raise_if_interrupted()
        force, tangent = model.forces(lattice, x), model.stiffness(lattice, x)
        residual = float(np.abs(force).max())
        # Some ten forces meet in a point, each as sharp as the last bit of a coordinate lets it be.
        rounding = 10.0 * _EPS * float(tangent.diagonal().max()) * max(1.0, float(np.abs(x).max()))
        goal = max(_TOLERANCE * load / len(x), rounding)
        if residual > goal:
            x, shift = _downhill(lattice, model, x, force, tangent, shift, stiffest)
        elif _factors(tangent, _LEAST_SHIFT * stiffest) is None:
            x = turned(x, _TIP)  # at rest, but balanced on a tip
        else:
            return Equilibrium(x, iteration, residual, roll_angle(lattice.positions, x))
    raise SimulationError(
        f"no equilibrium within {max_iterations} Newton iterations (force {residual:.1e}, wanted {goal:.1e}):"
        " lower compression.pressure or wall.a"
    )


def _downhill(
    lattice: Lattice, model: Model, x: Array, force: Array, tangent: Any, shift: float, stiffest: float
) -> tuple[Array, float]:
    """One Levenberg-Marquardt step: new positions, and the next shift of the tangent's diagonal.

    The shift grows until the matrix is positive definite and the energy falls by a fair part of what the quadratic
    model promises. It shrinks to next to nothing: rolling may be 1e-8 times as stiff as the springs, yet must converge.
    """
    energy, residual = model.energy(lattice, x), np.abs(force).max()
    while shift < _LAST_SHIFT * stiffest:
        factors = _factors(tangent, shift)
        if factors is None:
            shift *= 4.0
            continue
        move = factors.solve(force.ravel()).reshape(-1, 2)
        move[:, 0] -= move[:, 0].mean()  # rounding, which would make the disk slide along the wall
        slope = float(np.sum(move * force))
        curvature = slope - shift * float(np.sum(move * move))
        part = min(1.0, _MOST_ROLL / max(abs(_rotation(x, move)), _EPS))
        for _ in range(12):
            trial = _moved(x, part * move)
            promised = part * slope - 0.5 * part**2 * curvature
            if promised > 64.0 * _EPS * abs(energy):
                kept = (energy - model.energy(lattice, trial)) / promised
            else:  # below the rounding of the energy, the forces must tell
                kept = float(np.abs(model.forces(lattice, trial)).max() <= 2.0 * residual)
            if kept > 0.1:
                if part == 1.0 and kept > 0.5:
                    shift = max(shift / 10.0, _LEAST_SHIFT * stiffest)
                elif kept < 0.25:
                    shift *= 4.0
                return trial, shift
            part /= 2.0
        shift *= 8.0
    raise SimulationError("Newton's method found no way downhill to a rest: lower compression.pressure or wall.a")


def _factors(matrix: Any, shift: float) -> Any:
    """Factors of matrix + shift, or None where that is not positive definite."""
    from scipy.sparse import identity

    factors = symmetric_factors(matrix + shift * identity(matrix.shape[0]))
    return factors if bool((factors.U.diagonal() > 0.0).all()) else None


def _rotation(x: Array, move: Array) -> float:
    """The rotation [rad] about the centre of mass contained in the small displacement `move`."""
    arm = x - x.mean(axis=0)
    return float(np.sum(arm[:, 0] * move[:, 1] - arm[:, 1] * move[:, 0]) / np.sum(arm * arm))


def _moved(x: Array, move: Array) -> Array:
    """`x` displaced by `move`, its rotation a finite one: along the tangent it would stretch the disk by its square."""
    angle, arm, drift = _rotation(x, move), x - x.mean(axis=0), move.mean(axis=0)
    strain = move - drift - angle * np.stack([-arm[:, 1], arm[:, 0]], axis=1)
    return turned(x + strain, angle) + drift


def roll_angle(unloaded: Array, positions: Array) -> float:
    """The rotation [rad], -pi to pi, that best (in least squares) takes points (n, 2) into others."""
    before, after = (p - p.mean(axis=0) for p in (unloaded, positions))
    across = float(np.sum(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0]))
    return math.atan2(across, float(np.sum(before * after)))


def depth(lattice: Lattice, positions: Array) -> float:
    """How far the lowest of the points (n, 2) of a disk lies below its centre of mass [R]."""
    y = positions[:, 1]
    return float(lattice.mean(y) - y.min())


def turned(positions: Array, angle: float) -> Array:
    """`positions` (n, 2) turned about their mean, counter-clockwise [rad]."""
    c, s = np.cos(angle), np.sin(angle)
    centre = positions.mean(axis=0)
    return centre + (positions - centre) @ np.array([[c, s], [-s, c]])


# ---- a rigid disk


def rigid_balance(heights: Array, wall: ExponentialWall, load: float) -> float:
    """How far to lift points at `heights` (n,) [R] for the wall to bear the `load`: sum_i a V0 exp(-a y_i) = P."""
    lowest = float(heights.min())
    return wall.height_of_force(load, heights - lowest) - lowest


def resting_angle(disk: Lattice, modulus: float, a: float, pressure: float) -> float:
    """The angle [rad], counter-clockwise, by which the unloaded disk has to be turned to lie lowest.

    On a wall V0 exp(-y/L) a rigid body rests where L ln sum_i exp(-y_i/L), y_i against the centre of mass, is smallest.
    L = 1/a + 2 P/(pi E) makes its contact about as wide as Hertz's.
    """
    from scipy.optimize import minimize_scalar

    depth = 1.0 / a + 2.0 * pressure / (np.pi * modulus)
    x, y = (disk.positions[disk.disk_surface] - disk.mean(disk.positions)).T

    def height(angle: float) -> float:
        below = -np.sin(angle) * x - np.cos(angle) * y
        lowest = below.max()
        return float(lowest + depth * np.log(np.exp((below - lowest) / depth).sum()))

    angles, step = np.linspace(-np.pi, np.pi, max(360, 4 * len(x)), endpoint=False, retstep=True)
    best = float(min(angles, key=height))
    return float(minimize_scalar(height, bounds=(best - step, best + step), method="bounded").x)


def place_on_wall(disk: Lattice, angle: float, wall: ExponentialWall, load: float) -> Lattice:
    """`disk` turned by the `angle` at which it rests, and so high that the wall bears the `load`.

    Put down at another angle it would roll for 10^4 R/c, and the compression be measured against the wrong radius.
    """
    positions = turned(disk.positions, angle)
    return replace(disk, positions=positions + np.array([0.0, rigid_balance(positions[:, 1], wall, load)]))
