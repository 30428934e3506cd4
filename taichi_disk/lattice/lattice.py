"""The lattice of a body: mass points, springs, and the triangles that tile the body."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice import custom
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
    pair_keys,
    polygon_area,
    reverse_cuthill_mckee,
    triangles_of,
    without_bridges,
    without_slivers,
)


@dataclass(frozen=True)
class Lattice:
    """Mass points and springs of the disk, followed by those of the elastic wall if
    there is one.

    Indices refer to rows of `positions`. Real numbers are float64, indices int32.
    Raises InputError for arrays of another shape or dtype, numbers that are not finite,
    and indices out of range.
    """

    positions: Array  # (n, 2) unloaded [R], in coordinates of the body
    # (m, 2), bonds[:, 0] < bonds[:, 1], sorted lexicographically, so the disk precedes
    # the wall
    bonds: Indices
    rest_lengths: Array  # (m,) [R]
    masses: Array  # (n,) [M]; those of the disk add up to 1 M
    disk_points: int  # number of points of the disk, which come first
    disk_surface: Indices  # outer outline of the disk, counter-clockwise
    # elastic wall: top side, corners included, ordered by x (empty if none)
    wall_surface: Indices
    # elastic wall: left top corner -> bottom -> right top corner (empty if none)
    wall_boundary: Indices
    triangles: Indices  # (t, 3), counter-clockwise, disk before wall
    origin: str = "custom lattice"  # shown in titles
    # (m,) factors of k_a, k_b and eta of each spring; None: 1
    stiffness: Array | None = None

    def __post_init__(self) -> None:
        n, m, none = np.size(self.masses), np.size(self.rest_lengths), -1
        real = {"positions": (n, 2), "masses": (n,), "rest_lengths": (m,)}
        if self.stiffness is not None:
            real["stiffness"] = (m,)
        outlines = dict.fromkeys(
            ("disk_surface", "wall_surface", "wall_boundary"), (none,)
        )
        for name, (rows, *width) in {
            **real,
            "bonds": (m, 2),
            "triangles": (none, 3),
            **outlines,
        }.items():
            array, kind = (
                getattr(self, name),
                np.dtype(np.float64 if name in real else np.int32),
            )
            shape = (
                np.size(array) // math.prod(width) if rows == none else rows,
                *width,
            )
            fits = isinstance(array, np.ndarray) and (array.dtype, array.shape) == (
                kind,
                shape,
            )
            _require(name, fits, f"{kind} of shape {shape}")
            low, high = (
                (-math.inf if name == "positions" else 0.0, math.inf)
                if name in real
                else (-1, n)
            )
            _require(
                name,
                ((low < array) & (array < high)).all(),
                f"numbers above {low:g} and below {high:g}",
            )
        rising = (np.diff(self.bonds.astype(np.int64) @ [n, 1]) > 0).all() and (
            np.diff(self.bonds) > 0
        ).all()
        _require("bonds", rising, "pairs i < j of points, sorted, each pair once")
        _require(
            "disk_points",
            self.disk_points in range(1, n + 1),
            f"a whole number from 1 to {n}",
        )

    @property
    def whole(self) -> bool:
        """Whether the disk has no hole, by Euler's formula for the number of its
        triangles."""
        n = self.disk_points
        return np.count_nonzero(self.triangles[:, 0] < n) == 2 * n - 2 - len(
            self.disk_surface
        )

    def mean(self, values: Array) -> Any:
        """Return the mass-weighted mean of `values` (n, ...) over the disk; for
        positions, the centre of mass."""
        n = self.disk_points
        return np.average(values[:n], axis=0, weights=self.masses[:n])

    @property
    def inertia(self) -> float:
        """Moment of inertia of the disk about its centre of mass [M R^2]."""
        return float(
            self.mean(((self.positions - self.mean(self.positions)) ** 2).sum(axis=1))
        )

    def stiffened(self, values: Any) -> Any:
        """Multiply `values` of the springs, (..., m) or one number, by the stiffness
        factors."""
        return values if self.stiffness is None else self.stiffness * values

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
        # remove triangles with all corners on the edge of the hole, which would fill it
        if hole:
            triangles = triangles[
                (_distance(x) > (1.0 + 1e-9) * hole)[triangles].any(axis=1)
            ]
        lattice = replace(
            tiled(x, triangles)[0],
            origin=f"seed {seed}" + f", hole {hole:g} R" * bool(hole),
        )
        if not core_radius:
            return lattice
        # 1: inside the core, 0: on its edge
        side = np.sign(np.round(core_radius - _distance(lattice.positions), 9))
        masses = 0.5 * (1.0 + core_density + side * (core_density - 1.0))
        stiffness = 0.5 * (
            1.0
            + core_stiffness
            + np.sign(side[lattice.bonds].sum(axis=1)) * (core_stiffness - 1.0)
        )
        origin = (
            f"{lattice.origin}, core {core_radius:g} R: k × {core_stiffness:g}, ρ ×"
            f" {core_density:g}"
        )
        return replace(lattice, origin=origin, **_non_uniform(masses, stiffness))

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
                `springs` there are no other springs.
            stiffness: (m,) factors of k_a, k_b and eta, 1e-12 to 1e12, in the order of
                `springs`. Most should be 1, because the program estimates times and
                forces from k_a.
            masses: (n,) 1e-150 to 1e150 in any unit, none below 1e-15 of the largest;
                scaled to a sum of 1 M. Default: equal masses.

        Raises InputError if the points or springs do not form such a body; the message
        says where.
        """
        x = custom.checked_points(points)
        bonds = None if springs is None else custom.checked_springs(springs, len(x))
        if triangles is not None:
            lattice, order = _first_in_one_piece(
                x, bonds, custom.checked_triangles(triangles, x, bonds)
            )
        elif bonds is not None:
            lattice, order = _first_in_one_piece(x, bonds, *triangles_of(x, bonds))
        else:
            lattice, order = _meshed(x)
        arrays: dict[str, Any] = {"masses": lattice.masses}
        if masses is not None:
            arrays["masses"] = custom.positive(
                masses, len(x), "masses", *custom.MASSES
            )[order]
        for name, values, limits in (
            ("rest_lengths", rest_lengths, custom.REST_LENGTHS),
            ("stiffness", stiffness, custom.STIFFNESS),
        ):
            if values is not None and bonds is None:
                raise InputError(
                    f"{name} without springs: give `springs` too, in the same order"
                )
            if values is not None and bonds is not None:
                rank = np.argsort(pair_keys(np.argsort(order)[bonds], len(x)))
                arrays[name] = custom.positive(values, len(bonds), name, *limits)[rank]
        return replace(
            lattice, **arrays | _non_uniform(arrays["masses"], arrays.get("stiffness"))
        )


