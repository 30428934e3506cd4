"""Equilibrium of a disk that a body force presses on the exponential wall, by Newton's
method."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from taichi_disk.base.errors import SimulationError
from taichi_disk.base.signals import raise_if_interrupted
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.lattice.network import symmetric_factors
from taichi_disk.mechanics.lattice.triangles import cross
from taichi_disk.mechanics.physics import ExponentialWall, Model, Springs

_EPS = np.finfo(np.float64).eps
_TOLERANCE = 1e-12  # largest residual force over the load on a point
# shifts of the diagonal, divided by the largest diagonal element of the stiffness
_FIRST_SHIFT = 1e-5
_MIN_SHIFT = 1e-12
_MAX_SHIFT = 1e6
_MAX_ROLL = 0.1  # largest rotation in a Newton step [rad]
_MAX_STRAIN = 1e-9  # largest strain of a spring of a disk at rest
_TIP_ANGLE = 1e-3  # rotation of a disk that is balanced on a tip [rad]


@dataclass(frozen=True)
class Equilibrium:
    """A state of minimum energy."""

    positions: Array  # (n, 2) [R], wall at y = 0
    iterations: int  # number of Newton iterations
    residual: float  # largest force component on any point [M c^2/R]
    roll: float  # counter-clockwise rotation relative to the unloaded lattice [rad]


def solve_equilibrium(
    lattice: Lattice,
    model: Model,
    start: Array,
    max_iterations: int = 400,
    is_close: bool = False,
) -> Equilibrium:
    """Find the stable equilibrium of a disk under its load on the exponential wall, or
    of a free disk.

    Newton's method lowers the energy from `start` (n, 2) and keeps the mean x. The disk
    rolls until its centre of mass is above the contact. Set `is_close` if `start` is
    the equilibrium under a similar load; then the first step is a full one.

    Raises SimulationError if the forces do not vanish within `max_iterations`.
    """
    x = start
    load = 0.0
    if model.load:
        load = model.load.force
    stiffest = model.springs.stiffness(lattice, x).diagonal().max()
    shift = _FIRST_SHIFT * stiffest
    if is_close:
        shift = _MIN_SHIFT * stiffest
    for iteration in range(max_iterations + 1):
        raise_if_interrupted()
        force = model.forces(lattice, x)
        tangent = model.stiffness(lattice, x)
        residual = float(np.abs(force).max())
        goal = max(_TOLERANCE * load / len(x), _rounding_force(tangent, x))
        if residual > goal:
            x, shift = _downhill(lattice, model, x, force, tangent, shift, stiffest)
        elif _factors(tangent, _MIN_SHIFT * stiffest) is None:
            x = turned(x, _TIP_ANGLE)  # an unstable equilibrium, balanced on a tip
        else:
            roll = roll_angle(lattice.positions, x)
            return Equilibrium(x, iteration, residual, roll)
    raise SimulationError(
        f"no equilibrium within {max_iterations} Newton iterations (force"
        f" {residual:.1e}, needed {goal:.1e}): lower compression.pressure or wall.a"
    )


def relaxed(disk: Lattice, springs: Springs) -> Lattice:
    """Return the free disk at rest, which differs from `disk` if its springs are
    strained."""
    if np.abs(springs.strain(disk, disk.positions)).max() <= _MAX_STRAIN:
        return disk
    rest = solve_equilibrium(disk, Model(springs), disk.positions)
    return replace(disk, positions=rest.positions)


def _rounding_force(tangent: Any, x: Array) -> float:
    """Return the rounding error of the force on a point [M c^2/R]."""
    # About ten forces act on a point, and the last bit of a coordinate rounds each of
    # them.
    stiffest = tangent.diagonal().max()
    return 10.0 * _EPS * stiffest * max(1.0, np.abs(x).max())


def _downhill(
    lattice: Lattice,
    model: Model,
    x: Array,
    force: Array,
    tangent: Any,
    shift: float,
    stiffest: float,
) -> tuple[Array, float]:
    """Make a Levenberg-Marquardt step; return the new positions and the next shift of
    the tangent's diagonal."""
    # The shift grows until the matrix is positive definite and the energy falls by a
    # tenth of the predicted amount. It may become tiny, because rolling, which may be
    # 1e-8 times as stiff as the springs, must converge too.
    energy = model.energy(lattice, x)
    residual = np.abs(force).max()
    while shift < _MAX_SHIFT * stiffest:
        factors = _factors(tangent, shift)
        if factors is None:
            shift *= 4.0
            continue
        move = factors.solve(force.ravel()).reshape(-1, 2)
        # removes rounding errors that would make the disk slide along the wall
        move[:, 0] -= move[:, 0].mean()
        slope = np.sum(move * force)
        curvature = slope - shift * np.sum(move * move)
        rotation = max(abs(_rotation(x, move)), _EPS)
        fraction = min(1.0, _MAX_ROLL / rotation)
        for _ in range(12):
            trial = _moved(x, fraction * move)
            predicted = fraction * slope - 0.5 * fraction**2 * curvature
            if predicted > 64.0 * _EPS * abs(energy):
                gain = (energy - model.energy(lattice, trial)) / predicted
            else:
                # The change of energy is below rounding errors, so judge by the forces.
                largest = np.abs(model.forces(lattice, trial)).max()
                gain = float(largest <= 2.0 * residual)
            if gain > 0.1:
                if fraction == 1.0 and gain > 0.5:
                    shift = max(shift / 10.0, _MIN_SHIFT * stiffest)
                elif gain < 0.25:
                    shift *= 4.0
                return trial, shift
            fraction /= 2.0
        shift *= 8.0
    raise SimulationError(
        "Newton's method could not lower the energy further: lower compression.pressure"
        " or wall.a"
    )


