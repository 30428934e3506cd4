"""The elastic wall: a rectangle of the disk's material, its top at y = 0, under the disk."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import InputError
from taichi_disk.lattice import Lattice, bond_lengths, check_spacing, rim_points
from taichi_disk.scatter import hexagonal_spacing, scatter
from taichi_disk.triangulation import Mesh, triangulate

_MIN_ROWS = 3  # rows of springs across the wall, below which it is a truss rather than a lattice


def with_wall(
    disk: Lattice, points: int, width: float, seed: int, rim: bool, min_spacing: float, gap: float
) -> Lattice:
    """`disk`, its lowest point raised to y = `gap` [R], over a wall of `points` points, `width` [R] wide.

    The wall has the disk's mass per point and points per area, so it is pi points/(disk_points width) [R]
    high; it is centred at x = 0 below y = 0. With `rim` a row of points, spaced as on the disk's rim, lies
    along each side. No bond joins disk and wall. Disk first, unchanged but for its height.

    Raises InputError with the range allowed if the wall is too thin, SimulationError as `disk_lattice` does.
    """
    check_spacing(min_spacing)
    _check_thickness(disk.disk_points, points, width)
    # The disk has drawn from the stream of the seed itself.
    rng = np.random.default_rng([seed, 1])
    spacing = min_spacing * hexagonal_spacing(disk.disk_points)
    row = 2.0 * math.pi / rim_points(disk.disk_points) if rim else math.inf
    low = np.array([-width / 2, -wall_height(disk.disk_points, points, width)])
    mesh = triangulate(rectangle_points(rng, points, low, np.array([width / 2, 0.0]), row, spacing))
    surface, boundary = _split(mesh)

    n = disk.disk_points
    lift = np.array([0.0, gap - disk.positions[:, 1].min()])
    return Lattice(
        positions=np.concatenate([disk.positions + lift, mesh.positions]),
        bonds=np.concatenate([disk.bonds, mesh.bonds + np.int32(n)]),
        rest_lengths=np.concatenate([disk.rest_lengths, bond_lengths(mesh.positions, mesh.bonds)]),
        masses=np.full(n + points, 1.0 / n),
        disk_points=n,
        disk_surface=disk.disk_surface,
        wall_surface=surface + np.int32(n),
        wall_boundary=boundary + np.int32(n),
    )


def wall_height(disk_points: int, points: int, width: float) -> float:
    """Height [R] of a wall of `points` points at the number density disk_points/pi of the disk."""
    return math.pi * points / (disk_points * width)


def rectangle_points(
    rng: np.random.Generator,
    points: int,
    low: NDArray[np.float64],
    high: NDArray[np.float64],
    row: float,
    spacing: float,
) -> NDArray[np.float64]:
    """`points` points (points, 2) in the box `low`..`high`, at least `spacing` apart.

    They include evenly spaced rows, about `row` apart, along the four sides; none if `row` is infinite.
    Raises InputError if the rows alone take all the points.
    """
    if math.isinf(row):
        frame, clear = np.empty((0, 2)), 0.0
    else:
        frame, clear = _frame(low, high, row), spacing * math.sqrt(0.75)
    if points <= len(frame):
        raise InputError(f"{points} points are too few for the rows along the sides of a rectangle: widen it")
    low, high = low + clear, high - clear

    def depth(p: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.minimum(p - low, high - p).min(axis=1)

    return np.concatenate([frame, scatter(rng, points - len(frame), low, high, depth, spacing, frame)])


def _frame(low: NDArray[np.float64], high: NDArray[np.float64], row: float) -> NDArray[np.float64]:
    nx, ny = (max(round(float(s) / row), 1) for s in high - low)
    x, y = np.linspace(low[0], high[0], nx + 1), np.linspace(low[1], high[1], ny + 1)
    return np.concatenate(
        [
            np.stack([x, np.full(nx + 1, low[1])], axis=1),
            np.stack([x, np.full(nx + 1, high[1])], axis=1),
            np.stack([np.full(ny - 1, low[0]), y[1:-1]], axis=1),
            np.stack([np.full(ny - 1, high[0]), y[1:-1]], axis=1),
        ]
    )


def _check_thickness(disk_points: int, points: int, width: float) -> None:
    row = 2.0 * math.pi / rim_points(disk_points)
    # So many that rows along all sides leave some points for the inside, whatever the width allowed.
    fewest = math.ceil(20.0 * row**2 * disk_points / math.pi)
    if points < fewest:
        raise InputError(f"wall.points must be at least {fewest} beside a disk of {disk_points}, not {points}")
    least = _MIN_ROWS * row
    most = wall_height(disk_points, points, least)
    if not least <= width <= most:
        raise InputError(
            f"wall.width must be between {least:.4g} and {most:.4g} for {points} points, not {width}:"
            f" {_MIN_ROWS} rows of springs need that thickness"
        )


def _split(mesh: Mesh) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Surface and boundary: the outline cut at its top left and top right corner, which belong to both."""
    x, y = mesh.positions[mesh.outline].T
    from_left = np.roll(mesh.outline, -int(np.argmax(y - x)))
    x, y = mesh.positions[from_left].T
    right = int(np.argmax(y + x))
    return np.append(from_left[right:], from_left[0])[::-1], from_left[: right + 1]
