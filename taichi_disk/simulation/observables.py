"""What is measured: the columns of the time series, and the sums that add up over time inside a kernel."""

from __future__ import annotations

import numpy as np

from taichi_disk.lattice import Array

Columns = dict[str, Array]  # the time series: one array (rows,) per column

COLUMNS = (
    "com_x",  # the disk's centre of mass [R]
    "com_y",
    "com_vx",  # [c]
    "com_vy",
    "angular_momentum",  # of the disk about its centre of mass [M R c]
    "lowest_y",  # of the disk [R]
    "wall_force",  # upward force of the wall on the disk [M c^2/R]
    "kinetic",  # of disk and elastic wall [M c^2]
    "elastic",
    "wall",  # potential of the contact
    "dissipated",  # by dashpots since t = 0
    "absorbed",  # by the elastic wall's boundary since t = 0
    "load",  # potential P y_cm of the pressing force, of other forces, and of the mouse's spring
    "sliding",  # what points lost by passing from one spring of the elastic wall to the next, since t = 0
    "residual",  # largest |force| on a point of the disk [M c^2/R]
)
OPTIONAL = ("friction",)  # after those, where a scene has it: the energy that friction took since t = 0
FRICTION_COLUMN = len(COLUMNS)
INDEX = {name: k for k, name in enumerate(COLUMNS)}
ENERGIES = ("kinetic", "elastic", "wall", "dissipated", "absorbed", "sliding", "load")
PARTS = ("translation", "rotation", "vibration")  # of the kinetic energy, see `split`
ENERGY_INDICES = [INDEX[name] for name in ENERGIES]

# The sums travel through a kernel as a local vector and are stored once, at its end. Taichi 1.7.4 keeps 0-D fields in
# registers across loops and hands later readers in the same kernel the value from before: an energy kept in such a
# field comes out one launch late.
SUMS = 8
DISSIPATED, POWER, ABSORBED, BOUNDARY_POWER, PEAK_POINT_FORCE, SLIDING, LEAVING, INITIAL_LOSS = range(SUMS)
FRICTION, FRICTION_POWER = range(SUMS, SUMS + 2)  # where there is friction


def as_columns(rows: Array, interval: float) -> Columns:
    """Name the columns of `rows` (rows, columns), `interval` [R/c] apart; add time and total energy."""
    columns: Columns = {"t": np.arange(len(rows), dtype=np.float64) * interval}
    columns.update({name: one.copy() for name, one in zip((*COLUMNS, *OPTIONAL), rows.T, strict=False)})
    with np.errstate(invalid="ignore"):  # after a blow-up there may be infinite energies of both signs
        columns["total"] = total_energy(rows)
    return columns


def total_energy(rows: Array) -> Array:
    """(rows,) all energies of `rows` (rows, columns), what was lost included [M c^2]."""
    return np.asarray(rows[:, ENERGY_INDICES].sum(axis=1) + rows[:, len(COLUMNS) :].sum(axis=1))


def within(rows: Array, bounds: Array) -> Array:
    """(rows,) whether each of `rows` (rows, columns) keeps to the least and largest values of `bounds_array`."""
    rows = rows[:, : len(COLUMNS)]
    return np.asarray(((rows >= bounds[0]) & (rows <= bounds[1])).all(axis=1))


def split(columns: Columns, inertia: float) -> Columns:
    """`columns` with the parts of `kinetic`: `translation` and `rotation` of the disk, `vibration`, which is the rest.

    The disk turns with the `inertia` [M R^2] of the unloaded one. A compression changes it by some per cent at the
    most. A fast spin stretches the disk, and `vibration` may then be below 0. What an elastic wall moves is vibration,
    too.
    """
    translation = 0.5 * (columns["com_vx"] ** 2 + columns["com_vy"] ** 2)
    rotation = columns["angular_momentum"] ** 2 / (2.0 * inertia)
    vibration = columns["kinetic"] - translation - rotation
    return columns | dict(zip(PARTS, (translation, rotation, vibration), strict=True))


def vibration_left(columns: Columns) -> float:
    """Energy of all vibration at the end, kinetic and elastic, over that of the flight at t = 0."""
    stored = columns["vibration"] + columns["elastic"]
    return float((stored[-1] - stored[0]) / columns["translation"][0])


def bounds_array(bounds: dict[str, tuple[float, float]]) -> Array:
    """(2, columns) least and largest value of every column, as `bounds` has them; infinite for the others."""
    array = np.array([[-np.inf], [np.inf]]) * np.ones(len(COLUMNS))
    for name, limits in bounds.items():
        array[:, INDEX[name]] = limits
    return array