def _require(name: str, holds: Any, what: str) -> None:
    if not holds:
        raise InputError(
            f"Lattice.{name} must be {what}: use Lattice.from_points, which builds a"
            " valid lattice"
        )


def _distance(x: Array) -> Array:
    # not np.hypot, whose rounding depends on the machine
    return np.asarray(np.sqrt(x[:, 0] * x[:, 0] + x[:, 1] * x[:, 1]))


def _non_uniform(masses: Array, stiffness: Array | None) -> dict[str, Any]:
    """Return `masses`, scaled to a sum of 1 M, and `stiffness` for a Lattice. Equal
    masses are exactly equal."""
    n = len(masses)
    is_uniform = (masses == masses[0]).all()
    masses = np.full(n, 1.0 / n) if is_uniform else masses / math.fsum(masses)
    return {
        "masses": masses,
        "stiffness": (
            None if stiffness is None or (stiffness == 1.0).all() else stiffness
        ),
    }


def triangulate(points: Array) -> Lattice:
    return tiled(points, delaunay(points))[0]


def tiled(
    points: Array, triangles: Long, bonds: Long | None = None
) -> tuple[Lattice, Long]:
    """Return a lattice of equal masses and unstretched springs, and `order`: its
    positions are points[order].

    `bonds` (m, 2) default to the sides of `triangles` (t, 3). Reverse Cuthill-McKee
    numbering from the leftmost point keeps memory accesses local. The outline begins at
    its lowest index. Raises SimulationError if the triangles do not tile the interior
    of the outline, or if a point belongs to no triangle.
    """
    n = len(points)
    side, first, count = distinct_sides(triangles, n)
    area = 0.5 * float(double_area(points[triangles]).sum())
    # Each hole has a clockwise chain.
    rings = sorted(
        chains(side[first[count == 1]]), key=lambda ring: -polygon_area(points[ring])
    )
    if not rings:  # there are no triangles, or each is given twice
        raise SimulationError(
            "the triangulation has no outline: choose another lattice seed"
        )
    outline, *holes = rings
    are_open = all(polygon_area(points[hole]) < -1e-9 * area for hole in holes)
    is_tiled = (
        abs(area - sum(polygon_area(points[ring]) for ring in rings)) <= 1e-9 * area
    )
    is_one_piece = n - len(first) + len(triangles) == 1 - len(holes)  # Euler's formula
    if not (are_open and is_tiled and is_one_piece and len(np.unique(triangles)) == n):
        raise SimulationError(
            "the triangulation is degenerate: choose another lattice seed"
        )

    bonds = side[first] if bonds is None else bonds
    order = reverse_cuthill_mckee(bonds, n, int(np.argmin(points[:, 0])))
    rank = np.argsort(order)
    bonds = np.sort(rank[bonds], axis=1)
    bonds = bonds[np.argsort(bonds[:, 0] * n + bonds[:, 1])]
    outline = np.roll(rank[outline], -int(np.argmin(rank[outline])))
    ends, corners, surface, none = (
        a.astype(np.int32) for a in (bonds, rank[triangles], outline, np.empty(0))
    )
    x = points[order]
    return (
        Lattice(
            x,
            ends,
            bond_lengths(x, bonds),
            np.full(n, 1.0 / n),
            n,
            surface,
            none,
            none,
            corners,
        ),
        order,
    )


