"""Changes by hand to a moving disk: what its state, its equations and its energy become."""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.model.physics import Physics
from taichi_disk.model.stability import contact_point_force, impact_point_force
from taichi_disk.model.sums import PEAK
from taichi_disk.scene import AbsorbingWallScene, CompressionScene, Scene
from taichi_disk.scenes import build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.impact import Impact
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
    if isinstance(setup, Impact) and not isinstance(scene, CompressionScene):
        positions = _out_of_reach(motion, setup, scene)
    before = motion.ledger.given()
    go_on(motion, scene, physics, setup, positions, motion.velocities)
    given = motion.ledger.given() - before
    if abs(given) < 1e-3 * motion.scale:
        return ""
    return f"that gave the disk {given:+.2e} M c^2 at once: the potential changed where it stands"


def _out_of_reach(motion: Motion, setup: Impact, scene: Any) -> NDArray[np.float64]:
    """A softer wall reaches farther: the end of the scene, and a disk that has not touched it, lie farther off."""
    n, positions = setup.lattice.disk_points, motion.positions
    y = positions[:n, 1]
    setup.scene = scene
    if scene.impact.gap == "auto":
        setup.gap = setup.default_gap(y - y.min())
    if motion.flying_in and y.min() < setup.gap:
        positions = positions.copy()
        positions[:n, 1] += setup.gap - y.min()
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
    peak = float(motion.state.sums[PEAK].max())
    if peak > 0.0:
        # At the distance where one point took F = a V0 exp(-a l), another a may push harder.
        before = motion.world.physics
        near = np.log(before.a * before.V0 / peak) / before.a
        force = max(force, float(physics.a * physics.V0 * np.exp(-physics.a * near)))
    motion.change(physics, scene.time, force, setup, positions, velocities)
