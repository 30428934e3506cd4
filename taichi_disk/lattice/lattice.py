"""The lattice of a body: mass points, springs, and the triangles that tile the body."""

from __future__ import annotations

import math
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice import custom
from taichi_disk.lattice.files import (
    TABLES,
    disk_rows,
    points_of_disk,
    read_arrays,
    reading,
)
from taichi_disk.lattice.meshes import read_mesh
from taichi_disk.lattice.random_points import circle_points
from taichi_disk.lattice.triangles import (
    MAX_SPRING,
    Array,
    Indices,
    Long,
    bond_lengths,
    centred,
    chains,
    delaunay,
    distinct_sides,
    double_area,
    norms,
    pair_keys,
    polygon_area,
    reverse_cuthill_mckee,
    shown_point,
    triangles_of,
    why_not_one_piece,
    without_bridges,
    without_slivers,
)


def _no_points() -> Indices:
    return np.empty(0, np.int32)


@dataclass(frozen=True)
class Lattice:
    """Mass points and springs of the disk, followed by those of the elastic wall if
    there is one.

    Indices refer to rows of `positions`. Real numbers are float64, indices int32. A run
    validates a lattice that it is given, see `checked_disk`.
    """

    positions: Array  # (n, 2) unloaded [R], in coordinates of the body
    # (m, 2), bonds[:, 0] < bonds[:, 1], sorted lexicographically, so the disk precedes
    # the wall
    bonds: Indices
    rest_lengths: Array  # (m,) [R]
    masses: Array  # (n,) [M]; those of the disk add up to 1 M
    triangles: Indices  # (t, 3), counter-clockwise, disk before wall
    disk_points: int  # number of points of the disk, which come first
    disk_surface: Indices  # outer outline of the disk, counter-clockwise
    # elastic wall: top side, corners included, ordered by x
    wall_surface: Indices = field(default_factory=_no_points)
    # elastic wall: left top corner -> bottom -> right top corner
    wall_boundary: Indices = field(default_factory=_no_points)
    origin: str = "custom lattice"  # shown in titles
    # (m,) factors of k_a, k_b and eta of each spring; None: 1
    stiffness: Array | None = None
    # what was changed when the points were read, for the user
    notes: tuple[str, ...] = ()

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """The two ends (2, m) of the springs, in the type that NumPy indexes with."""
        return np.ascontiguousarray(self.bonds.T, dtype=np.intp)

    def spring_vectors(self, x: Array) -> Array:
        """Return the differences (2, m) of the `x` (n, 2) of the two ends of each
        spring."""
        i, j = self.ends
        # gathering columns is several times faster than gathering pairs
        columns = np.ascontiguousarray(x.T)
        return columns.take(i, axis=1) - columns.take(j, axis=1)

    @property
    def whole(self) -> bool:
        """Whether the disk has no hole, by Euler's formula for the number of its
        triangles."""
        n = self.disk_points
        of_disk = np.count_nonzero(self.triangles[:, 0] < n)
        return of_disk == 2 * n - 2 - len(self.disk_surface)

    def mean(self, values: Array) -> Any:
        """Return the mass-weighted mean of `values` (n, ...) over the disk; for
        positions, the centre of mass."""
        n = self.disk_points
        return np.average(values[:n], axis=0, weights=self.masses[:n])

    @property
    def inertia(self) -> float:
        """Moment of inertia of the disk about its centre of mass [M R^2]."""
        arm = self.positions - self.mean(self.positions)
        return float(self.mean((arm**2).sum(axis=1)))

    def stiffened(self, values: Any) -> Any:
        """Multiply `values` of the springs, (..., m) or one number, by the stiffness
        factors."""
        if self.stiffness is None:
            return values
        return self.stiffness * values

    # ---- constructors

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
        """Make a disk of `points` random points in the unit circle (R = 1), with a
        total mass of 1 M.

        The arguments are the keys of a scene's section `lattice`. The same arguments
        give bitwise the same lattice on every machine. The edges of hole and core carry
        evenly spaced points. Points and springs on the core's edge have the mean
        density and stiffness of the two materials.

        Args:
            points: number of points, 3 to 2,000,000.
            seed: seed of the random points.
            rim: whether evenly spaced points lie on the circle.
            min_spacing: smallest distance of inner points, in spacings of the hexagonal
                lattice. The paper only says "at random", which corresponds to
                rim=False, min_spacing=0.
            hole: radius of a concentric hole [R]; 0: none.
            core_radius: radius of a concentric core of another material [R]; 0: none.
            core_stiffness: stiffness of the core's springs relative to the rest.
            core_density: density of the core relative to the rest.

        Raises InputError if an argument is out of range, SimulationError if the points
        cannot be placed or meshed.
        """
        x = circle_points(points, seed, rim, min_spacing, hole, core_radius)
        triangles = delaunay(x)
        origin = f"seed {seed}"
        if hole:
            # Triangles with all corners on the edge of the hole would fill it.
            is_outside = norms(x.T) > (1.0 + 1e-9) * hole
            triangles = triangles[is_outside[triangles].any(axis=1)]
            origin += f", hole {hole:g} R"
        lattice, _ = tiled(x, triangles)
        if core_radius:
            lattice = lattice._with_core(core_radius, core_stiffness, core_density)
            origin += (
                f", core {core_radius:g} R: k × {core_stiffness:g}, ρ ×"
                f" {core_density:g}"
            )
        return replace(lattice, origin=origin)

    def _with_core(self, radius: float, stiffness: float, density: float) -> Lattice:
        # 1: inside the core, 0: on its edge, -1: outside
        place = np.sign(np.round(radius - norms(self.positions.T), 9))
        place_of_spring = np.sign(place[self.bonds].sum(axis=1))
        masses = _mean_on_edge(place, density)
        factors = _mean_on_edge(place_of_spring, stiffness)
        custom.check_masses(masses)
        custom.check_springs("stiffness", factors)
        return replace(
            self, masses=_scaled_masses(masses), stiffness=_stiffness_or_none(factors)
        )

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
        """Make a lattice from user-supplied points: a body in one piece, possibly with
        holes, tiled by triangles.

        Without `springs`, Delaunay neighbours are joined, and slivers along the hull
        are removed: triangles whose outer side is longer than 3 median springs or 4
        times the triangle's height, if the third point lies inside (after Duckham et
        al., Pattern Recognition 41, 3224, 2008). If a spring is still longer than 5
        median springs, triangles with a wider circumcircle are removed, which keeps
        holes open. Given springs must form triangles, and may cross if the Delaunay
        triangles are among these. Uncovered areas are holes.

        The points are renumbered; other arrays, such as velocities, must have the order
        of `lattice.positions`. The springs are sorted by their points. If rest lengths
        differ from distances, an impact starts strained, whereas a compression first
        lets the free body come to rest.

        Args:
            points: (n, 2) [R], 3 to 2,000,000 distinct points. The larger of width and
                height is 1 to 4 R, the mean within 0.1 R of x = 0. The scene chooses
                the height.
            springs: (m, 2) integers, distinct pairs of rows of `points`. Every point is
                a corner of a triangle.
            rest_lengths: (m,) [R], 1e-9 to 1000, in the order of `springs`; default:
                distances between `points`.
            triangles: (t, 3) rows of `points`. Their sides are springs; without
                `springs` there are no other springs. Points that belong to neither are
                left out, which `notes` of the lattice says.
            stiffness: (m,) factors of k_a, k_b and eta, 1e-12 to 1e12, in the order of
                `springs`. Most should be 1, because the program estimates times and
                forces from k_a.
            masses: (n,) 1e-150 to 1e150 in any unit, none below 1e-15 of the largest;
                scaled to a sum of 1 M. Default: equal masses.

        Raises InputError if the points or springs do not form such a body; the message
        says where.
        """
        x = custom.point_array(points)
        bonds = None
        if springs is not None:
            bonds = custom.checked_springs(springs, len(x))
        weights: Array = np.ones(len(x))
        if masses is not None:
            weights = custom.column(masses, len(x), "masses")
            custom.check_masses(weights)
        corners = None
        notes: tuple[str, ...] = ()
        if triangles is not None:
            corners = custom.checked_triangles(triangles, x, bonds)
            used = np.unique(corners)
            if bonds is None and len(used) < len(x):
                notes = (custom.left_out(x, used),)
                corners = np.searchsorted(used, corners)
                x = x[used]
                weights = weights[used]
        custom.check_body(x)

        lattice, order = _joined(x, bonds, corners)
        lattice = replace(lattice, masses=_scaled_masses(weights[order]), notes=notes)
        return _with_springs(lattice, order, bonds, rest_lengths, stiffness)

    @classmethod
    def read(cls, path: str | Path) -> Lattice:
        """Read a lattice from a file, in the same way as a scene's `lattice.file`.

        - A table (.csv, .txt, .tsv) has the columns x, y [R] and optionally mass, see
            `read_table`.
        - An npz file has `positions` (n, 2) and optionally `bonds`, `rest_lengths`,
            `triangles`, `stiffness` and `masses`, like lattice.npz of a run. Positions
            beyond `disk_points` belong to an elastic wall and are ignored.
        - An npz file of a run with a user-supplied lattice also has `unloaded`, see
            docs/output.md. That lattice is restored bit for bit.
        - Other files are meshes, see `read_mesh`.

        Except in the third case, `from_points` makes the lattice. Its `notes` say what
        was scaled or left out. Raises InputError with the file's name if the file
        cannot be read or its points do not form a disk.
        """
        path = Path(path)
        suffix = path.suffix.lower()
        with reading(path, "file"):
            if suffix not in (*TABLES, ".npz"):
                points, triangles, notes = read_mesh(path)
                lattice = cls.from_points(points, triangles=triangles)
                notes += lattice.notes
                return replace(lattice, origin=path.name, notes=notes)
            arrays = read_arrays(path)
            if "unloaded" in arrays:
                return cls._restored(arrays)
            return replace(cls._of_arrays(arrays), origin=path.name)

    @classmethod
    def _of_arrays(cls, arrays: dict[str, Any]) -> Lattice:
        count = len(np.atleast_1d(arrays["positions"]))
        disk_points = points_of_disk(arrays, count)
        if disk_points < count:  # leave the elastic wall out
            arrays |= disk_rows(arrays, disk_points)
        names = ("rest_lengths", "triangles", "stiffness", "masses")
        others = {name: arrays.get(name) for name in names}
        return cls.from_points(arrays["positions"], arrays.get("bonds"), **others)

    @classmethod
    def _restored(cls, arrays: dict[str, Any]) -> Lattice:
        """Return the user-supplied lattice that a run has stored."""
        x = custom.point_array(arrays["unloaded"])
        stored = disk_rows(arrays, len(x)) | {"positions": x}
        disk = cls(
            **stored,
            disk_points=len(x),
            disk_surface=_no_points(),
            origin=str(arrays["origin"]),
        )
        return checked_disk(disk)


