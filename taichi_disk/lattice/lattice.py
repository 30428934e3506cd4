"""The body: mass points joined by springs, the sides of triangles that tile it; the disk, whole or with a hole."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice import custom
from taichi_disk.lattice.random_points import (
    circle_points,
)
from taichi_disk.lattice.triangles import (
    GAP,
    Array,
    Indices,
    Long,
    bond_lengths,
    centred,
    chains,
    delaunay,
    distinct_sides,
    double_area,
    pair_keys,
    polygon_area,
    reverse_cuthill_mckee,
    triangles_of,
    without_bridges,
    without_slivers,
)


@dataclass(frozen=True)
class Lattice:
    """Mass points and springs: the disk, and after it the elastic wall where there is one.

    Every index array refers to rows of `positions`. Real numbers are float64, indices int32.
    Raises InputError for other arrays than are told here, numbers that are not finite, indices of no point.
    """

    positions: Array  # (n, 2), unloaded, in the body's own coordinates [R]
    bonds: Indices  # (m, 2), bonds[:, 0] < bonds[:, 1]; sorted lexicographically, the disk's before the wall's
    rest_lengths: Array  # (m,) [R]
    masses: Array  # (n,) [M], the disk's 1 M in all
    disk_points: int  # the first `disk_points` points are the disk, the rest the elastic wall
    disk_surface: Indices  # outer outline of the disk, counter-clockwise
    wall_surface: Indices  # elastic wall: top side, corners included, ordered by x (empty if none)
    wall_boundary: Indices  # elastic wall: left top corner -> bottom -> right top corner (empty if none)
    triangles: Indices  # (t, 3), counter-clockwise, the disk's before the wall's
    origin: str = "a lattice of one's own"  # what titles say of it
    stiffness: Array | None = None  # (m,) by which k_a, k_b and eta of each spring are multiplied; None: by 1

    def __post_init__(self) -> None:
        n, m, none = np.size(self.masses), np.size(self.rest_lengths), -1
        real = {"positions": (n, 2), "masses": (n,), "rest_lengths": (m,)}
        if self.stiffness is not None:
            real["stiffness"] = (m,)
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

    @property
    def whole(self) -> bool:
        """Whether the disk has no hole: by Euler's formula its triangles are then as many as its points allow."""
        n = self.disk_points
        return np.count_nonzero(self.triangles[:, 0] < n) == 2 * n - 2 - len(self.disk_surface)

    def mean(self, values: Array) -> Any:
        """Mean over the disk's points of `values` (n, ...), weighted with mass: of positions the centre of mass."""
        n = self.disk_points
        return np.average(values[:n], axis=0, weights=self.masses[:n])

    @property
    def inertia(self) -> float:
        """Moment of inertia of the disk about its centre of mass [M R^2]."""
        return float(self.mean(((self.positions - self.mean(self.positions)) ** 2).sum(axis=1)))

    def stiffened(self, values: Any) -> Any:
        """`values` (..., m) of the springs, or one of all, times `stiffness`."""
        return values if self.stiffness is None else self.stiffness * values

    # ---- where lattices come from

    @classmethod
    def disk(
        cls,
        points: int,
        seed: int = 0,
        rim: bool = True,
        min_spacing: float = 0.7,
        hole: float = 0.0,
        core_radius: float = 0.0,
        core_stiffness: float = 1.0,
        core_density: float = 1.0,
    ) -> Lattice:
        """A disk of exactly `points` points in the unit circle (R = 1), of 1 M in all.

        The arguments are the keys of a scene's section `lattice`. The same arguments give the same lattice on every
        machine, bit for bit.
        On the edges of hole and core there are evenly spaced points, as on the rim. What lies on the core's edge has
        the mean of both materials: half of a point's area, and one of a spring's two triangles, are of each.

        Args:
            points: how many, 3 to 2,000,000.
            seed: of the random points.
            rim: whether evenly spaced points lie on the circle.
            min_spacing: least distance of inner points, in spacings of the hexagonal lattice. The paper says no more
                than "at random": literally, that is rim=False, min_spacing=0.
            hole: radius of a concentric hole [R]; 0: none.
            core_radius: of a concentric core of another material [R]; 0: none.
            core_stiffness: of the core's springs over the others'.
            core_density: of the core over the rest.

        Raises:
            InputError: An argument is out of range.
            SimulationError: The points cannot be placed or meshed.
        """
        x = circle_points(points, seed, rim, min_spacing, hole, core_radius)
        triangles = delaunay(x)
        if hole:  # on its edge alone: those that bridge it
            triangles = triangles[(_distance(x) > (1.0 + 1e-9) * hole)[triangles].any(axis=1)]
        lattice = replace(tiled(x, triangles)[0], origin=f"seed {seed}" + f", hole {hole:g} R" * bool(hole))
        if not core_radius:
            return lattice
        side = np.sign(np.round(core_radius - _distance(lattice.positions), 9))  # 1: inside, 0: on the edge
        masses = 0.5 * (1.0 + core_density + side * (core_density - 1.0))
        stiffness = 0.5 * (1.0 + core_stiffness + np.sign(side[lattice.bonds].sum(axis=1)) * (core_stiffness - 1.0))
        origin = f"{lattice.origin}, core {core_radius:g} R: k × {core_stiffness:g}, ρ × {core_density:g}"
        return replace(lattice, origin=origin, **_unlike(masses, stiffness))

    @classmethod
    def from_points(
        cls,
        points: ArrayLike,
        springs: ArrayLike | None = None,
        rest_lengths: ArrayLike | None = None,
        *,
        triangles: ArrayLike | None = None,
        stiffness: ArrayLike | None = None,
        masses: ArrayLike | None = None,
    ) -> Lattice:
        """A disk-like body of your own: one piece, perhaps with holes, made of triangles.

        Springs that are not given join Delaunay neighbours. Slivers along the hull are left out: a triangle whose outer
        side is longer than 3 times the median spring or 4 times the triangle's height, if its third point lies inside
        (after Duckham et al., Pattern Recognition 41, 3224, 2008). If a spring is still longer than 5 times the median,
        triangles are left out whose circumcircle, in which there is no point, is wider than that: so holes stay open.
        Springs that are given must make triangles; they may cross one another if the Delaunay triangles are among
        these. A hole is what no triangle covers.

        The lattice has the points in another order, its own: arrays for its points, as velocities, follow
        `lattice.positions`. With rest lengths unlike the distances, an impact begins strained, as given; a compression
        lets the free body come to rest first.

        Args:
            points: (n, 2) numbers [R], 3 to 2,000,000 points, no two the same. The larger of width and height is 1 to
                4 R, the mean within 0.1 R of x = 0. Any y: the scene chooses the height.
            springs: (m, 2) whole numbers, pairs of rows of `points` from 0, each pair once. Every point is a corner of
                a triangle of springs.
            rest_lengths: (m,) [R], 1e-9 to 1000, in the order of `springs`; without, these are at rest at `points`.
            triangles: (t, 3) rows of `points`; their sides are springs, all of them where `springs` are not given.
            stiffness: (m,) 1e-12 to 1e12, in the order of `springs`: by which k_a, k_b and eta of each are multiplied.
                Let that be 1 for most: times and forces are estimated from k_a.
            masses: (n,) 1e-150 to 1e150, in any unit, none below 1e-15 of the largest: they are scaled to 1 M in all.
                Without, all are equal.

        Returns a lattice without a wall. Its springs are sorted by their points.

        Raises:
            InputError: The points or springs are no such body; the message says where.
        """
        x = custom.checked_points(points)
        bonds = None if springs is None else custom.checked_springs(springs, len(x))
        if triangles is not None:
            lattice, order = _first_whole(x, bonds, custom.checked_triangles(triangles, x, bonds))
        elif bonds is not None:
            lattice, order = _first_whole(x, bonds, *triangles_of(x, bonds))
        else:
            lattice, order = _meshed(x)
        given: dict[str, Any] = {"masses": lattice.masses}
        if masses is not None:
            given["masses"] = custom.positive(masses, len(x), "masses", *custom.MASSES)[order]
        for name, values, limits in (
            ("rest_lengths", rest_lengths, custom.REST_LENGTHS),
            ("stiffness", stiffness, custom.STIFFNESS),
        ):
            if values is not None and bonds is None:
                raise InputError(f"{name} need the springs that they belong to")
            if values is not None and bonds is not None:
                rank = np.argsort(pair_keys(np.argsort(order)[bonds], len(x)))
                given[name] = custom.positive(values, len(bonds), name, *limits)[rank]
        return replace(lattice, **given | _unlike(given["masses"], given.get("stiffness")))


