"""The lattice of a body: mass points, springs, and the triangles that tile the body."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from taichi_disk.base.errors import InputError, SimulationError, did_you_mean
from taichi_disk.base.text_files import read_text
from taichi_disk.mechanics.lattice import custom
from taichi_disk.mechanics.lattice.files import (
    MAX_BYTES,
    TABLES,
    Arrays,
    disk_rows,
    points_of_disk,
    read_arrays,
    reading,
)
from taichi_disk.mechanics.lattice.meshes import read_mesh
from taichi_disk.mechanics.lattice.random_points import circle_points
from taichi_disk.mechanics.lattice.tables import read_table
from taichi_disk.mechanics.lattice.triangles import (
    Array,
    Indices,
    Long,
    bond_lengths,
    chains,
    compact_triangles,
    delaunay,
    distinct_sides,
    double_area,
    enclosed_triangles,
    norms,
    numbering,
    pair_keys,
    polygon_area,
    unusable,
)

# largest distance of the points' mean from x = 0 [R]: what a user gives, any lattice
_MAX_OFFSET = 0.1
_MAX_STORED_OFFSET = 1.0
# what `Lattice.from_points` and files call two arrays
_WORDS = {"points": "positions", "springs": "bonds"}


def _no_points() -> Indices:
    return np.empty(0, np.int32)


@dataclass(frozen=True)
class Lattice:
    """Mass points and springs of the disk, followed by those of the elastic wall if
    there is one.

    Indices refer to rows of `positions`. Real numbers are float64, indices int32. A run
    validates a lattice that it is given, see `checked_disk`.

    Attributes:
        positions: (n, 2) unloaded [R], in coordinates of the body.
        bonds: (m, 2), the two points of each spring, the smaller number first. Sorted
            lexicographically, so the disk's precede the wall's.
        rest_lengths: (m,) of the springs [R].
        masses: (n,) of the points [M]; those of the disk add up to 1 M.
        triangles: (t, 3), counter-clockwise, disk before wall.
        disk_points: number of points of the disk, which come first.
        disk_surface: outer outline of the disk, counter-clockwise.
        wall_surface: of an elastic wall, top side, corners included, ordered by x.
        wall_boundary: of an elastic wall, left side, bottom, right side.
        origin: description in titles.
        stiffness: (m,) factors of k_a, k_b and eta of each spring; None: all are 1.
        notes: what was changed when the points were read, for the user.
    """

    positions: Array
    bonds: Indices
    rest_lengths: Array
    masses: Array
    triangles: Indices
    disk_points: int
    disk_surface: Indices
    wall_surface: Indices = field(default_factory=_no_points)
    wall_boundary: Indices = field(default_factory=_no_points)
    origin: str = "custom lattice"
    stiffness: Array | None = None
    notes: tuple[str, ...] = ()

    @cached_property
    def ends(self) -> NDArray[np.intp]:
        """The two ends (2, m) of the springs, in the type that NumPy indexes with."""
        return np.ascontiguousarray(self.bonds.T, np.intp)

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
        lattice = numbered(x, triangles)
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
            self, masses=_scaled_masses(masses), stiffness=stiffness_or_none(factors)
        )

    @classmethod
    def outline(
        cls,
        outline: str | Path | ArrayLike,
        points: int,
        seed: int = 0,
        min_spacing: float = 0.7,
    ) -> Lattice:
        """Fill an outline with random points as `disk` fills the circle: evenly spaced
        along the outline, whose corners are points, and at random inside.

        The outline has any unit and place: the body gets the area of the disk, pi R^2,
        so that its 1 M is of the disk's material, and its centroid is the origin.

        Args:
            outline: (n, 2) points along the closed outline, or a list of such arrays,
                the smaller ones for holes; or a file of a scene's `lattice.outline`: a
                table with the columns x and y, or a drawing (.svg).
            points, seed, min_spacing: as for `disk`.

        Raises InputError if the outline is open, crosses itself, is not one body, or
        has parts that `points` points cannot resolve; SimulationError as `disk` does.
        """
        if isinstance(outline, (str, Path)):
            path = Path(outline)
            with reading(path, "outline"):
                from taichi_disk.mechanics.lattice.outlines import read_outline

                lattice = cls.outline(read_outline(path), points, seed, min_spacing)
            return replace(lattice, origin=f"{path.name}, {lattice.origin}")
        from taichi_disk.mechanics.lattice.outlines import filled

        paths: Any = outline
        if np.ndim(paths[0][0]) == 0:  # x of the first point of the only path
            paths = [outline]
        paths = [custom.point_array(path) for path in paths]
        x, triangles, note = filled(paths, points, seed, min_spacing)
        return replace(numbered(x, triangles), origin=f"seed {seed}", notes=(note,))

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

        Bare points are joined to Delaunay triangles whose circumcircles are at most 5
        median springs wide. Three `springs` that enclose an undivided area make a
        triangle; springs that cross need `triangles`. Uncovered areas are holes.

        Points and triangles keep their order; springs are sorted by their points. If
        rest lengths differ from distances, an impact starts strained, whereas a
        compression first lets the free body come to rest.

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
        arrays = {
            "positions": points,
            "bonds": springs,
            "triangles": triangles,
            "masses": masses,
            "rest_lengths": rest_lengths,
            "stiffness": stiffness,
        }
        return _lattice_of(arrays, _MAX_OFFSET)

    @classmethod
    def read(cls, path: str | Path) -> Lattice:
        """Read a lattice from a file, in the same way as a scene's `lattice.file`.

        - A table (.csv, .txt, .tsv) has the columns x, y and optionally mass, see
            `read_table`.
        - An npz file has `positions` (n, 2) [R] and optionally `bonds`,
            `rest_lengths`, `triangles`, `stiffness` and `masses`. Positions beyond
            `disk_points` belong to an elastic wall and are ignored. If there is
            `unloaded`, as in lattice.npz of a run, it counts instead of `positions`.
            `points` and `springs` may be the names of positions and bonds. Other arrays
            than those of lattice.npz are refused.
        - Other files are meshes, see `read_mesh`.

        Lengths are in R. `from_points` makes the lattice. Its `notes` say what was read
        or left out. Raises InputError with the file's name if the file cannot be read
        or its points do not form a disk.
        """
        path = Path(path)
        suffix = path.suffix.lower()
        with reading(path, "file"):
            if suffix == ".npz":
                return _stored(read_arrays(path), path.name)
            if suffix not in TABLES:
                points, triangles, notes = read_mesh(path)
                lattice = cls.from_points(points, triangles=triangles)
                return replace(lattice, origin=path.name, notes=notes + lattice.notes)
            points, masses = read_table(read_text(path, MAX_BYTES))
            lattice = cls.from_points(points, masses=masses)
            columns = "x, y, no masses"
            if masses is not None:
                columns = "x, y, mass from the header"
            note = f"{len(points):,} points; {columns}"
            return replace(lattice, origin=path.name, notes=(note,))


def _mean_on_edge(place: Array, inside: float) -> Array:
    """Return `inside` at the places 1, 1 at the places -1, and their mean at 0."""
    return 0.5 * (1.0 + inside + place * (inside - 1.0))


def _scaled_masses(masses: Array) -> Array:
    """Scale `masses` to a sum of 1 M, unless that is their sum."""
    total = math.fsum(masses)
    if abs(total - 1.0) <= 1e-12:
        return masses
    return masses / total


def stiffness_or_none(factors: Array | None) -> Array | None:
    if factors is None or (factors == 1.0).all():
        return None
    return factors


def triangulate(points: Array) -> Lattice:
    return numbered(points, delaunay(points))


def numbered(points: Array, triangles: Long) -> Lattice:
    """Return the lattice of `tiled` with its points in another order, which keeps
    memory accesses local. Raises SimulationError, too, if a point is no corner."""
    if len(np.unique(triangles)) < len(points):
        raise unusable("is degenerate")
    order = numbering(triangles, points)
    return tiled(points[order], np.argsort(order)[triangles])


def tiled(points: Array, triangles: Long, bonds: Long | None = None) -> Lattice:
    """Return a lattice of equal masses and unstretched springs.

    `bonds` (m, 2) default to the sides of `triangles` (t, 3). The outline begins at its
    lowest index. Raises SimulationError if the triangles do not tile the interior of
    the outline.
    """
    n = len(points)
    surface = outline_of(points, triangles)
    if bonds is None:
        side, first, _ = distinct_sides(triangles, n)
        bonds = side[first]
    bonds = np.sort(bonds, axis=1)
    i, j = bonds.T
    bonds = bonds[np.argsort(i * n + j)]
    surface = np.roll(surface, -np.argmin(surface))
    return Lattice(
        positions=points,
        bonds=bonds.astype(np.int32),
        rest_lengths=bond_lengths(points, bonds),
        masses=np.full(n, 1.0 / n),
        disk_points=n,
        disk_surface=surface.astype(np.int32),
        triangles=triangles.astype(np.int32),
    )


def outline_of(points: Array, triangles: Long) -> Long:
    """Return the outer outline (h,) of `triangles` (t, 3), counter-clockwise.

    Raises SimulationError if the triangles do not tile the interior of the outline.
    """
    n = len(points)
    side, first, count = distinct_sides(triangles, n)
    area = 0.5 * double_area(points[triangles]).sum()

    def ring_area(ring: Long) -> float:
        return polygon_area(points[ring])

    rings = sorted(chains(side[first[count == 1]]), key=ring_area, reverse=True)
    ring_areas = [ring_area(ring) for ring in rings]
    holes = ring_areas[1:]  # negative, because their chains are clockwise
    are_open = all(hole < -1e-9 * area for hole in holes)
    is_tiled = abs(area - sum(ring_areas)) <= 1e-9 * area
    # Euler's formula
    is_one_piece = n - len(first) + len(triangles) == 1 - len(holes)
    if not (are_open and is_tiled and is_one_piece):
        raise unusable("is degenerate")
    return rings[0]


def _lattice_of(arrays: Arrays, max_offset: float) -> Lattice:
    """Return the lattice of user-supplied arrays, as `Lattice.from_points` does.
    `max_offset`: largest distance of the points' mean from x = 0 [R]."""
    springs = arrays.get("bonds")
    triangles = arrays.get("triangles")
    masses = arrays.get("masses")
    x = custom.point_array(arrays["positions"])
    bonds = None
    if springs is not None:
        bonds = custom.checked_springs(springs, len(x))
    weights = np.ones(len(x))
    if masses is not None:
        weights = custom.column(masses, len(x), "masses")
        custom.check_masses(weights)
    notes: tuple[str, ...] = ()
    if triangles is not None:
        corners = custom.checked_triangles(triangles, x, bonds)
        used = np.unique(corners)
        if bonds is None and len(used) < len(x):
            notes = (custom.left_out(x, used),)
            corners = np.searchsorted(used, corners)
            x = x[used]
            weights = weights[used]
    custom.check_body(x, max_offset)
    if triangles is None and bonds is not None:
        corners = enclosed_triangles(x, bonds)
    elif triangles is None:
        corners = compact_triangles(x)
    custom.refuse_loose_points(x, corners)
    try:
        lattice = tiled(x, corners, bonds)
    except SimulationError:
        raise InputError(
            "the triangles do not form one connected piece (join its pieces, and parts"
            " that share only single points, by further triangles), or some lie over"
            " others, or a point lies in the middle of a side (ParaView's Feature Edges"
            " show where)"
        ) from None
    of_springs = _spring_arrays(bonds, len(x), arrays)
    return replace(lattice, masses=_scaled_masses(weights), notes=notes, **of_springs)


