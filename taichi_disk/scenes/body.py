"""The disk that a scene is about: random points, or a file of the user's own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection
from typing import TYPE_CHECKING, ClassVar

from taichi_disk.config.scene_base import SceneBase
from taichi_disk.lattice import Array, Lattice, Moduli, bulk_moduli, disk_lattice, own_start, read_lattice

if TYPE_CHECKING:
    from taichi_disk.physics import Springs
    from taichi_disk.simulation.scenario import Scenario


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
            return read_lattice(spec.file)
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
        body = lattice or self.body()
        scenario, own = self.of_body(body), own_start(self.lattice, body, velocities)
        if own.velocities is not None:
            scenario.start_with(own.velocities)
        return scenario

    def moduli(self, points: int) -> Moduli:
        """Of the material of a disk of `points` random points."""
        spec = self.lattice
        return bulk_moduli(points, spec.seed, self.material.k_a, spec.min_spacing)

    def unused(self) -> Collection[tuple[str, str]]:
        keys = () if self.lattice.file == "none" else ("points", "seed", "rim", "min_spacing")
        return [("lattice", key) for key in keys]

    def springs(self, lattice: Lattice) -> Springs:
        """Springs and dashpots of the scene's material, eta = eta* m c/R with m = M/N."""
        from taichi_disk.physics import Springs

        return Springs(self.material.k_a, self.material.k_b, self.material.eta_star / lattice.disk_points)

    def described(self, lattice: Lattice) -> str:
        """The lattice in a few words, for titles."""
        return f"N = {lattice.disk_points:,}    {lattice.origin}"