def _mean_on_edge(place: Array, inside: float) -> Array:
    """Return `inside` at the places 1, 1 at the places -1, and their mean at 0."""
    return 0.5 * (1.0 + inside + place * (inside - 1.0))


def _scaled_masses(masses: Array) -> Array:
    """Scale `masses` to a sum of 1 M. Equal masses become exactly equal."""
    if (masses == masses[0]).all():
        return np.full(len(masses), 1.0 / len(masses))
    return masses / math.fsum(masses)


def _stiffness_or_none(factors: Array | None) -> Array | None:
    if factors is None or (factors == 1.0).all():
        return None
    return factors


def triangulate(points: Array) -> Lattice:
    lattice, _ = tiled(points, delaunay(points))
    return lattice


def tiled(
    points: Array,
    triangles: Long,
    bonds: Long | None = None,
    order: Long | None = None,
) -> tuple[Lattice, Long]:
    """Return a lattice of equal masses and unstretched springs, and `order`: its
    positions are points[order].

    `bonds` (m, 2) default to the sides of `triangles` (t, 3), `order` to reverse
    Cuthill-McKee numbering from the leftmost point, which keeps memory accesses local.
    The outline begins at its lowest index. Raises SimulationError if the triangles do
    not tile the interior of the outline, or if a point belongs to no triangle.
    """
    n = len(points)
    outline = outline_of(points, triangles)
    if bonds is None:
        side, first, _ = distinct_sides(triangles, n)
        bonds = side[first]
    if order is None:
        leftmost = int(np.argmin(points[:, 0]))
        order = reverse_cuthill_mckee(bonds, n, leftmost)
    rank = np.argsort(order)
    bonds = np.sort(rank[bonds], axis=1)
    i, j = bonds.T
    bonds = bonds[np.argsort(i * n + j)]
    x = points[order]
    surface = rank[outline]
    surface = np.roll(surface, -int(np.argmin(surface)))
    lattice = Lattice(
        positions=x,
        bonds=bonds.astype(np.int32),
        rest_lengths=bond_lengths(x, bonds),
        masses=np.full(n, 1.0 / n),
        disk_points=n,
        disk_surface=surface.astype(np.int32),
        triangles=rank[triangles].astype(np.int32),
    )
    return lattice, order


