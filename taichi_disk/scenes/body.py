"""The disk that a scene is about: random points, or a file of the user's own."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Collection
from typing import TYPE_CHECKING, Any, ClassVar

from taichi_disk.config.scene_base import Conflicts, SceneBase
from taichi_disk.config.sections import LatticeSection
from taichi_disk.lattice import (
    Array,
    Lattice,
    Moduli,
    bulk_moduli,
    circle_faults,
    disk_lattice,
    own_start,
    read_lattice,
)

if TYPE_CHECKING:
    from taichi_disk.computation.scenario import Scenario
    from taichi_disk.physics import Springs


class DiskScene(SceneBase):
    """What every kind of scene has. A kind adds sections, and `of_body`, which makes the scene ready to be stepped.

    Attributes:
        lattice_keys: the sections and keys on which `body` depends.
        abscissa, results: of a sweep, the key that curves are drawn against, the numbers of each scene.
        optional_results: numbers that only some scenes have.
    """

    lattice_keys: ClassVar[tuple[str, ...]] = ("lattice",)
    abscissa: ClassVar[tuple[str, str]]
    results: ClassVar[tuple[str, ...]] = ()
    optional_results: ClassVar[tuple[str, ...]] = ()

    def body(self) -> Lattice:
        """The unloaded lattice. Raises InputError for a file that holds no disk, SimulationError as `disk_lattice`."""
        spec = self.lattice
        if spec.file != "none":
            return read_lattice(spec.file)
        core = spec.core_radius, spec.core_stiffness, spec.core_density
        return disk_lattice(spec.points, spec.seed, spec.rim, spec.min_spacing, spec.hole, *core)

    def conflicts(self) -> Conflicts:
        spec, found = self.lattice, super().conflicts()
        if spec.file != "none":  # which says it all
            return found
        faults = circle_faults(spec.points, spec.hole, spec.core_radius)
        found += [(f"lattice.{key}", fault) for key, fault in faults]
        for key in ("core_stiffness", "core_density"):
            if not spec.core_radius and getattr(spec, key) != 1.0:
                found.append((f"lattice.{key}", "there is no core: write lattice.core_radius, too, or leave this out"))
        return found

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
        if self.lattice.file == "none":
            return []
        return [("lattice", key) for key in self.lattice.schema() if key not in ("file", "velocities")]

    def springs(self, lattice: Lattice) -> Springs:
        """Springs and dashpots of the scene's material."""
        from taichi_disk.physics import Springs

        material = self.material
        eta = material.eta(lattice.disk_points)
        return Springs(material.k_a, material.k_b, eta, axial=material.dashpot == "axial")

    def keeping_the_body(self) -> dict[str, Any]:
        """Keys, as `with_` takes them, with which another `lattice.points` leaves the body as viscous as it is."""
        name, value = self.material.dashpots
        if name == "viscosity" or not value or self.lattice.file != "none":
            return {}
        eta = self.material.eta(self.lattice.points)
        return {"material.viscosity": eta, "material.eta_star": self.usual_eta_star()}

    def notes(self, points: int) -> list[str]:
        """What a person should know of a result that depends on the dashpots of a disk of so many points."""
        (name, value), paper = self.material.dashpots, LatticeSection.points
        if name == "viscosity" or not value or points == paper:
            return []
        compared = (
            f"with {points:,} points the body is {paper / points:.3g} times as viscous as with the paper's {paper}"
        )
        remedy = f"material.viscosity = {value / paper:.3g} makes it the same"
        return [f"material.eta_star = {value:g} is per point: {compared}; {remedy}"]

    @property
    def damping(self) -> str:
        """The viscosity in a few words, for titles."""
        name, value = self.material.dashpots
        return f"η* = {value:g}" if name == "eta_star" else f"η = {value:g} Mc/R"

    def described(self, lattice: Lattice) -> str:
        """The lattice in a few words, for titles."""
        return f"N = {lattice.disk_points:,}    {lattice.origin}"
