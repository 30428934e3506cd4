"""Impact on the elastic wall that absorbs energy at its sides and bottom (paper section 5, figures 4 to 6)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import impact_point_force
from taichi_disk.moduli import bulk_moduli
from taichi_disk.scene import AbsorbingWallScene
from taichi_disk.scenes.impact import Impact


class AbsorbingWall(Impact):
    scene: AbsorbingWallScene

    def __init__(self, scene: AbsorbingWallScene, body: Lattice) -> None:
        super().__init__(scene)
        spec, wall, material = scene.lattice, scene.wall, scene.material
        surface = body.positions[body.disk_surface, 1]
        gap = scene.impact.gap
        self.gap = self.default_gap(surface - surface.min()) if gap == "auto" else gap
        positions = body.positions.copy()
        positions[: body.disk_points, 1] += self.gap - surface.min()
        self.lattice = replace(body, positions=positions)
        self.velocities = np.zeros_like(self.lattice.positions)
        self.velocities[: spec.points, 1] = -self.velocity
        self.physics = Physics(
            k_a=material.k_a,
            k_b=material.k_b,
            eta=material.eta_star / spec.points,
            wall="elastic",
            a=wall.a,
            V0=wall.V0,
            threshold=wall.threshold,
            boundary=wall.boundary,
            reset_interval=wall.reset_interval if wall.boundary == "reset" else 0.0,
            impedance=self._impedance() if wall.boundary == "dashpot" else np.zeros((0, 2)),
        )
        self.point_force = impact_point_force(body, self.physics, self.velocity)
        limit = scene.impact.max_time
        self.max_time = self.default_max_time(self.gap) if limit == "auto" else limit
        half = 0.5 * wall.width
        depth = -float(self.lattice.positions[:, 1].min())
        self.view = (min(-half, -1.1) - 0.05, max(half, 1.1) + 0.05, -depth - 0.05, 2.0 + self.gap)

    def _impedance(self) -> NDArray[np.float64]:
        """Matched dashpots Z = rho c_p and rho c_s times the tributary length (Lysmer & Kuhlemeyer 1969)."""
        spec, material = self.scene.lattice, self.scene.material
        moduli = bulk_moduli(spec.points, spec.seed, material.k_a, spec.min_spacing)
        return boundary_impedance(
            self.lattice,
            moduli.density * moduli.wave_speed_p,
            moduli.density * moduli.wave_speed_s,
        )

    def title(self) -> tuple[str, ...]:
        _, first, second = super().title()
        boundary: str = self.scene.wall.boundary
        if boundary == "reset":
            boundary = f"reset every {self.scene.wall.reset_interval:g} R/c"
        return (
            "Impact on an elastic wall",
            first,
            f"{second}    wall of {self.scene.wall.points:,}, boundary: {boundary}",
        )


def boundary_impedance(lattice: Lattice, normal: float, tangential: float) -> NDArray[np.float64]:
    """(k, 2) dashpot constants [M c/R] of the chain `wall_boundary`, which runs left, bottom, right.

    Args:
        normal, tangential: rho c_p and rho c_s of the wall [M c/R^2].

    Half of each chain segment belongs to each of its ends; a segment's normal takes Z_p, its direction Z_s.
    """
    chain = lattice.positions[lattice.wall_boundary]
    segment = np.diff(chain, axis=0)
    length = np.hypot(segment[:, 0], segment[:, 1])
    direction = (segment / length[:, None]) ** 2
    z = 0.5 * length[:, None] * (normal * direction[:, ::-1] + tangential * direction)
    impedance = np.zeros_like(chain)
    impedance[:-1] += z
    impedance[1:] += z
    return impedance
