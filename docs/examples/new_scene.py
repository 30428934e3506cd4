"""A scene of your own: a disk that is stretched, released, and vibrates. There is no
wall.

In the project: these classes in a file of taichi_disk/experiments/scenes, an entry of
    SCENES, and a YAML file in scenes/.

python docs/examples/new_scene.py
"""

from dataclasses import replace
from typing import Any, Literal

import numpy as np

from taichi_disk import Lattice, load_scene, run
from taichi_disk.experiments.computation.scenario import Array, Columns, Scenario, Words
from taichi_disk.experiments.config.sections import Section, key
from taichi_disk.experiments.scenes import SCENES
from taichi_disk.experiments.scenes.scene import DiskScene
from taichi_disk.mechanics import Model


class StretchSection(Section):
    strain: float = key(0.01, "stretch at the start", low=1e-6, high=0.1)
    time: float = key(12.0, "duration of the run", "R/c", low=1.0, high=1e3)


class RingingScene(DiskScene):
    scene: Literal["ringing"] = "ringing"
    stretch: StretchSection = StretchSection()

    def of_body(self, body: Lattice) -> "Ringing":
        s = self.stretch.strain
        return Ringing(
            scene=self,
            lattice=replace(body, positions=body.positions * [1 - s, 1 + s]),
            velocities=np.zeros_like(body.positions),
            model=Model(self.springs(body)),
            point_force=0.0,  # there is no wall
            max_time=2 * self.stretch.time,
            sample_interval=0.02,
            view=(-1.2, 1.2, -1.2, 1.2),
            # how long rows have to be within `end_bounds`, which are infinite here
            quiet_time=self.stretch.time,
        )


class Ringing(Scenario):
    def result(self, columns: Columns) -> dict[str, float]:
        t, y = columns["t"], columns["lowest_y"] - columns["lowest_y"].mean()
        up = np.flatnonzero((y[:-1] < 0) & (y[1:] >= 0))
        crossings = t[up] - y[up] * (t[up + 1] - t[up]) / (y[up + 1] - y[up])
        return {"period": float(np.diff(crossings).mean())}

    def energy_scale(self, columns: Columns) -> float:
        return float(columns["elastic"][0])

    def motion(self, columns: Columns) -> Array:
        return columns["lowest_y"]

    @property
    def words(self) -> Words:
        scene = self.scene
        return Words(
            title=("Ringing", scene.damping, scene.described(self.lattice)),
            labels={"period": ("period of the lowest mode", "R/c")},
            motion="lowest point  [R]",
        )


SCENES["ringing"] = RingingScene
scene: Any = load_scene(
    "scene: ringing\nmaterial: {eta_star: 0}\nlattice: {points: 400}\n"
)
period = run(scene).numbers["period"]
print(f"the lowest mode of 400 points has the period {period:.3f} R/c")
