"""The files that a run leaves, each whole or not there at all."""

from __future__ import annotations

import json
import platform
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.output import atomic_write, remove_pictures
from taichi_disk.scenes.setup import Columns

FILES = (
    "scene.yaml",
    "summary.json",
    "timeseries.csv",
    "lattice.npz",
    "final.npz",
    "failure.npz",
    "plot.png",
    "video.mp4",
    "video.webm",
    "video.gif",
)
PICTURES = "frames"  # a folder, where the film's format is png
TIMESERIES = (
    "t",
    "com_x",
    "com_y",
    "com_vx",
    "com_vy",
    "angular_momentum",
    "lowest_y",
    "wall_force",
    "kinetic",
    "elastic",
    "wall",
    "dissipated",
    "absorbed",
    "total",
)
MORE = ("load", "sliding")  # potential of the pressing force; energy lost from one spring of the wall to the next


def clear(out: Path) -> None:
    """Remove what an earlier run left, so that nothing old stands beside new results."""
    for name in FILES:
        (out / name).unlink(missing_ok=True)
    remove_pictures(out / PICTURES)


def write_text(path: Path, text: str) -> None:
    def write(beside: Path) -> None:
        beside.write_text(text, encoding="utf-8", newline="\n")

    atomic_write(path, write)


def write_summary(path: Path, summary: dict[str, Any]) -> None:
    write_text(path, json.dumps(summary, indent=2, allow_nan=False) + "\n")


def write_timeseries(path: Path, columns: Columns, interval: float = 0.0) -> None:
    """CSV with the columns of TIMESERIES, and those of MORE that are not zero throughout.

    Of the rows those about every `interval` [R/c], and the last. `total` is the sum of all energies. 17 digits, so
    that the numbers read back are the numbers computed.
    """
    names = [*TIMESERIES, *(name for name in MORE if columns[name].any())]
    table = np.stack([columns[name] for name in names], axis=1)
    every = max(1, round(interval / float(columns["t"][1])))
    kept = np.arange(len(table)) % every == 0
    kept[-1] = True
    table = table[kept]

    def write(beside: Path) -> None:
        np.savetxt(beside, table, fmt="%.17g", delimiter=",", header=",".join(names), comments="")

    atomic_write(path, write)


def write_arrays(path: Path, **arrays: Any) -> None:
    def write(beside: Path) -> None:
        np.savez(beside, **arrays)

    atomic_write(path, write)


def write_lattice(
    path: Path, lattice: Lattice, velocities: NDArray[np.float64], impedance: NDArray[np.float64]
) -> None:
    """lattice.npz: the initial state, as another program needs it to repeat the run."""
    arrays: dict[str, Any] = {
        "positions": lattice.positions,
        "velocities": velocities,
        "bonds": lattice.bonds,
        "rest_lengths": lattice.rest_lengths,
        "masses": lattice.masses,
        "disk_points": np.int64(lattice.disk_points),
        "disk_surface": lattice.disk_surface,
    }
    if len(lattice.wall_surface):
        arrays |= {"wall_surface": lattice.wall_surface, "wall_boundary": lattice.wall_boundary}
    if len(impedance):
        arrays["wall_impedance"] = impedance
    write_arrays(path, **arrays)


def versions() -> dict[str, str]:
    """What computed the numbers."""
    packages = ("taichi-disk", "taichi", "numpy", "scipy")
    return {"python": platform.python_version()} | {name: version(name) for name in packages}