def _factors(matrix: Any, shift: float) -> Any:
    """Return the factors of `matrix` + `shift` times the identity, or None unless it is
    positive definite."""
    from scipy.sparse import identity

    try:
        factors = symmetric_factors(matrix + shift * identity(matrix.shape[0]))
    except RuntimeError:  # a pivot is 0
        return None
    if (factors.U.diagonal() > 0.0).all():  # it is positive definite
        return factors
    return None


def _rotation(x: Array, move: Array) -> float:
    arm = x - x.mean(axis=0)
    return np.sum(cross(arm, move)) / np.sum(arm * arm)


def _moved(x: Array, move: Array) -> Array:
    """Displace `x` by `move`, with its rotation made a finite one, because a linear one
    would stretch the disk."""
    angle = _rotation(x, move)
    drift = move.mean(axis=0)
    arm_x, arm_y = (x - x.mean(axis=0)).T
    linear_rotation = angle * np.stack([-arm_y, arm_x], axis=1)
    strain = move - drift - linear_rotation
    return turned(x + strain, angle) + drift


def roll_angle(unloaded: Array, positions: Array) -> float:
    """Return the rotation [rad], -pi to pi, that fits `positions` (n, 2) to `unloaded`
    by least squares."""
    before = unloaded - unloaded.mean(axis=0)
    after = positions - positions.mean(axis=0)
    sine = np.sum(cross(before, after))
    cosine = np.sum(before * after)
    return math.atan2(sine, cosine)


def depth(lattice: Lattice, positions: Array) -> float:
    y = positions[:, 1]
    return float(lattice.mean(y) - y.min())


def turned(positions: Array, angle: float) -> Array:
    """Rotate `positions` (n, 2) about their mean, counter-clockwise [rad]."""
    cos = np.cos(angle)
    sin = np.sin(angle)
    centre = positions.mean(axis=0)
    return centre + (positions - centre) @ [[cos, sin], [-sin, cos]]


# ---- a rigid disk


def resting_angle(disk: Lattice, modulus: float, a: float, pressure: float) -> float:
    """Return the counter-clockwise rotation at which the unloaded disk rests on the
    wall [rad]."""
    # A rigid body on a wall V0 exp(-y/L) minimizes L ln sum_i exp(-y_i/L), with y_i
    # relative to the centre of mass. With L = 1/a + 2 P/(pi E) the contact is about as
    # wide as Hertz's.
    from scipy.optimize import minimize_scalar

    decay_length = 1.0 / a + 2.0 * pressure / (np.pi * modulus)
    surface = disk.positions[disk.disk_surface]
    x, y = (surface - disk.mean(disk.positions)).T

    def height(angle: float) -> float:
        """Return the height of the centre of mass of the rotated disk."""
        depths = -np.sin(angle) * x - np.cos(angle) * y
        deepest = depths.max()
        weights = np.exp((depths - deepest) / decay_length)
        return deepest + decay_length * np.log(weights.sum())

    count = max(360, 4 * len(x))
    angles, step = np.linspace(-np.pi, np.pi, count, endpoint=False, retstep=True)
    best = min(angles, key=height)
    around_best = (best - step, best + step)
    return float(minimize_scalar(height, bounds=around_best, method="bounded").x)


def place_on_wall(
    disk: Lattice, angle: float, wall: ExponentialWall, load: float
) -> Lattice:
    """Rotate `disk` to the resting `angle` and move it to the height at which the wall
    carries the `load`."""
    # From another angle it would roll for 10^4 R/c, and the compression would refer to
    # the wrong radius.
    positions = turned(disk.positions, angle)
    heights = positions[:, 1]
    lowest = heights.min()
    lift = wall.height_of_force(load, heights - lowest) - lowest
    return replace(disk, positions=positions + [0.0, lift])
