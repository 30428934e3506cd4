"""Changes by hand to a moving disk: what its state, its equations and its energy become."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import contact_point_force, impact_point_force
from taichi_disk.model.sums import PEAK
from taichi_disk.scene import AbsorbingWallScene, CompressionScene, ExponentialWallScene, Scene
from taichi_disk.scenes import build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.impact import Impact
from taichi_disk.scenes.setup import Setup
from taichi_disk.view.motion import Motion

AT_ONCE = ("material.eta_star", "wall.a", "wall.boundary", "compression.pressure")  # keys that `turn_knobs` turns


def turn_knobs(motion: Motion, scene: Scene) -> str:
    """Go on with the equations of `scene`; returns what a person should know. Raises TaichiDiskError."""
    setup, physics, positions = copy(motion.setup), motion.world.physics, motion.positions
    physics = replace(physics, eta=scene.material.eta_star / scene.lattice.points, a=scene.wall.a)
    if isinstance(scene, CompressionScene) and isinstance(setup, Compression):
        setup.scene, setup.pressure = scene, scene.compression.pressure
        physics = replace(physics, load=scene.compression.pressure)
    if isinstance(scene, AbsorbingWallScene):
        physics = replace(physics, threshold=scene.wall.threshold)
        if scene.wall.boundary != physics.boundary:
            wall = build(scene, motion.stage.body).physics  # its dashpots' constants take a test of its stiffness
            physics = replace(
                physics, boundary=wall.boundary, reset_interval=wall.reset_interval, impedance=wall.impedance
            )
    if physics.a != motion.world.physics.a:
        if isinstance(setup, Impact) and isinstance(scene, ExponentialWallScene | AbsorbingWallScene):
            setup.scene = scene
            if scene.impact.gap == "auto":
                y = setup.lattice.positions[: setup.lattice.disk_points, 1]
                setup.gap = setup.default_gap(y - y.min())
        positions = _lifted(motion, setup, physics)
        left, right, bottom, top = setup.view
        setup.view = left, right, bottom, max(top, float(positions[:, 1].max()) + 0.05)
    lift = float(positions[0, 1] - motion.positions[0, 1])
    go_on(motion, scene, physics, setup, positions, motion.velocities)
    return f"disk moved up by {lift:+.3f} R: there this wall pushes as the other did" if lift else ""


def _lifted(motion: Motion, setup: Setup, physics: Physics) -> NDArray[np.float64]:
    """The positions from which a wall of another hardness pushes as strongly as the one before.

    Where V0 stays, a softer wall reaches farther: left where it is, a disk in contact would be shot away. With a flat
    wall a height has no meaning of its own; with the elastic one, distances to it are taken upright.
    """
    before, n, positions = motion.world.physics, setup.lattice.disk_points, motion.positions
    distances = positions[:n, 1]
    if physics.wall == "elastic":
        x, y = positions[setup.lattice.wall_surface].T
        surface = positions[setup.lattice.disk_surface]
        distances = surface[:, 1] - np.interp(surface[:, 0], x, y)
    if isinstance(setup, Impact) and isinstance(motion.setup, Impact):
        if distances.min() >= max(setup.gap, motion.setup.gap):  # out of reach of either
            return positions
    force = [logsumexp(-one.a * distances) + np.log(one.a * one.V0) for one in (before, physics)]
    positions = positions.copy()
    positions[:n, 1] += (force[1] - force[0]) / physics.a
    return positions


def throw(motion: Motion, scene: Any) -> None:
    """Give the disk's centre of mass the velocity of the impact `scene` at once; what shakes goes on shaking."""
    setup, velocity = copy(motion.setup), scene.impact.velocity
    assert isinstance(setup, Impact)
    n, velocities = setup.lattice.disk_points, motion.velocities.copy()
    velocities[:n] += np.array([0.0, -velocity]) - velocities[:n].mean(axis=0)
    setup.velocity, setup.kinetic = velocity, 0.5 * velocity**2
    go_on(motion, scene, motion.world.physics, setup, motion.positions, velocities)


def go_on(
    motion: Motion,
    scene: Scene,
    physics: Physics,
    setup: Any,
    positions: NDArray[np.float64],
    velocities: NDArray[np.float64],
) -> None:
    """`Motion.change`, with the step that wall and velocity ask for from here on."""
    if isinstance(setup, Impact):
        force = impact_point_force(setup.lattice, physics, setup.velocity)
    else:
        force = contact_point_force(setup.lattice, physics, 2.0 * physics.load)
    force = max(force, float(motion.state.sums[PEAK].max()))
    motion.change(physics, scene.time, force, setup, positions, velocities)
