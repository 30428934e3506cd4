"""Small bodies and worlds that several test modules use."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.model.physics import Physics
from taichi_disk.wall_lattice import with_wall

if TYPE_CHECKING:
    from taichi_disk.view.worlds import Worlds

A, V0 = 300.0, 150.0


def disk(points: int = 100, seed: int = 0, height: float | None = None) -> Lattice:
    """A disk, its lowest point at y = `height` where that is given."""
    lattice = disk_lattice(points, seed)
    if height is None:
        return lattice
    lift = height - lattice.positions[:, 1].min()
    return replace(lattice, positions=lattice.positions + np.array([0.0, lift]))


def disk_and_wall(points: int = 100, wall: int = 120, seed: int = 0, height: float = 0.03) -> Lattice:
    return with_wall(disk_lattice(points, seed), wall, 3.0, seed, True, 0.7, height)


def by_hand(positions: list[tuple[float, float]], bonds: list[tuple[int, int]], mass: float) -> Lattice:
    """A lattice of a few points, all of them disk and surface, unloaded at `positions`."""
    x = np.array(positions)
    ends = np.array(bonds, np.int32)
    n, none = len(x), np.zeros(0, np.int32)
    rest = np.hypot(*(x[ends[:, 0]] - x[ends[:, 1]]).T)
    return Lattice(x, ends, rest, np.full(n, mass), n, np.arange(n, dtype=np.int32), none, none)


def moving_down(lattice: Lattice, speed: float) -> np.ndarray:
    """(1, n, 2): the disk's velocities -`speed` in y; a wall is at rest."""
    v = np.zeros((1, len(lattice.positions), 2))
    v[0, : lattice.disk_points, 1] = -speed
    return v


def again(world, positions: np.ndarray, velocities: np.ndarray, dt: float | None = None) -> None:
    """Start `world` afresh from (lanes, n, 2) positions and velocities, with the kernels it has (compiling is slow)."""
    placed = np.broadcast_to(positions, velocities.shape).copy()
    assert world.restart(world.lattice, world.physics, velocities, dt or world.dt, positions=placed)


def matched(lattice: Lattice, physics: Physics) -> Physics:
    """`physics` with some plausible, unequal dashpots on the wall's boundary."""
    k = len(lattice.wall_boundary)
    z = np.random.default_rng(5).uniform(0.02, 0.05, (k, 2))
    return replace(physics, boundary="dashpot", impedance=z)


def computed(name: str, *settings: str, kept: Worlds | None = None):
    """A shipped scene with some `settings`, stepped to its end without files: (setup, outcome).

    `kept`: compiled worlds to take from, and to leave new ones in.
    """
    from taichi_disk import load_scene
    from taichi_disk.dynamics import move
    from taichi_disk.model.stability import spectrum
    from taichi_disk.progress import QuietProgress
    from taichi_disk.scenes import build
    from taichi_disk.simulate import make_world

    scene = load_scene(name, settings)
    setup = build(scene)
    modes = spectrum(setup.lattice, setup.physics)
    make = make_world
    if kept is not None:

        def make(setup, step, earlier):
            physics = replace(setup.physics, integrator=step.integrator)
            return kept.start(setup.lattice, physics, setup.velocities, step.dt)

    return setup, move(setup, scene.time, modes, QuietProgress(), make)
