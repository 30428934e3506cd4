"""Changes by hand to a disk: what its scene, its laws and its state become."""

from __future__ import annotations

from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import numpy as np

from taichi_disk.config.scene_base import least_threshold
from taichi_disk.lattice import Array, Lattice
from taichi_disk.physics import MouseSpring, Springs
from taichi_disk.scenes import Scene
from taichi_disk.scenes.absorbing_wall import AbsorbingWallScene
from taichi_disk.scenes.compression import CompressionScene
from taichi_disk.simulation.scenario import Scenario
from taichi_disk.simulation.stability import Spectrum, spectrum

AT_ONCE = (
    "material.eta_star",
    "material.viscosity",
    "wall.boundary",
    "compression.pressure",
)  # keys that need no new start
STIFFNESS = 0.2  # of the mouse's spring, in k_a
STRONGEST = 0.02  # its largest pull, in k_a R: more would turn triangles of a fine lattice inside out


def push_of(scene: Scene) -> float:
    """The velocity of an impact [c], the force of a compression [M c^2/R]."""
    return float(attrgetter(".".join(scene.abscissa))(scene))


def with_key(scene: Scene, key: str, value: Any) -> Scene:
    """`scene` with one dotted key changed, and with it what has to follow.

    A softer contact or a slower disk needs a farther threshold; a wall has as many points on its area as the disk. With
    other points the body stays as viscous as it is.
    Raises InputError for a value that the scene refuses.
    """
    changes = {key: value} | (scene.keeping_the_body() if key == "lattice.points" else {})
    if isinstance(scene, AbsorbingWallScene):
        if key in ("wall.a", "impact.velocity"):
            wall = replace(scene.wall, a=value) if key == "wall.a" else scene.wall
            least = least_threshold(wall, scene.impact.velocity if key == "wall.a" else value)
            changes["wall.threshold"] = max(wall.threshold, float(f"{1.001 * least:.4g}"))
        if key == "lattice.points":
            changes["wall.points"] = max(4, round(scene.wall.points * value / scene.lattice.points))
    return scene.with_(changes)


@dataclass(frozen=True)
class Start:
    """A scene at t = 0, ready for a hand: its unloaded lattice, the scenario with a mouse spring, its spectrum."""

    scene: Scene
    body: Lattice
    scenario: Scenario
    spectrum: Spectrum


def start_of(scene: Scene, before: Start | None = None) -> Start:
    """`before`: what it has in common with the scene is not computed again. Raises TaichiDiskError."""
    if isinstance(scene, CompressionScene):  # nothing moves in time in Newton's method
        scene = scene.with_({"compression.method": "relaxation"})
    if before is None or _of_the_body(scene) != _of_the_body(before.scene):
        body, known = scene.body(), None
    else:
        body, known = before.body, before
    scenario = with_mouse(scene, body)
    lattice, springs = scenario.lattice, scenario.model.springs
    if known and np.array_equal(known.scenario.lattice.positions, lattice.positions):
        return Start(scene, body, scenario, known.spectrum)
    # Dashpots may come later: their rates belong to it in any case.
    damped = replace(scenario.model, springs=Springs(springs.k_a, springs.k_b, eta=1.0))
    return Start(scene, body, scenario, spectrum(lattice, damped))


def _of_the_body(scene: Scene) -> tuple[Any, ...]:
    """All that the unloaded lattice and its spectrum depend on."""
    return scene.material.k_a, attrgetter(*scene.lattice_keys)(scene)


def with_mouse(scene: Scene, body: Lattice) -> Scenario:
    """The scene at t = 0 with a mouse spring that rests; `body`: its unloaded lattice."""
    scenario = scene.scenario(body)
    k_a = scene.material.k_a
    scenario.model = replace(scenario.model, mouse=MouseSpring(STIFFNESS * k_a, STRONGEST * k_a))
    return scenario


def continued(scene: Scene, body: Lattice, x: Array, v: Array, force: float) -> Scenario:
    """The laws of `scene`, beginning with the positions `x` (n, 2) [R] and velocities `v` (n, 2) [c] of now.

    `force`: largest force of the wall on a point that was measured [M c^2/R].
    """
    scenario = with_mouse(scene, body)
    scenario.lattice, scenario.velocities = replace(scenario.lattice, positions=x), v
    scenario.point_force = max(scenario.point_force, force)
    return scenario
