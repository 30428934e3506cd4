"""The columns of the time series."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple, TypeAlias

import numpy as np

if TYPE_CHECKING:  # the process that draws curves needs no lattice
    from taichi_disk.mechanics.lattice import Array

# the time series: one array (rows,) per column
Columns: TypeAlias = "dict[str, Array]"
Bounds: TypeAlias = dict[str, tuple[float, float]]  # smallest and largest values


class Column(NamedTuple):
    """A column of the time series."""

    name: str
    unit: str
    meaning: str
    # "motion"; stored "energy" and "loss" since t = 0, which add up to `total`; "part"
    # of the kinetic energy; "derived" from other columns. Kernels measure the first
    # three kinds.
    kind: str
    label: str = ""  # name among the energies; "": not shown
    # to timeseries.csv: "always", "nonzero" (unless it is 0 throughout) or "never"
    written: str = "always"


COLUMNS = (
    Column(
        "t",
        "R/c",
        "time; for Newton's method the fraction of the load *P*, up to 1: one line for"
        " each equilibrium",
        "derived",
    ),
    Column("com_x", "R", "centre of mass of the disk, to the right", "motion"),
    Column("com_y", "R", "centre of mass of the disk, upwards", "motion"),
    Column("com_vx", "c", "velocity of the centre of mass to the right", "motion"),
    Column("com_vy", "c", "velocity of the centre of mass upwards", "motion"),
    Column(
        "angular_momentum",
        "M R c",
        "angular momentum of the disk about its centre of mass",
        "motion",
    ),
    Column("lowest_y", "R", "height of the lowest point of the disk", "motion"),
    Column("wall_force", "M c²/R", "upward force of the wall on the disk", "motion"),
    Column(
        "residual",
        "M c²/R",
        "largest force on a point of the disk",
        "motion",
        written="never",
    ),
    Column(
        "depth",
        "R",
        "how deep a point of the disk is below the surface of an elastic wall",
        "motion",
        written="never",
    ),
    Column(
        "inverted",
        "1",
        "number of triangles that are turned inside out",
        "motion",
        written="nonzero",
    ),
    Column(
        "kinetic", "M c²", "kinetic energy of the disk and an elastic wall", "energy"
    ),
    Column("elastic", "M c²", "energy of the springs", "energy", "elastic"),
    Column("wall", "M c²", "potential of the contact", "energy", "wall"),
    Column("dissipated", "M c²", "lost in dashpots", "loss", "dashpots"),
    Column(
        "absorbed",
        "M c²",
        "lost at the boundary of an elastic wall",
        "loss",
        "boundary",
    ),
    Column("total", "M c²", "sum of all energies and losses", "derived"),
    Column(
        "load",
        "M c²",
        "potential of the load and other forces",
        "energy",
        "load",
        "nonzero",
    ),
    Column(
        "sliding",
        "M c²",
        "lost where points pass from one spring of an elastic wall to the next",
        "loss",
        "sliding",
        "nonzero",
    ),
    Column("friction", "M c²", "lost in friction", "loss", "friction", "nonzero"),
    Column("xi", "R", "Newton's method: compression under that load", "derived"),
    Column("translation", "M c²", "kinetic energy of the flight", "part", "flight"),
    Column("rotation", "M c²", "kinetic energy of the rotation", "part", "rotation"),
    Column("vibration", "M c²", "the rest of the kinetic energy", "part", "vibration"),
)
BY_NAME = {column.name: column for column in COLUMNS}


def of_kind(*kinds: str) -> list[str]:
    """Return the names of the columns of the `kinds`, kind by kind."""
    names = []
    for kind in kinds:
        names += [column.name for column in COLUMNS if column.kind == kind]
    return names


_STORED = [one.name for one in COLUMNS if one.kind in ("motion", "energy", "loss")]
INDEX = {name: k for k, name in enumerate(_STORED)}
ENERGY_INDICES = sorted(INDEX[name] for name in of_kind("energy", "loss"))


def as_columns(rows: Array, interval: float) -> Columns:
    """Return the columns of `rows` (rows, columns), `interval` [R/c] apart, by name;
    add time and total energy."""
    columns: Columns = {"t": np.arange(len(rows), dtype=np.float64) * interval}
    columns |= {name: values.copy() for name, values in zip(INDEX, rows.T, strict=True)}
    # a blow-up may cause infinite energies of both signs
    with np.errstate(invalid="ignore"):
        columns["total"] = total_energy(rows)
    return columns


def total_energy(rows: Array) -> Array:
    """Return the sum (rows,) of all energies and losses of `rows` (rows, columns) [M
    c^2]."""
    return rows[:, ENERGY_INDICES].sum(axis=1)


def within(rows: Array, bounds: Array) -> Array:
    return ((rows >= bounds[0]) & (rows <= bounds[1])).all(axis=1)


def split(columns: Columns, inertia: float) -> Columns:
    """Return `columns` with the kinetic energies `translation` and `rotation` of the
    disk and the rest, `vibration`.

    `inertia` [M R^2] is that of the unloaded disk; a compression changes it by at most
    some per cent. If a fast spin stretches the disk, `vibration` may be negative. The
    motion of an elastic wall counts as vibration.
    """
    translation = 0.5 * (columns["com_vx"] ** 2 + columns["com_vy"] ** 2)
    rotation = columns["angular_momentum"] ** 2 / (2.0 * inertia)
    return columns | {
        "translation": translation,
        "rotation": rotation,
        "vibration": columns["kinetic"] - translation - rotation,
    }


def bounds_array(bounds: Bounds) -> Array:
    """Return (2, columns) with the smallest and largest value of every column, infinite
    for columns not in `bounds`."""
    array = np.array([[-np.inf], [np.inf]]) * np.ones(len(INDEX))
    for name, limits in bounds.items():
        array[:, INDEX[name]] = limits
    return array