def _require(name: str, holds: Any, what: str) -> None:
    if not holds:
        raise InputError(f"Lattice.{name} must be {what}: Lattice.from_points makes a lattice of points and springs")


def _distance(x: Array) -> Array:
    """(n,) of points (n, 2) from the middle [R], the same on every machine."""
    return np.asarray(np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1]))


def _unlike(masses: Array, stiffness: Array | None) -> dict[str, Any]:
    """Masses scaled to 1 M in all, and stiffness, as `Lattice` has them: equal ones are exactly so."""
    n = len(masses)
    same = (masses == masses[0]).all()
    masses = np.full(n, 1.0 / n) if same else masses / math.fsum(masses)
    return {"masses": masses, "stiffness": None if stiffness is None or (stiffness == 1.0).all() else stiffness}


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
    area = 0.5 * float(double_area(points[triangles]).sum())
    # Round each hole there is one more chain, clockwise.
    rings = sorted(chains(side[first[count == 1]]), key=lambda one: -polygon_area(points[one]))
    if not rings:  # no triangles, or each of them given twice
        raise SimulationError("the triangulation has no outline: choose another lattice seed")
    outline, *holes = rings
    open_ = all(polygon_area(points[hole]) < -1e-9 * area for hole in holes)
    whole = abs(area - sum(polygon_area(points[one]) for one in (outline, *holes))) <= 1e-9 * area
    euler = n - len(first) + len(triangles) == 1 - len(holes)
    if not (open_ and whole and euler and len(np.unique(triangles)) == n):
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
    """`tiled` by the first of the `candidates`, each (t, 3), that makes one piece without holes, else by the last."""
    found = None
    for triangles in candidates:
        with suppress(SimulationError):
            found = tiled(x, triangles, bonds)
            if found[0].whole:
                break
    if found is None:
        raise InputError("the springs' triangles do not make one piece")
    return found


