"""Export trajectories for other programs; docs/output.md lists formats and
quantities."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import repeat
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, Any
from xml.sax.saxutils import quoteattr

import numpy as np
import yaml

from taichi_disk.base.errors import InputError, pip_install
from taichi_disk.base.files import (
    PROGRAM,
    atomic_write,
    check_pictures,
    prepare_output,
    write_text,
)
from taichi_disk.experiments.computation.driver import State
from taichi_disk.experiments.computation.scenario import Scenario
from taichi_disk.experiments.scenes.scene import DiskScene, origin
from taichi_disk.mechanics.fields import Triangles, point_stress, pressure, stress
from taichi_disk.mechanics.lattice import Array, Lattice
from taichi_disk.mechanics.physics import Model

Quantities = dict[str, Array]  # by name
BLOCK = 10_000  # rows of a text file that are formatted together


@dataclass(frozen=True)
class Frame:
    """Exported arrays of one moment; points, springs and triangles hold quantities by
    name (see docs/output.md)."""

    time: float  # [R/c]
    positions: Array  # (n, 2) [R]
    velocities: Array  # (n, 2) [c]
    points: Quantities
    springs: Quantities
    triangles: Quantities
    energies: dict[str, float]


def _frames(
    lattice: Lattice, model: Model, moments: Iterable[State]
) -> Iterator[Frame]:
    triangles = Triangles(lattice)
    wall: Any = model.wall  # every scene has one
    last = None
    for time, x, v in moments:
        if time == last:  # two moments at the same step
            continue
        last = time
        contact = np.zeros_like(x)
        touching, forces = wall.contact_forces(lattice, x, v, model.springs)
        contact[touching] = forces
        in_triangles = stress(triangles, model.springs, x)
        at_points = point_stress(triangles, model.springs, x)
        springs = {
            "strain": model.springs.strain(lattice, x),
            "tension": model.springs.tension(lattice, x),
            "energy": model.springs.energies(lattice, x),
        }
        yield Frame(
            time=time,
            positions=x,
            velocities=v,
            points={
                "contact_force": contact,
                "stress": at_points,
                "pressure": pressure(at_points),
            },
            springs=springs,
            triangles={"stress": in_triangles, "pressure": pressure(in_triangles)},
            energies={
                "kinetic": float(0.5 * lattice.masses @ (v * v).sum(axis=1)),
                "elastic": float(springs["energy"].sum()),
                "wall": wall.energy(lattice, x),
            },
        )


# ---- formats: each writer takes a path, the scene for the metadata, the lattice and an
# iterator of frames


def _in_a_line(scene: DiskScene) -> str:
    text = yaml.safe_dump(
        yaml.safe_load(scene.to_yaml()),
        default_flow_style=True,
        sort_keys=False,
        width=inf,
    )
    return text.strip().replace('"', "'")


def _write_xyz(
    path: Path, scene: DiskScene, lattice: Lattice, frames: Iterator[Frame]
) -> None:
    """Write extended XYZ: text with 12 digits, one line for each point. The format has
    no springs.

    Strain and tension of a point are means over its springs; its energy is half of
    theirs, so that energies add up. ASE accepts only elements and X (no element) as
    species: points of the disk are X, points of an elastic wall Si. ASE reads
    velocities from `momenta` and `masses`, OVITO from `velo`, with masses from `mass`.
    The stress is called `Stress`, which OVITO reads as a tensor, because ASE reads
    `stress` and `energy` as values of the whole system.
    """
    n = len(lattice.positions)
    metadata = f'Program="{PROGRAM}" Scene="{_in_a_line(scene)}"'
    side = 0.0
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for frame in frames:
            # OVITO before 3.17 reads time and energies only if there is a box.
            side = max(side, 2.0 * float(np.abs(frame.positions).max()))
            box = (
                f'Lattice="{side:.12g} 0 0 0 {side:.12g} 0 0 0 1"'
                f' Origin="{-side / 2:.12g} {-side / 2:.12g} -0.5"'
            )
            columns = _xyz_columns(lattice, frame)
            kinds = ["species:S:1"]
            for name, values in columns.items():
                kinds.append(f"{name}:R:{values.shape[1]}")
            properties = f"Properties={':'.join(kinds)}"
            energies = " ".join(
                f"{name}_energy={value:.17g}" for name, value in frame.energies.items()
            )
            file.write(
                f"{n}\n{box} {metadata} {properties} Time={frame.time:.17g} {energies}"
                ' pbc="F F F"\n'
            )
            table = np.concatenate(list(columns.values()), axis=1)
            _write_rows(file, "X", table[: lattice.disk_points])
            _write_rows(file, "Si", table[lattice.disk_points :])


def _write_rows(file: IO[str], species: str, table: Array) -> None:
    """Write a line of `species` and numbers for each row, as `np.savetxt` would, which
    formats one row at a time and takes twice as long."""
    line = f"{species} {' '.join(repeat('%.12g', table.shape[1]))}\n"
    for first in range(0, len(table), BLOCK):
        rows = table[first : first + BLOCK]
        file.write(len(rows) * line % tuple(rows.ravel().tolist()))


def _xyz_columns(lattice: Lattice, frame: Frame) -> Quantities:
    """Return the columns (n, k) of an XYZ file by name."""
    n = len(lattice.positions)
    columns = {
        "pos": frame.positions,
        "velo": frame.velocities,
        "mass": lattice.masses,
        # a quarter of a spring, so balls of this radius leave springs visible
        "radius": np.full(n, 0.25 * float(np.median(lattice.rest_lengths))),
        "masses": lattice.masses,
        "momenta": lattice.masses[:, None] * frame.velocities,
        "contact_force": frame.points["contact_force"],
        "Stress": frame.points["stress"],
        "pressure": frame.points["pressure"],
    }
    ends = lattice.bonds.ravel()
    springs_at_point = np.maximum(np.bincount(ends, minlength=n), 1)
    for name, values in frame.springs.items():
        total = np.bincount(ends, np.repeat(values, 2), n)
        if name == "energy":
            # half of a spring's energy belongs to each of its ends
            columns[f"springs_{name}"] = 0.5 * total
        else:
            columns[f"springs_{name}"] = total / springs_at_point
    return {
        name: _three_dimensional(values).reshape(n, -1)
        for name, values in columns.items()
    }


def _write_vtu(
    path: Path, scene: DiskScene, lattice: Lattice, frames: Iterator[Frame]
) -> None:
    """Write VTK unstructured grids: a .pvd file that lists the .vtu files in a folder
    of the same name."""
    # Each frame has one file of springs (lines) and one of triangles, so that a viewer
    # can hide either. The folder is complete before the .pvd file is written.
    import meshio

    folder = path.with_suffix("")
    datasets = []

    def fill(new: Path) -> None:
        new.mkdir()
        for number, frame in enumerate(frames):
            x = _three_dimensional(frame.positions)
            quantities = frame.points | {
                "velocity": frame.velocities,
                "mass": lattice.masses,
            }
            points = _each_three_dimensional(quantities)
            parts = (
                ("springs", ("line", lattice.bonds), frame.springs),
                ("triangles", ("triangle", lattice.triangles), frame.triangles),
            )
            for part, (kind, cells, values) in enumerate(parts):
                cell_data = {
                    name: [each]
                    for name, each in _each_three_dimensional(values).items()
                }
                name = f"{number:04}_{kind}.vtu"
                mesh = meshio.Mesh(x, [cells], points, cell_data)
                mesh.write(new / name, file_format="vtu")
                file = quoteattr(f"{folder.name}/{name}")
                datasets.append(
                    f'<DataSet timestep="{frame.time:.17g}" part="{part}" file={file}/>'
                )

    atomic_write(folder, fill)
    lines = [
        '<?xml version="1.0"?>',
        f"<!-- {PROGRAM}: {_in_a_line(scene).replace('--', '- -')} -->",
        '<VTKFile type="Collection" version="0.1">',
        "<Collection>",
        *datasets,
        "</Collection>",
        "</VTKFile>",
    ]
    write_text(path, "\n".join(lines) + "\n")


def _write_npz(
    path: Path, scene: DiskScene, lattice: Lattice, frames: Iterator[Frame]
) -> None:
    """Write t (T,), positions and velocities (T, n, 2), lattice, and points_…,
    springs_…, triangles_… as in `Frame`."""
    # One frame is in memory, then 16 MiB of one array: temporary files collect the
    # frames of each array.
    collected = {}
    first = {}
    with ExitStack() as files:
        for frame in frames:
            for name, value in _npz_arrays(frame).items():
                if name not in collected:
                    collected[name] = files.enter_context(
                        TemporaryFile(dir=path.parent)
                    )
                    first[name] = value
                collected[name].write(value.tobytes())
        arrays: dict[str, Any] = {"scene": origin(scene)}
        for name, file in collected.items():
            one = first[name]
            shape = (file.tell() // one.nbytes, *one.shape)
            arrays[name] = np.memmap(file, one.dtype, "r", shape=shape)
        for name in ("bonds", "triangles", "rest_lengths", "masses", "disk_points"):
            arrays[name] = getattr(lattice, name)
        if lattice.stiffness is not None:
            arrays["stiffness"] = lattice.stiffness
        np.savez(path, **arrays)


def _npz_arrays(frame: Frame) -> Quantities:
    arrays = {
        "t": frame.time,
        "positions": frame.positions,
        "velocities": frame.velocities,
    }
    for kind in ("points", "springs", "triangles"):
        for name, each in getattr(frame, kind).items():
            arrays[f"{kind}_{name}"] = each
    for name, value in frame.energies.items():
        arrays[f"{name}_energy"] = value
    return {name: np.asarray(value) for name, value in arrays.items()}


def _three_dimensional(values: Array) -> Array:
    """Return vectors (n, 2) with z = 0, stresses (n, 3) as XX, YY, ZZ, XY, XZ, YZ, and
    scalars unchanged."""
    if values.ndim == 1:
        return values
    padded = np.pad(values, ((0, 0), (0, 1)))
    if values.shape[1] == 2:
        return padded
    return padded.take([0, 1, 3, 2, 3, 3], axis=1)


def _each_three_dimensional(quantities: Quantities) -> Quantities:
    return {name: _three_dimensional(values) for name, values in quantities.items()}


# suffix and writer of each format
FORMATS = {
    "xyz": (".xyz", _write_xyz),
    "vtu": (".pvd", _write_vtu),
    "npz": (".npz", _write_npz),
}


def check_export(path: Path, format: str | None = None) -> tuple[Path, str]:
    """Return the file and the name of the format of an export; call this before
    anything is computed.

    `path`: a file whose suffix names the format, or a folder; `format`: one of FORMATS,
    if `path` is a folder. Raises InputError if the format does not exist, its package
    is missing, a run has a file of that name, or the folder is not writable.
    """
    if path.is_dir() and format in FORMATS:
        path = path / f"trajectory{FORMATS[format][0]}"
    by_suffix = {suffix: name for name, (suffix, _) in FORMATS.items()}
    name = by_suffix.get(path.suffix)
    if (
        name is None
        or format not in (None, name)
        or path.name in ("lattice.npz", "final.npz")
    ):
        target = str(path)
        if format:
            target += f" as {format}"
        endings = ", ".join(f"{name} ({suffix})" for suffix, name in by_suffix.items())
        raise InputError(
            f"cannot export to {target}: the formats are {endings}; the names"
            " lattice.npz and final.npz are taken by runs"
        )
    if name == "vtu":
        if find_spec("meshio") is None:
            needed = "the format vtu needs the package meshio"
            raise InputError(f"{needed}: {pip_install('meshio')}")
        check_pictures(path.with_suffix(""))
    prepare_output(path.parent)
    return path, name


def export_run(
    scenario: Scenario, moments: Iterable[State], path: Path, format: str | None = None
) -> Path:
    """Write `moments` of a run and return the file. `path` and `format` are those of
    `check_export`.

    Raises InputError as `check_export` does, and SimulationError if the file cannot be
    written.
    """
    path, name = check_export(path, format)
    scene = scenario.stored_scene
    lattice = scenario.lattice
    frames = _frames(lattice, scenario.model, moments)
    _, write = FORMATS[name]
    # writes several files, and makes them appear at once by itself
    if name == "vtu":
        write(path, scene, lattice, frames)
    else:
        atomic_write(path, lambda new: write(new, scene, lattice, frames))
    return path
