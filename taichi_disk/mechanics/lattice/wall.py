"""The elastic wall: a rectangle of the disk's material below the disk, with its top at
y = 0."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.lattice.lattice import (
    Lattice,
    stiffness_or_none,
    triangulate,
)
from taichi_disk.mechanics.lattice.random_points import (
    MIN_ROWS,
    least_distance,
    rectangle_points,
    rim_spacing,
)
from taichi_disk.mechanics.lattice.triangles import Indices


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
    n = disk.disk_points
    check_thickness(n, points, width)
    row = math.inf
    if rim:
        row = rim_spacing(n)
    x = rectangle_points(
        np.random.default_rng([seed, 1]),  # the disk uses `seed` alone
        points=points,
        low=np.array([-width / 2, -wall_height(n, points, width)]),
        high=np.array([width / 2, 0.0]),
        row=row,
        spacing=least_distance(n, min_spacing),
    )
    wall = triangulate(x)
    top, other_sides = _top_and_rest(wall)
    shift = np.int32(n)  # the wall's points follow those of the disk
    lowest = disk.positions[:, 1].min()
    above = disk.positions - [0.0, lowest]
    of_disk = disk.stiffened(np.ones(len(disk.bonds)))
    factors = np.append(of_disk, np.full(len(wall.bonds), stiffness))
    return replace(
        disk,
        positions=np.concatenate([above, wall.positions]),
        bonds=np.concatenate([disk.bonds, wall.bonds + shift]),
        rest_lengths=np.concatenate([disk.rest_lengths, wall.rest_lengths]),
        masses=np.append(disk.masses, np.full(points, 1.0 / n)),
        triangles=np.concatenate([disk.triangles, wall.triangles + shift]),
        wall_surface=top + shift,
        wall_boundary=other_sides + shift,
        stiffness=stiffness_or_none(factors),
    )


def _top_and_rest(mesh: Lattice) -> tuple[Indices, Indices]:
    """Return the top side of a rectangle, from left to right, and the other sides, from
    the left top corner to the right one. Both contain the two corners."""
    outline = mesh.disk_surface  # counter-clockwise
    x, y = mesh.positions[outline].T
    left_corner = np.argmax(y - x)
    right_corner = np.argmax(y + x)
    # from the left top corner down and around to the right one, then back along the top
    from_left = np.roll(outline, -left_corner)
    right_place = (right_corner - left_corner) % len(outline)
    other_sides = from_left[: right_place + 1]
    top_from_right = np.append(from_left[right_place:], from_left[0])
    return top_from_right[::-1], other_sides


def wall_height(disk_points: int, points: int, width: float) -> float:
    """Return the height [R] of a wall of `points` points with the disk's point density,
    disk_points/pi."""
    return math.pi * points / (disk_points * width)


def check_thickness(disk_points: int, points: int, width: float) -> None:
    """Raise InputError if a wall of this width is too thin, or has too few points."""
    row = rim_spacing(disk_points)
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
