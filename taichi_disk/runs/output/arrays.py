"""The files of a run that hold arrays: start and time series."""

from __future__ import annotations

from dataclasses import fields
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk.base.files import write_arrays, write_text
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.simulation.observables import COLUMNS, Column, Columns


def write_timeseries(path: Path, columns: Columns, interval: float = 0.0) -> None:
    """Write timeseries.csv with about one row per `interval` [R/c] and the last row;
    `columns` have at least two."""
    names = [column.name for column in COLUMNS if _is_written(column, columns)]
    table = np.stack([columns[name] for name in names], axis=1)
    every = max(1, round(interval / float(columns["t"][1])))
    rows = np.concatenate([table[:-1:every], table[-1:]])
    text = StringIO()
    np.savetxt(text, rows, "%.17g", ",", header=",".join(names), comments="")
    write_text(path, text.getvalue())


def _is_written(column: Column, columns: Columns) -> bool:
    if column.name not in columns or column.written == "never":
        return False
    return column.written == "always" or bool(columns[column.name].any())


def write_lattice(
    path: Path,
    lattice: Lattice,
    velocities: Array,
    unloaded: Array,
    impedance: Any = None,
) -> None:
    """Write lattice.npz: the state at t = 0 in scene coordinates, from which another
    program can repeat the run.

    `velocities` (n, 2) [c]; `unloaded` (N, 2) [R]: points of the disk before they are
    turned, lifted or loaded, which `lattice.file` reads back bit for bit; `impedance`
    (k, 2) [M c/R] of the points of a matched boundary.
    """
    arrays = {one.name: getattr(lattice, one.name) for one in fields(lattice)}
    del arrays["notes"]
    arrays |= {
        "velocities": velocities,
        "unloaded": unloaded,
        "wall_impedance": impedance,
    }
    present = {
        name: array
        for name, array in arrays.items()
        if array is not None and np.size(array)
    }
    write_arrays(path, **present)
