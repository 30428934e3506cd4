"""The elastic wall: a rectangle of the disk's material below the disk, with its top at
y = 0."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from taichi_disk.errors import InputError
from taichi_disk.lattice.lattice import Lattice, triangulate
from taichi_disk.lattice.random_points import (
    MIN_ROWS,
    least_distance,
    rectangle_points,
    rim_points,
)


def with_wall(
    disk: Lattice,
    points: int,
    width: float,
    seed: int,
    rim: bool = True,
    min_spacing: float = 0.7,
    stiffness: float = 1.0,
) -> Lattice:
    """Return `disk` with an elastic wall below, whose top side it touches at y = 0,
    centred at x = 0.

    The wall has the mass per point, 1/disk_points M, and the point density,
    disk_points/pi per R^2, of a plain disk. `stiffness` is the factor of its springs.
    No bond joins disk and wall. `rim`: whether points lie along the wall's sides,
    spaced as on the disk's rim.

    Raises InputError if the wall is too thin, SimulationError if its points cannot be
    placed or meshed.
    """
    spacing = least_distance(disk.disk_points, min_spacing)
    check_thickness(disk.disk_points, points, width)
    # The disk uses the random numbers of `seed` alone.
    rng = np.random.default_rng([seed, 1])
    row = 2.0 * math.pi / rim_points(disk.disk_points) if rim else math.inf
    low = np.array([-width / 2, -wall_height(disk.disk_points, points, width)])
    mesh = triangulate(
        rectangle_points(rng, points, low, np.array([width / 2, 0.0]), row, spacing)
    )
    # The top left and top right corners belong to both surface and boundary.
    x, y = mesh.positions[mesh.disk_surface].T
    outline = np.roll(mesh.disk_surface, -int(np.argmax(y - x)))
    x, y = mesh.positions[outline].T
    right = int(np.argmax(y + x))
    surface, boundary = (
        np.append(outline[right:], outline[0])[::-1],
        outline[: right + 1],
    )

    n = disk.disk_points
    lift = np.array([0.0, -disk.positions[:, 1].min()])
    return replace(
        disk,
        positions=np.concatenate([disk.positions + lift, mesh.positions]),
        bonds=np.concatenate([disk.bonds, mesh.bonds + np.int32(n)]),
        rest_lengths=np.concatenate([disk.rest_lengths, mesh.rest_lengths]),
        masses=np.concatenate([disk.masses, np.full(points, 1.0 / n)]),
        wall_surface=surface + np.int32(n),
        wall_boundary=boundary + np.int32(n),
        triangles=np.concatenate([disk.triangles, mesh.triangles + np.int32(n)]),
        stiffness=(
            None
            if disk.stiffness is None and stiffness == 1.0
            else np.append(
                disk.stiffened(np.ones(len(disk.bonds))),
                np.full(len(mesh.bonds), stiffness),
            )
        ),
    )


def wall_height(disk_points: int, points: int, width: float) -> float:
    """Return the height [R] of a wall of `points` points with the disk's point density,
    disk_points/pi."""
    return math.pi * points / (disk_points * width)


def check_thickness(disk_points: int, points: int, width: float) -> None:
    row = 2.0 * math.pi / rim_points(disk_points)
    # With fewer points, the rows along the sides of the widest or narrowest wall would
    # need all of them.
    fewest = math.ceil(20.0 * row**2 * disk_points / math.pi)
    if points < fewest:
        raise InputError(
            f"wall.points must be at least {fewest} for a disk of {disk_points} points,"
            f" not {points}"
        )
    least = MIN_ROWS * row
    most = wall_height(disk_points, points, least)
    if not least <= width <= most:
        raise InputError(
            f"wall.width must be between {least:.4g} and {most:.4g} for {points}"
            f" points, not {width}: the wall must be at least {MIN_ROWS} springs thick"
        )
