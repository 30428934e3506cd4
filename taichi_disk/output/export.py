"""Export trajectories for other programs; docs/output.md lists formats and
quantities."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.util import find_spec
from math import inf
from pathlib import Path
from tempfile import TemporaryFile
from typing import IO, TYPE_CHECKING, Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import yaml

from taichi_disk.errors import InputError, install_extra
from taichi_disk.fields import Triangles, point_stress, pressure, stress
from taichi_disk.lattice import Array, Lattice
from taichi_disk.output.files import (
    PROGRAM,
    atomic_write,
    check_pictures,
    origin,
    prepare_output,
    write_text,
)

if TYPE_CHECKING:
    from taichi_disk.computation.driver import Moment
    from taichi_disk.computation.scenario import Scenario
    from taichi_disk.physics.model import Model
    from taichi_disk.scenes.scene import DiskScene


@dataclass(frozen=True)
class Frame:
    """Exported arrays of one moment; points, springs and triangles hold quantities by
    name (see docs/output.md)."""

    time: float  # [R/c]
    positions: Array  # (n, 2) [R]
    velocities: Array  # (n, 2) [c]
    points: dict[str, Array]
    springs: dict[str, Array]
    triangles: dict[str, Array]
    energies: dict[str, float]


def _frames(
    lattice: Lattice, model: Model, moments: Iterable[Moment]
) -> Iterator[Frame]:
    triangles = Triangles(lattice)
    for time, x, v in moments:
        contact = np.zeros_like(x)
        if model.wall is not None:
            touching, forces = model.wall.contact_forces(lattice, x, v, model.springs)
            contact[touching] = forces
        sigma, at_points = (
            stress(triangles, model.springs, x),
            point_stress(triangles, model.springs, x),
        )
        springs = {
            "strain": model.springs.strain(lattice, x),
            "tension": model.springs.tension(lattice, x),
            "energy": model.springs.energies(lattice, x),
        }
        energies = {
            "kinetic": float(0.5 * lattice.masses @ (v * v).sum(axis=1)),
            "elastic": float(springs["energy"].sum()),
            "wall": model.wall.energy(lattice, x) if model.wall is not None else 0.0,
        }
        points = {
            "contact_force": contact,
            "stress": at_points,
            "pressure": pressure(at_points),
        }
        yield Frame(
            time,
            x,
            v,
            points,
            springs,
            {"stress": sigma, "pressure": pressure(sigma)},
            energies,
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
    return str(text).strip().replace('"', "'")


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
    n, side = len(lattice.positions), 0.0
    species = np.where(np.arange(n) < lattice.disk_points, "X", "Si")
    size = np.full(n, _radius(lattice))
    ends = lattice.bonds.ravel()
    springs = np.maximum(np.bincount(ends, minlength=n), 1)
    metadata = f'Program="{PROGRAM}" Scene="{_in_a_line(scene)}"'
    with path.open("w", encoding="utf-8", newline="\n") as file:
        for frame in frames:
            columns = {
                "pos": frame.positions,
                "velo": frame.velocities,
                "mass": lattice.masses,
                "radius": size,
            }
            columns |= {
                "masses": lattice.masses,
                "momenta": lattice.masses[:, None] * frame.velocities,
            }
            columns |= {
                "Stress" if name == "stress" else name: values
                for name, values in frame.points.items()
            }
            for name, each in frame.springs.items():
                columns[f"springs_{name}"] = (
                    np.bincount(ends, np.repeat(each, 2), n) / springs
                )
            columns["springs_energy"] *= 0.5 * springs
            parts = {
                name: _three_dimensional(values).reshape(n, -1)
                for name, values in columns.items()
            }
            kinds = ":".join(
                f"{name}:R:{values.shape[1]}" for name, values in parts.items()
            )
            energies = " ".join(
                f"{name}_energy={value:.17g}" for name, value in frame.energies.items()
            )
            # OVITO before 3.17 reads time and energies only if there is a box.
            side = max(side, 2.0 * float(np.abs(frame.positions).max()))
            box = (
                f'Lattice="{side:.12g} 0 0 0 {side:.12g} 0 0 0 1"'
                f' Origin="{-side / 2:.12g} {-side / 2:.12g} -0.5"'
            )
            properties = f"Properties=species:S:1:{kinds}"
            file.write(
                f"{n}\n{box} {metadata} {properties} Time={frame.time:.17g} {energies}"
                ' pbc="F F F"\n'
            )
            table = np.concatenate(list(parts.values()), axis=1)
            line = "%s" + " %.12g" * table.shape[1] + "\n"
            file.writelines(
                line % (kind, *row)
                for kind, row in zip(species, table.tolist(), strict=True)
            )


def _write_gsd(
    path: Path, scene: DiskScene, lattice: Lattice, frames: Iterator[Frame]
) -> None:
    """Write GSD in HOOMD's schema: positions in single precision, other quantities as
    logged arrays in double."""
    import gsd.hoomd

    n, m, reach = len(lattice.positions), len(lattice.bonds), 0.0
    # creates the file with the user's file mode; gsd would make a private file
    path.touch()
    with gsd.hoomd.open(name=str(path), mode="w") as file:
        file.file.write_chunk(
            "taichi_disk/scene", np.frombuffer(origin(scene).encode(), np.uint8)
        )
        for number, frame in enumerate(frames):
            shot = gsd.hoomd.Frame()
            shot.configuration.step, shot.configuration.dimensions = number, 2
            # GSD requires a box, in which OVITO wraps bonds; in a box of twice the size
            # no bond is wrapped.
            reach = max(reach, float(np.abs(frame.positions).max()))
            shot.configuration.box = [4.0 * reach, 4.0 * reach, 0, 0, 0, 0]
            shot.particles.N, shot.particles.types = n, ["disk", "wall"]
            shot.particles.typeid = (np.arange(n) >= lattice.disk_points).astype(
                np.uint32
            )
            shot.particles.position = _three_dimensional(frame.positions)
            shot.particles.velocity = _three_dimensional(frame.velocities)
            shot.particles.mass, shot.particles.diameter = (
                lattice.masses,
                np.full(n, 2.0 * _radius(lattice)),
            )
            shot.bonds.N, shot.bonds.types = m, ["spring"]
            shot.bonds.group, shot.bonds.typeid = lattice.bonds, np.zeros(m, np.uint32)
            shot.log = {
                f"particles/{name}": _three_dimensional(values)
                for name, values in frame.points.items()
            }
            shot.log |= {
                f"bonds/{name}": values for name, values in frame.springs.items()
            }
            shot.log |= {
                f"{name}_energy": np.array([value])
                for name, value in frame.energies.items()
            }
            shot.log["time"] = np.array([frame.time])
            file.append(shot)


def _write_vtu(
    path: Path, scene: DiskScene, lattice: Lattice, frames: Iterator[Frame]
) -> None:
    """Write VTK unstructured grids: a .pvd file that lists the .vtu files in a folder
    of the same name."""
    # Each frame has one file of springs (lines) and one of triangles, so that a viewer
    # can hide either. The folder is complete before the .pvd file is written.
    import meshio

    folder, datasets = path.with_suffix(""), []

    def fill(new: Path) -> None:
        new.mkdir()
        for number, frame in enumerate(frames):
            points = frame.points | {
                "velocity": frame.velocities,
                "mass": lattice.masses,
            }
            points = {
                name: _three_dimensional(values) for name, values in points.items()
            }
            cells = {
                "springs": ("line", lattice.bonds),
                "triangles": ("triangle", lattice.triangles),
            }
            for part, kind in enumerate(cells):
                cell_data = {
                    name: [_three_dimensional(values)]
                    for name, values in getattr(frame, kind).items()
                }
                name = f"{number:04}_{kind}.vtu"
                mesh = meshio.Mesh(
                    _three_dimensional(frame.positions),
                    [cells[kind]],
                    points,
                    cell_data,
                )
                mesh.write(new / name, file_format="vtu")
                file = quoteattr(f"{folder.name}/{name}")
                datasets.append(
                    f'<DataSet timestep="{frame.time:.17g}" part="{part}" file={file}/>'
                )

    atomic_write(folder, fill)
    comment = f"<!-- {PROGRAM}: {_in_a_line(scene).replace('--', '- -')} -->"
    lines = [
        '<?xml version="1.0"?>',
        comment,
        '<VTKFile type="Collection" version="0.1">',
        "<Collection>",
        *datasets,
    ]
    write_text(path, "\n".join([*lines, "</Collection>", "</VTKFile>", ""]))


def _write_npz(
    path: Path, scene: DiskScene, lattice: Lattice, frames: Iterator[Frame]
) -> None:
    """Write t (T,), positions and velocities (T, n, 2), lattice, and points_…,
    springs_…, triangles_… as in `Frame`."""
    # One frame is in memory, then 16 MiB of one array: temporary files collect the
    # frames of each array.
    parts: dict[str, tuple[IO[bytes], Array]] = {}
    with ExitStack() as files:
        for frame in frames:
            row: dict[str, Any] = {
                "t": frame.time,
                "positions": frame.positions,
                "velocities": frame.velocities,
            }
            for kind in ("points", "springs", "triangles"):
                row |= {
                    f"{kind}_{name}": values
                    for name, values in getattr(frame, kind).items()
                }
            row |= {f"{name}_energy": value for name, value in frame.energies.items()}
            for name, value in row.items():
                if name not in parts:
                    parts[name] = (
                        files.enter_context(TemporaryFile(dir=path.parent)),
                        np.asarray(value),
                    )
                parts[name][0].write(np.asarray(value).tobytes())
        arrays: dict[str, Any] = {"scene": origin(scene)}
        for name, (file, first) in parts.items():
            arrays[name] = np.memmap(
                file,
                first.dtype,
                "r",
                shape=(file.tell() // first.nbytes, *first.shape),
            )
        optional = ("stiffness",) if lattice.stiffness is not None else ()
        for name in (
            "bonds",
            "triangles",
            "rest_lengths",
            "masses",
            "disk_points",
            *optional,
        ):
            arrays[name] = getattr(lattice, name)
        np.savez(path, **arrays)


def _radius(lattice: Lattice) -> float:
    """Return a radius [R] at which programs can draw points as balls: a quarter of a
    spring, so springs are visible."""
    return 0.25 * float(np.median(lattice.rest_lengths))


def _three_dimensional(values: Array) -> Array:
    """Return vectors (n, 2) with z = 0, stresses (n, 3) as XX, YY, ZZ, XY, XZ, YZ, and
    scalars unchanged."""
    if values.ndim == 1:
        return values
    padded = np.pad(values, ((0, 0), (0, 1)))
    return padded if values.shape[1] == 2 else padded.take([0, 1, 3, 2, 3, 3], axis=1)


class Format(NamedTuple):
    suffix: str
    write: Callable[[Path, DiskScene, Lattice, Iterator[Frame]], None]
    package: str = ""  # required by the format


FORMATS = {
    "xyz": Format(".xyz", _write_xyz),
    "gsd": Format(".gsd", _write_gsd, "gsd"),
    "vtu": Format(".pvd", _write_vtu, "meshio"),
    "npz": Format(".npz", _write_npz),
}


def check_export(path: Path, format: str | None = None) -> tuple[Path, Format]:
    """Return the file and the format of an export; call this before anything is
    computed.

    `path`: a file whose suffix names the format, or a folder; `format`: one of FORMATS,
    if `path` is a folder. Raises InputError if the format does not exist, its package
    is missing, or the folder is not writable.
    """
    if path.is_dir() and format in FORMATS:
        path = path / f"trajectory{FORMATS[format].suffix}"
    found = next(
        (name for name, one in FORMATS.items() if one.suffix == path.suffix), ""
    )
    if not found or format not in (None, found):
        endings = ", ".join(f"{name} ({one.suffix})" for name, one in FORMATS.items())
        raise InputError(
            f"cannot export to {path}{f' as {format}' if format else ''}: the formats"
            f" are {endings}"
        )
    kind = FORMATS[found]
    if kind.package and find_spec(kind.package) is None:
        needed = f"the format {found} needs the package {kind.package}"
        raise InputError(f"{needed}: {install_extra('export')}")
    prepare_output(path.parent)
    if kind.write is _write_vtu:
        check_pictures(path.with_suffix(""))
    return path, kind


def export_run(
    scenario: Scenario, moments: Iterable[Moment], path: Path, format: str | None = None
) -> Path:
    """Write `moments` of a run and return the file. `path` and `format` are those of
    `check_export`.

    Raises InputError as `check_export` does, and SimulationError if the file cannot be
    written.
    """
    path, kind = check_export(path, format)
    scene, lattice = scenario.scene, scenario.lattice
    frames = _frames(lattice, scenario.model, moments)
    # writes several files, and makes them appear at once by itself
    if kind.write is _write_vtu:
        _write_vtu(path, scene, lattice, frames)
    else:
        atomic_write(path, lambda new: kind.write(new, scene, lattice, frames))
    return path