def _first_in_one_piece(
    x: Array, bonds: Long | None, *candidates: Long
) -> tuple[Lattice, Long]:
    tiling = None
    for triangles in candidates:
        with suppress(SimulationError):
            tiling = tiled(x, triangles, bonds)
            if tiling[0].whole:
                break
    if tiling is None:
        raise InputError(
            "the triangles of springs do not form one connected piece: join its parts"
            " by triangles"
        )
    return tiling


def _meshed(x: Array) -> tuple[Lattice, Long]:
    triangles = delaunay(centred(x))
    lattice, order = _first_in_one_piece(
        x, None, without_slivers(x, triangles), triangles
    )
    length = lattice.rest_lengths
    k, typical = int(length.argmax()), float(np.median(length))
    if length[k] <= MAX_SPRING * typical:
        return lattice, order
    try:
        return tiled(x, without_bridges(x, without_slivers(x, triangles)))
    except SimulationError:
        (x0, y0), (x1, y1) = lattice.positions[lattice.bonds[k]]
        raise InputError(
            f"the spring from ({x0:.4g}, {y0:.4g}) to ({x1:.4g}, {y1:.4g}) would cross"
            f" a gap of {length[k]:.3g} R (the median spring is {typical:.3g} R long),"
            " but without it the body falls apart: fill the gap with points, or give"
            " `springs` (`bonds` in an npz file) that go round it"
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
    if abs((total := math.fsum(lattice.masses[:n])) - 1.0) > 1e-9:
        raise InputError(
            f"lattice: the masses of the disk must add up to 1 M, not {total:g}"
        )
    if not len(lattice.wall_surface):
        return lattice
    none = lattice.wall_surface[:0]
    return replace(
        lattice, **disk_rows(vars(lattice), n), wall_surface=none, wall_boundary=none
    )


def disk_rows(arrays: Mapping[str, Any], n: int) -> dict[str, Any]:
    """Return the rows of the first `n` points for each of a lattice's `arrays` that is
    not None."""
    rows: dict[str, Any] = dict.fromkeys(("positions", "masses"), slice(n))
    for key, names in (
        ("bonds", ("bonds", "rest_lengths", "stiffness")),
        ("triangles", ("triangles",)),
    ):
        if arrays.get(key) is not None:
            rows |= dict.fromkeys(names, (arrays[key] < n).all(axis=1))
    return {
        name: arrays[name][chosen]
        for name, chosen in rows.items()
        if arrays.get(name) is not None
    }
