"""The disk that a scene is about: random points, or a file of the user's own."""

from __future__ import annotations

import hashlib
from abc import abstractmethod
from collections.abc import Callable, Collection
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from taichi_disk.config.scene_base import SceneBase
from taichi_disk.errors import InputError
from taichi_disk.lattice import (
    Array,
    Lattice,
    Moduli,
    bulk_moduli,
    disk_lattice,
    disk_of,
    numbers,
    read_lattice,
    read_velocities,
)

if TYPE_CHECKING:
    from taichi_disk.physics import Springs
    from taichi_disk.simulation.scenario import Scenario


class OwnStart(NamedTuple):
    """What a run begins with in place of its scene's random disk or velocities, from Python or from a file."""

    disk: Lattice | None = None
    velocities: Array | None = None  # (N, 2) [c]

    @property
    def digest(self) -> str:
        """SHA-256 of the arrays; empty if there are none."""
        arrays: list[Any] = [] if self.velocities is None else [self.velocities]
        if self.disk is not None:
            arrays += [self.disk.positions, self.disk.bonds, self.disk.rest_lengths]
        return hashlib.sha256(b"".join(one.tobytes() for one in arrays)).hexdigest() if arrays else ""

    def repeating(self, scene: Any) -> Any:
        """The scene that takes them from lattice.npz beside its file."""
        named = zip(("file", "velocities"), self, strict=True)
        changes = {key: "lattice.npz" for key, given in named if given is not None}
        return replace(scene, lattice=replace(scene.lattice, **changes))


class DiskScene(SceneBase):
    """What every kind of scene has. A kind adds sections, and `of_body`, which makes the scene ready to be stepped.

    Attributes:
        lattice_keys: the sections and keys on which `body` depends.
        abscissa, results: of a sweep, the key that curves are drawn against, the numbers of each scene.
    """

    lattice_keys: ClassVar[tuple[str, ...]] = ("lattice",)
    abscissa: ClassVar[tuple[str, str]]
    results: ClassVar[tuple[str, ...]] = ()

    def body(self) -> Lattice:
        """The unloaded lattice. Raises InputError for a file that holds no disk, SimulationError as `disk_lattice`."""
        spec = self.lattice
        if spec.file != "none":
            return _read("file", read_lattice, spec.file)
        return disk_lattice(spec.points, spec.seed, spec.rim, spec.min_spacing)

    @abstractmethod
    def of_body(self, body: Lattice) -> Scenario:
        """The scene of the unloaded lattice `body`, as the method `body` gives it or without its wall."""

    def scenario(self, lattice: Lattice | None = None, velocities: Array | None = None) -> Scenario:
        """The scene ready to be stepped.

        Args:
            lattice: an unloaded disk to take instead of the scene's own, or one with its wall as `body` gives it.
            velocities: (N, 2) [c] of the disk's points at t = 0 instead of the scene's own.
        """
        scenario = self.of_body(lattice or self.body())
        if velocities is None and self.lattice.velocities != "none":
            velocities = _read("velocities", read_velocities, self.lattice.velocities)
        if velocities is not None:
            scenario.start_with(velocities)
        return scenario

    def own_start(self, lattice: Lattice | None = None, velocities: Any = None) -> OwnStart:
        """These, else those of the files that the scene names. Raises InputError for what is no lattice, no numbers."""
        spec = self.lattice
        if lattice is not None:
            lattice = disk_of(lattice)
        elif spec.file != "none":
            lattice = _read("file", read_lattice, spec.file)
        if velocities is not None:
            velocities = numbers(velocities, "velocities")
        elif spec.velocities != "none":
            velocities = _read("velocities", read_velocities, spec.velocities)
        return OwnStart(lattice, velocities)

    def moduli(self, points: int) -> Moduli:
        """Of the material of a disk of `points` random points."""
        spec = self.lattice
        return bulk_moduli(points, spec.seed, self.material.k_a, spec.min_spacing)

    def unused(self) -> Collection[tuple[str, str]]:
        keys = () if self.lattice.file == "none" else ("points", "seed", "rim", "min_spacing")
        thrown = () if self.lattice.velocities == "none" else ("velocity", "spin")
        return [*(("lattice", key) for key in keys), *(("impact", key) for key in thrown)]

    def springs(self, lattice: Lattice) -> Springs:
        """Springs and dashpots of the scene's material, eta = eta* m c/R with m = M/N."""
        from taichi_disk.physics import Springs

        return Springs(self.material.k_a, self.material.k_b, self.material.eta_star / lattice.disk_points)

    def described(self, lattice: Lattice) -> str:
        """The lattice in a few words, for titles."""
        return f"N = {lattice.disk_points:,}    {lattice.origin}"


def _read(key: str, read: Callable[[str], Any], file: str) -> Any:
    try:
        return read(file)
    except InputError as error:
        raise InputError(f"lattice.{key}: {error}") from error
