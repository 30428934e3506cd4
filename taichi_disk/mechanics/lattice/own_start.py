"""The user-supplied initial state of a run."""

from __future__ import annotations

import hashlib
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from taichi_disk.base.errors import InputError
from taichi_disk.mechanics.lattice.custom import numbers
from taichi_disk.mechanics.lattice.files import points_of_disk, read_arrays, reading
from taichi_disk.mechanics.lattice.lattice import Lattice, checked_disk
from taichi_disk.mechanics.lattice.triangles import Array

# arrays of a disk, in the order in which they are digested
_ARRAYS = (
    "positions",
    "bonds",
    "rest_lengths",
    "masses",
    "stiffness",
    "triangles",
    "disk_surface",
)


class OwnStart(NamedTuple):
    """User-supplied initial state of a run, which replaces the scene's random disk or
    its velocities."""

    disk: Lattice | None = None
    velocities: Array | None = None  # (N, 2) [c]

    @property
    def digest(self) -> str:
        """SHA-256 of all arrays that a run reads; "" if there are none."""
        arrays = {name: getattr(self.disk, name, None) for name in _ARRAYS}
        arrays["velocities"] = self.velocities
        digest = hashlib.sha256()
        present = {name: one for name, one in arrays.items() if one is not None}
        for name, array in present.items():
            digest.update(f"{name} {array.dtype.str} {array.shape}\n".encode())
            digest.update(array.tobytes())
        if not present:
            return ""
        return digest.hexdigest()

    def repeating(self, scene: Any) -> Any:
        """Return `scene` with the keys that read this initial state from lattice.npz,
        and the outline from its copy, in the folder of the scene."""
        files = {}
        if self.disk is not None:
            files["file"] = "lattice.npz"
        if self.velocities is not None:
            files["velocities"] = "lattice.npz"
        if scene.lattice.outline != "none":
            files["outline"] = outline_name(scene.lattice)
        return replace(scene, lattice=replace(scene.lattice, **files))


def outline_name(section: Any) -> str:
    """Return the name of the copy of an outline in the folder of a run."""
    return f"outline{Path(section.outline).suffix.lower()}"


def own_start(section: Any, lattice: Lattice | None, velocities: Any) -> OwnStart:
    """Return the initial state of a run. `section` names the files of a lattice or
    velocities that are None.

    If the file holds a wall as well, only the disk's velocities are used. Raises
    InputError, with the name of a file, unless they form a body.
    """
    velocities = own_velocities(section, velocities)
    disk = None
    if lattice is not None:
        disk = checked_disk(lattice)
    elif section.file != "none":
        disk = Lattice.read(section.file)
    return OwnStart(disk, velocities)


def own_velocities(section: Any, velocities: Any) -> Array | None:
    """Return `velocities`, or those in the file that `section` names, as an array; None
    if there are none."""
    if velocities is None and section.velocities != "none":
        path = Path(section.velocities)
        with reading(path, "velocities"):
            if path.suffix.lower() != ".npz":
                raise InputError("velocities are read from an .npz file")
            data = read_arrays(path)
            velocities = data["velocities"]
            velocities = velocities[: points_of_disk(data, len(velocities))]
    if velocities is None:
        return None
    return numbers(velocities, "velocities")