def _spring_arrays(bonds: Long | None, n: int, arrays: Arrays) -> Arrays:
    """Return the values (m,) of the user's `bonds` in the order of the lattice."""
    ordered: Arrays = {"stiffness": None}
    for name in ("rest_lengths", "stiffness"):
        if arrays.get(name) is None:
            continue
        if bonds is None:
            raise InputError(
                f"{name} without springs: give `springs` too, in the same order"
            )
        array = custom.column(arrays[name], len(bonds), name)
        custom.check_springs(name, array)
        ordered[name] = array[np.argsort(pair_keys(bonds, n))]
    ordered["stiffness"] = stiffness_or_none(ordered["stiffness"])
    return ordered


def _stored(arrays: Arrays, origin: str) -> Lattice:
    """Return the lattice of an npz file. Raises InputError if it has an array that no
    lattice.npz has."""
    for word, name in _WORDS.items():
        if word in arrays and name not in arrays:
            arrays[name] = arrays.pop(word)
    if "t" in arrays:
        raise InputError(
            "it is a state of a run, whose lattice is in lattice.npz; a run cannot be"
            " continued from it"
        )
    known = {*Lattice.__dataclass_fields__, "velocities", "unloaded", "wall_impedance"}
    for name in sorted(arrays.keys() - known):
        hint = did_you_mean(name, known)
        raise InputError(f"{name} is no array of a lattice{hint}")
    count = len(np.atleast_1d(arrays["positions"]))
    n = points_of_disk(arrays, count)
    if n < count:  # leave the elastic wall out
        arrays |= disk_rows(arrays, n)
    if "unloaded" not in arrays:
        return replace(_lattice_of(arrays, _MAX_OFFSET), origin=origin)
    arrays["positions"] = arrays["unloaded"]
    lattice = _lattice_of(arrays, _MAX_STORED_OFFSET)
    return replace(lattice, origin=str(arrays["origin"]))


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
    """Return the disk of a lattice that a user made, without its wall, in the form that
    kernels need. Raises InputError as `Lattice.from_points` does."""
    disk = disk_of(lattice)
    checked = _lattice_of(vars(disk), _MAX_STORED_OFFSET)
    return replace(checked, origin=disk.origin, notes=disk.notes)
