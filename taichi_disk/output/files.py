"""Result files, each whole or not there at all."""

from __future__ import annotations

import contextlib
import csv
import json
import os
import platform
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import version
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk import __version__
from taichi_disk.errors import InputError, SimulationError
from taichi_disk.lattice import Array, Lattice

_MOTION = ("t", "com_x", "com_y", "com_vx", "com_vy", "angular_momentum", "lowest_y", "wall_force")
TIMESERIES = (*_MOTION, "kinetic", "elastic", "wall", "dissipated", "absorbed", "total")
MORE = ("load", "sliding")  # potential of the pressing force; energy lost from one spring of the wall to the next
NUMBERED = re.compile(r"\d+(_[a-z]+)?\.(png|vtu)")  # files of a folder that holds a film's pictures, or a trajectory


def prepare_output(out: Path) -> list[Path]:
    """Make the folder `out`, or prove that the one that exists can be written.

    Returns the folders that were made, outermost first. Raises InputError, and leaves nothing behind, if a file is in
    the way or the place is not writable.
    """
    created: list[Path] = []
    try:
        for folder in (*reversed(out.parents), out):
            if not folder.exists():
                folder.mkdir()
                created.append(folder)
        probe = beside(out / "probe")
        probe.touch(exist_ok=False)
        probe.unlink()
    except (OSError, ValueError) as error:
        remove_empty(created)
        raise cannot_write(out, error) from None
    return created


def remove_empty(folders: list[Path]) -> None:
    """Remove the folders that `prepare_output` made, as far as nothing is in them."""
    for folder in reversed(folders):
        with contextlib.suppress(OSError):
            folder.rmdir()


def cannot_write(out: Path, error: BaseException) -> InputError:
    """What to tell of a folder that cannot be written."""
    why = reason(error)
    try:
        os.getcwd()
    except OSError:
        why = "the working directory no longer exists"
    with contextlib.suppress(OSError, ValueError):
        if blocker := next((path for path in (out, *out.parents) if path.is_file()), None):
            why = f"{blocker} is a file"
    return InputError(f"cannot write into the output folder {out}: {why}; choose another with --out")


def atomic_write(path: Path, writer: Callable[[Path], object]) -> None:
    """Let `writer` fill a file (or a folder of numbered files) beside `path`, same suffix, then rename it to `path`.

    If the writer fails or is interrupted, what is beside is removed and `path` stays as it was. Raises SimulationError
    if the disk is full or the folder has become read-only; the writer's other errors pass.
    """
    new = beside(path)
    try:
        writer(new)
        if new.is_dir():
            check_pictures(path)
            remove(path)
        os.replace(new, path)
    except OSError as error:
        # The hidden folder in which a run is built says nothing to a person.
        shown = path.name if path.parent.name.startswith(".") else path
        raise SimulationError(f"cannot write {shown}: {reason(error)}") from error
    finally:
        remove(new)


def beside(path: Path) -> Path:
    """A hidden name next to `path`. NumPy and encoders go by the suffix, so that it stays at the end."""
    return path.with_name(f".{path.stem}.{os.getpid()}{path.suffix}")


def remove(path: Path) -> None:
    """Remove a file or folder if that can be done."""
    shutil.rmtree(path, ignore_errors=True)
    with contextlib.suppress(OSError):
        path.unlink()


def check_pictures(folder: Path) -> None:
    """Raise InputError if `folder` is there and is not a folder with nothing but numbered files."""
    if os.path.lexists(folder) and not only_numbered(folder):
        raise InputError(f"{folder} is not a folder of a film's pictures alone: remove it, or choose another")


def only_numbered(folder: Path) -> bool:
    """Whether `folder` is a folder with nothing but numbered pictures or frames of a trajectory."""
    return folder.is_dir() and all(NUMBERED.fullmatch(one.name) for one in folder.iterdir())


def write_text(path: Path, text: str) -> None:
    """`text` in UTF-8 with Unix line ends."""
    atomic_write(path, lambda new: new.write_bytes(text.encode("utf-8")))


def write_summary(path: Path, summary: dict[str, Any]) -> None:
    """summary.json. NaN is refused: JSON has none."""
    write_text(path, json.dumps(summary, indent=2, allow_nan=False) + "\n")


def write_timeseries(path: Path, columns: dict[str, Array], interval: float = 0.0) -> None:
    """timeseries.csv: the columns of TIMESERIES, and those of MORE that are not zero throughout, and xi of a loading.

    Of the columns (rows,), two rows at least, one is written every `interval` [R/c], about, and the last one. Numbers
    have 17 digits, so that those read back are those computed.
    """
    names = [*TIMESERIES, *(name for name in MORE if columns[name].any()), *["xi"] * ("xi" in columns)]
    table = np.stack([columns[name] for name in names], axis=1)
    every = max(1, round(interval / float(columns["t"][1])))
    kept = [*range(0, len(table) - 1, every), -1]
    how = {"fmt": "%.17g", "delimiter": ",", "header": ",".join(names), "comments": ""}
    atomic_write(path, lambda new: np.savetxt(new, table[kept], **how))


def write_csv(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """A column for each key of `rows`, which have the same; numbers with all their digits, nothing for None."""
    text = StringIO()
    table = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    table.writeheader()
    table.writerows(rows)
    write_text(path, text.getvalue())


def write_arrays(path: Path, **arrays: Any) -> None:
    """The arrays as .npz."""
    atomic_write(path, lambda new: np.savez(new, **arrays))


def write_lattice(path: Path, lattice: Lattice, velocities: Array, impedance: Array | None = None) -> None:
    """lattice.npz: the state at t = 0 in scene coordinates, as another program needs it to repeat the run.

    `velocities` are (n, 2) [c], `impedance` is that of the points of a matched boundary (k, 2) [M c/R].
    """
    names = ["positions", "bonds", "rest_lengths", "masses", "disk_points", "disk_surface"]
    if len(lattice.wall_surface):
        names += ["wall_surface", "wall_boundary"]
    arrays = {name: getattr(lattice, name) for name in names}
    if impedance is not None and len(impedance):
        arrays["wall_impedance"] = impedance
    write_arrays(path, velocities=velocities, **arrays)


def versions() -> dict[str, str]:
    """What computed the numbers."""
    own = {"python": platform.python_version(), "taichi-disk": __version__}
    return own | {name: version(name) for name in ("taichi", "numpy", "scipy")}


def reason(error: BaseException) -> str:
    """What the operating system says, without number and name of file."""
    return (error.strerror if isinstance(error, OSError) else None) or str(error)
