"""The elastic wall: a rectangle of the disk's material, its top at y = 0, under the disk."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from taichi_disk.errors import InputError
from taichi_disk.lattice.disk import least_distance, rim_points, scatter
from taichi_disk.lattice.lattice import Array, Indices, Lattice, triangulate

_MIN_ROWS = 3  # rows of springs across the wall, below which it is a truss rather than a lattice


def with_wall(
    disk: Lattice, points: int, width: float, seed: int, rim: bool = True, min_spacing: float = 0.7
) -> Lattice:
    """`disk`, which has no wall yet, just touching an elastic wall of the same material, centred at x = 0 below y = 0.

    The wall has the disk's mass per point and disk_points/pi points per R^2. No bond joins disk and wall. `rim` lays
    rows of points along its sides, spaced as on the disk's rim.

    Raises:
        InputError: The wall is too thin; the message gives the range allowed.
        SimulationError: The points cannot be placed or meshed.
    """
    spacing = least_distance(disk.disk_points, min_spacing)
    check_thickness(disk.disk_points, points, width)
    # The disk has drawn from the stream of the seed itself.
    rng = np.random.default_rng([seed, 1])
    row = 2.0 * math.pi / rim_points(disk.disk_points) if rim else math.inf
    low = np.array([-width / 2, -wall_height(disk.disk_points, points, width)])
    mesh = triangulate(rectangle_points(rng, points, low, np.array([width / 2, 0.0]), row, spacing))
    surface, boundary = _split(mesh)

    n = disk.disk_points
    lift = np.array([0.0, -disk.positions[:, 1].min()])
    return replace(
        disk,
        positions=np.concatenate([disk.positions + lift, mesh.positions]),
        bonds=np.concatenate([disk.bonds, mesh.bonds + np.int32(n)]),
        rest_lengths=np.concatenate([disk.rest_lengths, mesh.rest_lengths]),
        masses=np.full(n + points, 1.0 / n),
        wall_surface=surface + np.int32(n),
        wall_boundary=boundary + np.int32(n),
        triangles=np.concatenate([disk.triangles, mesh.triangles + np.int32(n)]),
    )


def wall_height(disk_points: int, points: int, width: float) -> float:
    """Height [R] of a wall of `points` points at the number density disk_points/pi of the disk."""
    return math.pi * points / (disk_points * width)


def rectangle_points(
    rng: np.random.Generator, points: int, low: Array, high: Array, row: float, spacing: float
) -> Array:
    """`points` points (points, 2) in the box `low`..`high`, at least `spacing` apart.

    They include evenly spaced rows, about `row` apart, along the four sides; none if `row` is infinite.
    Raises InputError if the rows alone take all the points.
    """
    frame: Array = np.empty((0, 2))
    clear = 0.0
    if math.isfinite(row):
        frame, clear = _frame(low, high, row), spacing * math.sqrt(0.75)
    if points <= len(frame):
        raise InputError(f"{points} points are too few for the rows along the sides of a rectangle: widen it")
    low, high = low + clear, high - clear

    def depth(p: Array) -> Array:
        return np.minimum(p - low, high - p).min(axis=1)

    return np.concatenate([frame, scatter(rng, points - len(frame), low, high, depth, spacing, frame)])


def _frame(low: Array, high: Array, row: float) -> Array:
    """Bottom, top, left and right."""
    nx, ny = (max(round(float(s) / row), 1) for s in high - low)
    x, y = np.linspace(low[0], high[0], nx + 1), np.linspace(low[1], high[1], ny + 1)[1:-1]
    rows = [np.stack([x, np.full_like(x, level)], axis=1) for level in (low[1], high[1])]
    return np.concatenate(rows + [np.stack([np.full_like(y, at), y], axis=1) for at in (low[0], high[0])])


def check_thickness(disk_points: int, points: int, width: float) -> None:
    """Raises InputError, with the range allowed, for a wall too thin to be a lattice."""
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


def _split(mesh: Lattice) -> tuple[Indices, Indices]:
    """Surface and boundary: the outline cut at its top left and top right corner, which belong to both."""
    x, y = mesh.positions[mesh.disk_surface].T
    from_left = np.roll(mesh.disk_surface, -int(np.argmax(y - x)))
    x, y = mesh.positions[from_left].T
    right = int(np.argmax(y + x))
    return np.append(from_left[right:], from_left[0])[::-1], from_left[: right + 1]
