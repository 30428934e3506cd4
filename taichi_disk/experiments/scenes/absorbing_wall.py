"""Head-on impact on an elastic wall whose sides and bottom absorb the energy (figures 4
to 6)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from math import tan
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from taichi_disk.experiments.config.sections import (
    ElasticImpactSection,
    ElasticWallSection,
    MaterialSection,
)
from taichi_disk.experiments.scenes import oblique
from taichi_disk.experiments.scenes.conflicts import (
    Conflicts,
    least_threshold,
    rounded_up,
)
from taichi_disk.experiments.scenes.impact import ImpactScenario, ImpactScene
from taichi_disk.experiments.scenes.scene import Home
from taichi_disk.mechanics.lattice import Array, Lattice, check_thickness, with_wall

if TYPE_CHECKING:
    from taichi_disk.mechanics.physics import Model, Springs


_WALLS = {
    "reset": "absorbing wall",
    "dashpot": "wall on dashpots",
    "pinned": "pinned wall",
}


class AbsorbingWallScene(ImpactScene):
    """A scene with an elastic wall, as read from its file."""

    title = "impact on an elastic, absorbing wall"
    heading = "Impact on an elastic wall"
    slip_remedy = (
        "; if it has slipped off the end of the wall, write a larger wall.width"
    )
    lattice_keys = (
        "lattice",
        "wall.points",
        "wall.width",
        "wall.k_a",
    )

    scene: Literal["absorbing_wall"] = "absorbing_wall"
    # the boundary absorbs the energy
    material: MaterialSection = MaterialSection(eta_star=0.0)
    wall: ElasticWallSection = ElasticWallSection()
    impact: ElasticImpactSection = ElasticImpactSection()

    def conflicts(self) -> Conflicts:
        conflicts = super().conflicts()
        least = least_threshold(self.wall, self.impact.towards)
        if self.wall.threshold < least:
            text = (
                f"at {self.wall.threshold:g} R the contact potential exceeds 1e-5 of"
                " the kinetic energy, so the energy would jump there: write"
                f" {rounded_up(least)} R or more"
            )
            conflicts.append(("wall.threshold", text))
        narrowest = oblique.least_width(
            self.wall, self.impact, self.time, self.softer_k_a
        )
        if narrowest > self.wall.width:
            text = (
                f"this impact touches the wall up to {0.5 * narrowest:.3g} R from its"
                f" middle: write {rounded_up(narrowest)} R or more, or another"
                " impact.offset"
            )
            conflicts.append(("wall.width", text))
        dt = self.time.dt
        interval = self.reset_interval
        if interval and dt != "auto" and dt > interval:
            conflicts.append(
                (
                    "time.dt",
                    f"{dt:g} is longer than wall.reset_interval = {interval:g} [R/c]",
                )
            )
        if self.video.magnify not in ("auto", 1.0):
            conflicts.append(
                (
                    "video.magnify",
                    "disk and dent would be drawn apart: with an elastic wall write 1",
                )
            )
        return conflicts

    def unused(self) -> Collection[Home]:
        # these keys also shape the wall, whose points are random
        of_wall = ("seed", "rim", "min_spacing")
        return [key for key in super().unused() if key[1] not in of_wall]

    def changes_with(self, key: str, value: Any) -> dict[str, Any]:
        """Return the changes that every scene makes, and a larger `wall.threshold` for
        a softer or slower contact."""
        # The wall keeps the point density of the disk.
        changes = super().changes_with(key, value)
        if key in ("wall.a", "impact.velocity", "impact.angle"):
            section, name = key.split(".")
            changed = replace(getattr(self, section), **{name: value})
            scene = replace(self, **{section: changed})
            least = least_threshold(scene.wall, scene.impact.towards)
            changes["wall.threshold"] = max(
                self.wall.threshold, float(rounded_up(least))
            )
        if key == "lattice.points":
            changes["wall.points"] = max(
                4, round(self.wall.points * value / self.lattice.points)
            )
        return changes

    def body(self) -> Lattice:
        """Return the unloaded disk on its wall, just touching."""
        return self._over_wall(super().body())

    def _over_wall(self, disk: Lattice) -> Lattice:
        spec = self.lattice
        wall = self.wall
        stiffness = self.wall_k_a / self.material.k_a
        return with_wall(
            disk,
            wall.points,
            wall.width,
            spec.seed,
            spec.rim,
            spec.min_spacing,
            stiffness,
        )

    def check_wall(self, points: int) -> None:
        check_thickness(points, self.wall.points, self.wall.width)

    @property
    def reset_interval(self) -> float:
        if self.wall.boundary != "reset":
            return 0.0
        return self.wall.reset_interval

    @property
    def wall_k_a(self) -> float:
        """Linear spring constant of the wall [M c^2/R^2]."""
        if self.wall.k_a == "same":
            return self.material.k_a
        return self.wall.k_a

    @property
    def softer_k_a(self) -> float:
        return min(self.material.k_a, self.wall_k_a)

    # ---- the start

    def of_body(self, body: Lattice) -> ImpactScenario:
        if not len(body.wall_surface):
            body = self._over_wall(body)
        return super().of_body(body)

    def start_offset(self, gap: float) -> float:
        if self.impact.offset == "auto":
            return -gap * tan(self.impact.angle)
        return self.impact.offset

    def view(self, lattice: Lattice, gap: float) -> tuple[float, float, float, float]:
        half = max(0.5 * self.wall.width, 1.1)
        bottom = lattice.positions[:, 1].min()
        return -half - 0.05, half + 0.05, bottom - 0.05, 2.0 + gap

    def model_of(self, lattice: Lattice, springs: Springs) -> Model:
        from taichi_disk.mechanics import physics

        wall = self.wall
        law = physics.ElasticWall
        # A surface of two points is one straight spring, over which the paper's contact
        # is smooth; a spline needs three.
        if wall.contact == "smooth" and len(lattice.wall_surface) >= 3:
            law = physics.SmoothElasticWall
        contact = law(wall.a, wall.V0, wall.threshold)
        boundary: physics.Boundary = physics.PinnedBoundary()
        if wall.boundary == "reset":
            boundary = physics.ResetBoundary(wall.reset_interval)
        elif wall.boundary == "dashpot":
            boundary = physics.MatchedBoundary(self._matched_impedance(lattice))
        return physics.Model(springs, contact, boundary=boundary)

    def _matched_impedance(self, lattice: Lattice) -> Array:
        from taichi_disk.mechanics.physics import matched_impedance

        moduli = self.moduli(lattice.disk_points)
        # of the wall's speed of sound to the disk's
        ratio = np.sqrt(self.wall_k_a / self.material.k_a)
        p, s = (
            ratio * moduli.density * speed
            for speed in (moduli.wave_speed_p, moduli.wave_speed_s)
        )
        return matched_impedance(lattice, p, s)

    @property
    def wall_text(self) -> str:
        return f"{_WALLS[self.wall.boundary]}    {super().wall_text}"
