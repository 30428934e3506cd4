"""The body: mass points joined by springs, the sides of triangles that tile it; the disk, and the elastic wall."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice import custom
from taichi_disk.lattice.random_points import circle_points, least_distance, rectangle_points, rim_points
from taichi_disk.lattice.triangles import (
    Array,
    Indices,
    Long,
    bond_lengths,
    centred,
    chain,
    delaunay,
    distinct_sides,
    double_area,
    pair_keys,
    polygon_area,
    reverse_cuthill_mckee,
    triangles_of,
    without_slivers,
)

_GAP = 5.0  # longest spring over the median; points at random have some of 4.4
_MIN_ROWS = 3  # rows of springs across the wall, below which it is a truss rather than a lattice


@dataclass(frozen=True)
class Lattice:
    """Mass points and springs: the disk, and after it the elastic wall where there is one.

    Every index array refers to rows of `positions`. Real numbers are float64, indices int32.
    Raises InputError for other arrays than are told here, numbers that are not finite, indices of no point.
    """

    positions: Array  # (n, 2), unloaded, in the body's own coordinates [R]
    bonds: Indices  # (m, 2), bonds[:, 0] < bonds[:, 1]; sorted lexicographically, the disk's before the wall's
    rest_lengths: Array  # (m,) [R]
    masses: Array  # (n,) [M]
    disk_points: int  # the first `disk_points` points are the disk, the rest the elastic wall
    disk_surface: Indices  # outline of the disk, counter-clockwise
    wall_surface: Indices  # elastic wall: top side, corners included, ordered by x (empty if none)
    wall_boundary: Indices  # elastic wall: left top corner -> bottom -> right top corner (empty if none)
    triangles: Indices  # (t, 3), counter-clockwise, the disk's before the wall's
    origin: str = "a lattice of one's own"  # what titles say of it

    def __post_init__(self) -> None:
        n, m, none = np.size(self.masses), np.size(self.rest_lengths), -1
        real = {"positions": (n, 2), "masses": (n,), "rest_lengths": (m,)}
        outlines = dict.fromkeys(("disk_surface", "wall_surface", "wall_boundary"), (none,))
        for name, (rows, *width) in {**real, "bonds": (m, 2), "triangles": (none, 3), **outlines}.items():
            array, kind = getattr(self, name), np.dtype(np.float64 if name in real else np.int32)
            shape = (np.size(array) // math.prod(width) if rows == none else rows, *width)
            fits = isinstance(array, np.ndarray) and (array.dtype, array.shape) == (kind, shape)
            _require(name, fits, f"{kind} of shape {shape}")
            low, high = (-math.inf if name == "positions" else 0.0, math.inf) if name in real else (-1, n)
            _require(name, ((low < array) & (array < high)).all(), f"numbers above {low:g} and below {high:g}")
        rising = (np.diff(self.bonds.astype(np.int64) @ [n, 1]) > 0).all() and (np.diff(self.bonds) > 0).all()
        _require("bonds", rising, "pairs i < j of points, sorted, each pair once")
        _require("disk_points", self.disk_points in range(1, n + 1), f"a whole number from 1 to {n}")

    @classmethod
    def disk(cls, points: int, seed: int = 0, rim: bool = True, min_spacing: float = 0.7) -> Lattice:
        """A disk of exactly `points` points of mass 1/points [M] in the unit circle (R = 1).

        The arguments are the keys of a scene's section `lattice`. The paper says no more than "at random": literally,
        that is rim=False, min_spacing=0. The same arguments give the same lattice on every machine, bit for bit.

        Raises:
            InputError: An argument is out of range.
            SimulationError: The points cannot be placed or meshed.
        """
        return replace(triangulate(circle_points(points, seed, rim, min_spacing)), origin=f"seed {seed}")

    @classmethod
    def from_points(
        cls, points: ArrayLike, springs: ArrayLike | None = None, rest_lengths: ArrayLike | None = None
    ) -> Lattice:
        """A disk-like body of your own: one piece, without holes, made of triangles; every point has the mass 1/n [M].

        Springs that are not given join Delaunay neighbours. Slivers along the hull are left out: a triangle whose outer
        side is longer than 3 times the median spring or 4 times the triangle's height, if its third point lies inside
        (after Duckham et al., Pattern Recognition 41, 3224, 2008). Springs that are given must make triangles; they may
        cross one another if the Delaunay triangles are among these.

        The lattice has the points in another order, its own: arrays for its points, as velocities, follow
        `lattice.positions`. With rest lengths unlike the distances, an impact begins strained, as given; a compression
        lets the free body come to rest first.

        Args:
            points: (n, 2) numbers [R], 3 to 2,000,000 points, no two the same. The larger of width and height is 1 to
                4 R, the centre of mass within 0.1 R of x = 0. Any y: the scene chooses the height.
            springs: (m, 2) whole numbers, pairs of rows of `points` from 0, each pair once. Every point is a corner of
                a triangle of springs. A notch is what no triangle covers; without `springs` a gap of 5 times the
                median spring is refused.
            rest_lengths: (m,) [R], above 0, in the order of `springs`; without, the springs are at rest at `points`.

        Returns a lattice without a wall. Its springs are sorted by their points.

        Raises:
            InputError: The points or springs are no such body; the message says where.
        """
        x = custom.checked_points(points)
        if springs is None:
            if rest_lengths is not None:
                raise InputError("rest_lengths need the springs that they belong to")
            triangles = delaunay(centred(x))
            lattice, _ = _first_whole(x, None, without_slivers(x, triangles), triangles)
            _check_gaps(lattice)
            return lattice
        bonds = custom.checked_springs(springs, len(x))
        lattice, order = _first_whole(x, bonds, *triangles_of(x, bonds))
        if rest_lengths is None:
            return lattice
        rest, rank = custom.checked_lengths(rest_lengths, len(bonds)), np.argsort(order)
        return replace(lattice, rest_lengths=rest[np.argsort(pair_keys(rank[bonds], len(x)))])


def _require(name: str, holds: Any, what: str) -> None:
    if not holds:
        raise InputError(f"Lattice.{name} must be {what}: Lattice.from_points makes a lattice of points and springs")


def triangulate(points: Array) -> Lattice:
    """The lattice of `points` (n, 2) and the springs of their Delaunay triangles, in the order of `tiled`.

    Raises SimulationError if the triangles do not tile the outline's interior and use every point.
    """
    return tiled(points, delaunay(points))[0]


def tiled(points: Array, triangles: Long, bonds: Long | None = None) -> tuple[Lattice, Long]:
    """Springs at rest on `bonds` (m, 2), by default the triangles' sides, between points of equal mass, 1 M in all.

    The points are renumbered by reverse Cuthill-McKee's order from the leftmost point, which keeps memory local, and
    the outline begins at its lowest index. Also returns the order: positions = points[order].
    Raises SimulationError if the `triangles` (t, 3) do not tile the outline's interior and use every point.
    """
    n = len(points)
    side, first, count = distinct_sides(triangles, n)
    outline = chain(side[first[count == 1]])
    area = 0.5 * float(double_area(points[triangles]).sum())
    whole = abs(area - polygon_area(points[outline])) <= 1e-9 * area
    euler = n - len(first) + len(triangles) == 1
    if not (whole and euler and len(np.unique(triangles)) == n):
        raise SimulationError("the triangulation is degenerate: choose another lattice seed")

    bonds = side[first] if bonds is None else bonds
    order = reverse_cuthill_mckee(bonds, n, int(np.argmin(points[:, 0])))
    rank = np.argsort(order)
    bonds = np.sort(rank[bonds], axis=1)
    bonds = bonds[np.argsort(bonds[:, 0] * n + bonds[:, 1])]
    outline = np.roll(rank[outline], -int(np.argmin(rank[outline])))
    ends, corners, surface, none = (one.astype(np.int32) for one in (bonds, rank[triangles], outline, np.empty(0)))
    x = points[order]
    return Lattice(x, ends, bond_lengths(x, bonds), np.full(n, 1.0 / n), n, surface, none, none, corners), order


def _first_whole(x: Array, bonds: Long | None, *candidates: Long) -> tuple[Lattice, Long]:
    """`tiled` by the first of the `candidates`, each (t, 3), that makes one piece."""
    for triangles in candidates:
        try:
            return tiled(x, triangles, bonds)
        except SimulationError:
            continue
    raise InputError("the springs' triangles do not make one piece without holes")


def _check_gaps(lattice: Lattice) -> None:
    length = lattice.rest_lengths
    k, typical = int(length.argmax()), float(np.median(length))
    if length[k] > _GAP * typical:
        (x, y), (u, v) = lattice.positions[lattice.bonds[k]]
        gap = f"a gap of {length[k]:.3g} R, where springs measure {typical:.3g} R"
        raise InputError(
            f"the spring from ({x:.4g}, {y:.4g}) to ({u:.4g}, {v:.4g}) would cross {gap}: fill it with points; "
            "or, where it is open to the outside, give `springs` (`bonds` in an npz file) "
            "that go round it: a body may have a notch, but no hole"
        )


def read_lattice(path: str | Path) -> Lattice:
    """The disk of the points in a file, made by `Lattice.from_points`.

    Either a csv file of two columns x, y [R], with or without the header "x,y"; or an npz file with `positions` (n, 2)
    and perhaps `bonds` (m, 2) and `rest_lengths` (m,), such as lattice.npz of a run. An elastic wall, which is the
    positions beyond `disk_points`, is not read, nor are masses. What a run has kept of a lattice that was not its
    scene's own (`unloaded`, see docs/output.md) is taken as it is, bit for bit.

    Raises InputError, with the file's name, if it cannot be read or its points are no disk.
    """
    path = Path(path)
    with custom.reading(path, "file"):
        data = custom.read_arrays(path)
        if "unloaded" in data:
            return _kept(data)
        return replace(Lattice.from_points(*custom.of_disk(data)), origin=path.name)


def _kept(data: Mapping[str, Any]) -> Lattice:
    x, bonds, triangles, none = data["unloaded"], data["bonds"], data["triangles"], np.empty(0, np.int32)
    n, springs = len(x), bonds[:, 1] < len(x)
    numbers = bonds[springs], data["rest_lengths"][springs], data["masses"][:n]
    corners = triangles[triangles.max(axis=1) < n]
    return Lattice(x, *numbers, n, data["disk_surface"], none, none, corners, str(data["origin"]))


def disk_of(lattice: Lattice) -> Lattice:
    """The disk of `lattice`, without its elastic wall if there is one.

    Raises InputError where it is no `Lattice`, or its masses are not equal, 1 M in all.
    """
    if not isinstance(lattice, Lattice):
        raise InputError(f"lattice: must be a Lattice, see Lattice.from_points, not {type(lattice).__name__}")
    n = lattice.disk_points
    if not np.allclose(lattice.masses, 1.0 / n, rtol=1e-9, atol=0.0):
        raise InputError(f"lattice: every point must have the mass 1/{n} M")
    if not len(lattice.wall_surface):
        return lattice
    springs, corners, none = lattice.bonds[:, 1] < n, lattice.triangles.max(axis=1) < n, lattice.wall_surface[:0]
    return replace(
        lattice,
        positions=lattice.positions[:n],
        bonds=lattice.bonds[springs],
        rest_lengths=lattice.rest_lengths[springs],
        masses=lattice.masses[:n],
        wall_surface=none,
        wall_boundary=none,
        triangles=lattice.triangles[corners],
    )


class OwnStart(NamedTuple):
    """What a run begins with in place of its scene's random disk or velocities, from Python or from a file."""

    disk: Lattice | None = None
    velocities: Array | None = None  # (N, 2) [c]

    @property
    def digest(self) -> str:
        """SHA-256 of the arrays; empty if there are none."""
        own = () if self.disk is None else (self.disk.positions, self.disk.bonds, self.disk.rest_lengths)
        data = b"".join(one.tobytes() for one in (*own, self.velocities) if one is not None)
        return hashlib.sha256(data).hexdigest() if data else ""

    def repeating(self, scene: Any) -> Any:
        """The scene that takes them from lattice.npz beside its file."""
        section = scene.lattice if self.disk is None else replace(scene.lattice, file="lattice.npz")
        section = section if self.velocities is None else replace(section, velocities="lattice.npz")
        return replace(scene, lattice=section)


def own_start(section: Any, lattice: Lattice | None, velocities: Any) -> OwnStart:
    """`lattice` and `velocities`, else those of the files that a scene's `section` lattice names.

    Of a file such as lattice.npz of a run the velocities are the disk's. Raises InputError, with the file's name.
    """
    if lattice is None and section.file != "none":
        lattice = read_lattice(section.file)
    if velocities is None and section.velocities != "none":
        with custom.reading(path := Path(section.velocities), "velocities"):
            data = custom.read_arrays(path)
            velocities = data["velocities"]
            velocities = velocities[: custom.points_of_disk(data, len(velocities))]
    thrown = None if velocities is None else custom.numbers(velocities, "velocities")
    return OwnStart(None if lattice is None else disk_of(lattice), thrown)


# ---- the elastic wall: a rectangle of the disk's material, its top at y = 0, under the disk


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
    # Surface and boundary: the outline cut at its top left and top right corner, which belong to both.
    x, y = mesh.positions[mesh.disk_surface].T
    outline = np.roll(mesh.disk_surface, -int(np.argmax(y - x)))
    x, y = mesh.positions[outline].T
    right = int(np.argmax(y + x))
    surface, boundary = np.append(outline[right:], outline[0])[::-1], outline[: right + 1]

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