def _meshed(x: Array) -> tuple[Lattice, Long]:
    """`tiled` by Delaunay's triangles, but for slivers, and bridges of holes that are wide."""
    triangles = delaunay(centred(x))
    lattice, order = _first_whole(x, None, without_slivers(x, triangles), triangles)
    length = lattice.rest_lengths
    k, typical = int(length.argmax()), float(np.median(length))
    if length[k] <= GAP * typical:
        return lattice, order
    try:
        return tiled(x, without_bridges(x, without_slivers(x, triangles)))
    except SimulationError:
        (x0, y0), (x1, y1) = lattice.positions[lattice.bonds[k]]
        gap = f"a gap of {length[k]:.3g} R, where springs measure {typical:.3g} R"
        raise InputError(
            f"the spring from ({x0:.4g}, {y0:.4g}) to ({x1:.4g}, {y1:.4g}) would cross {gap}, and without it the body "
            "falls apart: fill the gap with points, or give `springs` (`bonds` in an npz file) that go round it"
        ) from None


def read_lattice(path: str | Path) -> Lattice:
    """The disk of the points in a file, made by `Lattice.from_points`.

    Either a csv file of two columns x, y [R], or three with the mass, with or without the header "x,y" or "x,y,mass";
    or an npz file with `positions` (n, 2) and perhaps `bonds`, `rest_lengths`, `triangles`, `stiffness` and `masses`,
    which are arguments of `Lattice.from_points`, such as lattice.npz of a run. An elastic wall, which is the
    positions beyond `disk_points`, is not read. What a run has kept of a lattice that was not its scene's own
    (`unloaded`, see docs/output.md) is taken as it is, bit for bit.

    Raises InputError, with the file's name, if it cannot be read or its points are no disk.
    """
    path = Path(path)
    with custom.reading(path, "file"):
        data = custom.read_arrays(path)
        if "unloaded" in data:
            return _kept(data)
        return replace(Lattice.from_points(**custom.of_disk(data)), origin=path.name)


def _kept(data: Mapping[str, Any]) -> Lattice:
    x, bonds, triangles, none = data["unloaded"], data["bonds"], data["triangles"], np.empty(0, np.int32)
    n, springs = len(x), bonds[:, 1] < len(x)
    numbers = bonds[springs], data["rest_lengths"][springs], data["masses"][:n]
    corners = triangles[triangles.max(axis=1) < n]
    stiffness = data["stiffness"][springs] if "stiffness" in data else None
    return Lattice(x, *numbers, n, data["disk_surface"], none, none, corners, str(data["origin"]), stiffness)


def disk_of(lattice: Lattice) -> Lattice:
    """The disk of `lattice`, without its elastic wall if there is one.

    Raises InputError where it is no `Lattice`, or its masses are not 1 M in all.
    """
    if not isinstance(lattice, Lattice):
        raise InputError(f"lattice: must be a Lattice, see Lattice.from_points, not {type(lattice).__name__}")
    n = lattice.disk_points
    if abs((total := math.fsum(lattice.masses[:n])) - 1.0) > 1e-9:
        raise InputError(f"lattice: the masses of the disk must add up to 1 M, not {total:g}")
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
        stiffness=None if lattice.stiffness is None else lattice.stiffness[springs],
    )


class OwnStart(NamedTuple):
    """What a run begins with in place of its scene's random disk or velocities, from Python or from a file."""

    disk: Lattice | None = None
    velocities: Array | None = None  # (N, 2) [c]

    @property
    def digest(self) -> str:
        """SHA-256 of the arrays; empty if there are none."""
        own: tuple[Any, ...] = ()
        if disk := self.disk:
            own = disk.positions, disk.bonds, disk.rest_lengths, disk.stiffness, disk.masses
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
