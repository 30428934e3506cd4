"""The scene layer: what each scene builds, what drives it, when it has ended, what it measures."""

from __future__ import annotations

from taichi_disk.errors import InputError
from taichi_disk.lattice import Lattice, disk_lattice
from taichi_disk.scene import AbsorbingWallScene, CompressionScene, Scene
from taichi_disk.scenes.setup import Setup
from taichi_disk.wall_lattice import with_wall


def build(scene: Scene, body: Lattice | None = None) -> Setup:
    """Make the initial state of `scene`. Raises InputError or SimulationError.

    `body` is its unloaded lattice where that is at hand already (see `body_of`), or one of your own with as many
    points as the scene says.
    """
    if body is None:
        body = body_of(scene)
    if body.disk_points != scene.lattice.points:
        raise InputError(f"lattice.points is {scene.lattice.points}, but the lattice given has {body.disk_points}")
    if isinstance(scene, CompressionScene):
        from taichi_disk.scenes.compression import Compression

        return Compression(scene, body)
    if isinstance(scene, AbsorbingWallScene):
        from taichi_disk.scenes.absorbing_wall import AbsorbingWall

        return AbsorbingWall(scene, body)
    from taichi_disk.scenes.exponential_wall import ExponentialWall

    return ExponentialWall(scene, body)


def body_of(scene: Scene) -> Lattice:
    """The unloaded lattice of `scene`; disk and elastic wall just touching where there is one."""
    spec = scene.lattice
    disk = disk_lattice(spec.points, spec.seed, spec.rim, spec.min_spacing)
    if isinstance(scene, AbsorbingWallScene):
        wall = scene.wall
        return with_wall(disk, wall.points, wall.width, spec.seed, spec.rim, spec.min_spacing, gap=0.0)
    return disk