def outline_of(points: Array, triangles: Long) -> Long:
    """Return the outer outline (h,) of `triangles` (t, 3), counter-clockwise.

    Raises SimulationError if the triangles do not tile the interior of the outline, or
    if a point belongs to no triangle.
    """
    n = len(points)
    side, first, count = distinct_sides(triangles, n)
    area = 0.5 * float(double_area(points[triangles]).sum())

    def ring_area(ring: Long) -> float:
        return polygon_area(points[ring])

    rings = sorted(chains(side[first[count == 1]]), key=ring_area, reverse=True)
    ring_areas = [ring_area(ring) for ring in rings]
    holes = ring_areas[1:]  # negative, because their chains are clockwise
    are_open = all(hole < -1e-9 * area for hole in holes)
    is_tiled = abs(area - sum(ring_areas)) <= 1e-9 * area
    # Euler's formula
    is_one_piece = n - len(first) + len(triangles) == 1 - len(holes)
    has_all_points = len(np.unique(triangles)) == n
    if not (are_open and is_tiled and is_one_piece and has_all_points):
        raise SimulationError(
            "the triangulation is degenerate: choose another lattice seed"
        )
    return rings[0]


def _joined(
    x: Array, bonds: Long | None, triangles: Long | None
) -> tuple[Lattice, Long]:
    """Return the lattice of the points `x` (n, 2) and the order of `tiled`."""
    if triangles is not None:
        return _first_in_one_piece(x, bonds, triangles)
    if bonds is not None:
        return _first_in_one_piece(x, bonds, *triangles_of(x, bonds))
    return _meshed(x)


