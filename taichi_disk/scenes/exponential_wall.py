"""Impact on the rigid exponential wall (paper section 4, eq. 6, figure 3)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import impact_point_force
from taichi_disk.scene import ExponentialWallScene
from taichi_disk.scenes.impact import Impact


class ExponentialWall(Impact):
    scene: ExponentialWallScene

    def __init__(self, scene: ExponentialWallScene, disk: Lattice) -> None:
        super().__init__(scene)
        spec, material = scene.lattice, scene.material
        heights = disk.positions[:, 1] - disk.positions[:, 1].min()
        self.gap = self.default_gap(heights) if scene.impact.gap == "auto" else scene.impact.gap
        lift = self.gap - disk.positions[:, 1].min()
        self.lattice = replace(disk, positions=disk.positions + np.array([0.0, lift]))
        self.velocities = np.tile([0.0, -self.velocity], (spec.points, 1))
        self.physics = Physics(
            k_a=material.k_a,
            k_b=material.k_b,
            eta=material.eta_star / spec.points,
            wall="rigid",
            a=scene.wall.a,
            V0=scene.wall.V0,
        )
        self.point_force = impact_point_force(self.lattice, self.physics, self.velocity)
        limit = scene.impact.max_time
        self.max_time = self.default_max_time(self.gap) if limit == "auto" else limit
        self.view = (-1.1, 1.1, -0.1, 2.0 + self.gap)
