"""Head-on impact on a rigid wall (figure 3): restitution e against v, eq. (5)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from taichi_disk.experiments.config.sections import ImpactSection, RoughWallSection
from taichi_disk.experiments.scenes.impact import ImpactScene
from taichi_disk.mechanics.lattice import Lattice

if TYPE_CHECKING:
    from taichi_disk.mechanics.physics import Model, Springs


class ExponentialWallScene(ImpactScene):
    """An impact on a rigid wall, as read from its file."""

    title = "impact on a rigid wall"
    heading = "Impact on a rigid wall"

    scene: Literal["exponential_wall"] = "exponential_wall"
    wall: RoughWallSection = RoughWallSection()
    impact: ImpactSection = ImpactSection()

    def model_of(self, lattice: Lattice, springs: Springs) -> Model:
        from taichi_disk.mechanics.physics import ExponentialWall, Model

        wall = self.wall
        return Model(springs, ExponentialWall(wall.a, wall.V0, wall.friction))