def _with_springs(
    lattice: Lattice, order: Long, bonds: Long | None, rest_lengths: Any, stiffness: Any
) -> Lattice:
    """Return `lattice`, whose points are points[order], with values (m,) of the user's
    `bonds`, or as it is if they are None."""
    arrays: dict[str, Any] = {}
    for name, values in (("rest_lengths", rest_lengths), ("stiffness", stiffness)):
        if values is None:
            continue
        if bonds is None:
            raise InputError(
                f"{name} without springs: give `springs` too, in the same order"
            )
        array = custom.column(values, len(bonds), name)
        custom.check_springs(name, array)
        rank = np.argsort(order)
        keys = pair_keys(rank[bonds], len(order))
        arrays[name] = array[np.argsort(keys)]
    lattice = replace(lattice, **arrays)
    return replace(lattice, stiffness=_stiffness_or_none(lattice.stiffness))


def _first_in_one_piece(
    x: Array, bonds: Long | None, *candidates: Long, order: Long | None = None
) -> tuple[Lattice, Long]:
    tiling = None
    for triangles in candidates:
        with suppress(SimulationError):
            tiling = tiled(x, triangles, bonds, order)
            if tiling[0].whole:
                break
    if tiling is None:
        raise InputError(
            "the triangles of springs do not form one connected piece:"
            f" {why_not_one_piece(x, candidates[-1])}"
        )
    return tiling


def _meshed(x: Array) -> tuple[Lattice, Long]:
    triangles = delaunay(centred(x))
    neat = without_slivers(x, triangles)
    lattice, order = _first_in_one_piece(x, None, neat, triangles)
    length = lattice.rest_lengths
    typical = float(np.median(length))
    longest = int(length.argmax())
    if length[longest] <= MAX_SPRING * typical:
        return lattice, order
    try:
        return tiled(x, without_bridges(x, neat))
    except SimulationError:
        start, end = lattice.positions[lattice.bonds[longest]]
        raise InputError(
            f"the spring from {shown_point(start)} to {shown_point(end)} would cross a"
            f" gap of {length[longest]:.3g} R (the median spring is {typical:.3g} R"
            " long), but without it the body falls apart: fill the gap with points, or"
            " give `springs` (`bonds` in an npz file) that go round it"
        ) from None


def disk_of(lattice: Lattice) -> Lattice:
    """Return `lattice` without the elastic wall. Raises InputError if the disk's masses
    do not add up to 1 M."""
    if not isinstance(lattice, Lattice):
        raise InputError(
            "lattice: must be a Lattice (see Lattice.from_points), not"
            f" {type(lattice).__name__}"
        )
    n = lattice.disk_points
    total = math.fsum(lattice.masses[:n])
    if abs(total - 1.0) > 1e-9:
        raise InputError(
            f"lattice: the masses of the disk must add up to 1 M, not {total:g}"
        )
    if len(lattice.wall_surface) == 0:
        return lattice
    rows = disk_rows(vars(lattice), n)
    return replace(
        lattice, **rows, wall_surface=_no_points(), wall_boundary=_no_points()
    )


def checked_disk(lattice: Lattice) -> Lattice:
    """Return the disk of a lattice that a user made or stored, without its wall, its
    springs sorted and its triangles and outline counter-clockwise.

    Raises InputError unless its points, springs and triangles form such a body as
    `Lattice.from_points` makes.
    """
    disk = disk_of(lattice)
    x = custom.point_array(disk.positions)
    custom.check_body(x, max_offset=1.0)
    masses = custom.column(disk.masses, len(x), "masses")
    custom.check_masses(masses)
    bonds = custom.checked_springs(disk.bonds, len(x))
    corners = custom.checked_triangles(disk.triangles, x, bonds)
    same = np.arange(len(x))
    checked, _ = _first_in_one_piece(x, bonds, corners, order=same)
    checked = _with_springs(checked, same, bonds, disk.rest_lengths, disk.stiffness)
    return replace(checked, masses=masses, origin=disk.origin, notes=disk.notes)
