"""What is timed: a whole impact, so specified that another program can repeat it step by step."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from taichi_disk.dynamics import move
from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import spectrum
from taichi_disk.progress import QuietProgress
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build


@dataclass(frozen=True)
class Task:
    """An impact from its start to its end, by `steps` steps of `dt` [R/c].

    `velocities` (lanes, n, 2) [c] at t = 0; `limit` is the stability limit with the wall's force that was met [R/c].
    """

    lattice: Lattice
    physics: Physics
    velocities: NDArray[np.float64]
    dt: float
    limit: float
    steps: int

    @property
    def work(self) -> int:
        """Springs times steps times lanes."""
        return len(self.lattice.bonds) * self.steps * len(self.velocities)

    def restitution(self, velocities: NDArray[np.float64]) -> float:
        """e = -v_cm(after)/v_cm(before) of the first lane from velocities (n, 2) at the end."""
        disk = self.lattice.disk_points
        return float(velocities[:disk, 1].mean() / -self.velocities[0, :disk, 1].mean())

    def in_lanes(self, lanes: int) -> Task:
        """The same with `lanes` disks side by side, whose speeds differ by up to 10 %, as a sweep's do."""
        factors = np.linspace(1.0, 1.1, lanes)[:, None, None]
        return replace(self, velocities=factors * self.velocities[:1])


def impact(scene: str, *settings: str) -> Task:
    """A shipped scene of an impact with some settings, at the step that a run takes. Taichi has to be started."""
    loaded = load_scene(scene, settings)
    setup = build(loaded)
    modes = spectrum(setup.lattice, setup.physics)
    facts = move(setup, loaded.time, modes, QuietProgress()).facts
    physics = replace(setup.physics, integrator=facts["integrator"])
    return Task(setup.lattice, physics, setup.velocities[None], facts["dt"], facts["dt_limit"], facts["steps"])
