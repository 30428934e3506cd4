"""The scene layer: what each scene builds, what drives it, when it has ended, what it measures."""

from __future__ import annotations

from taichi_disk.scene import AbsorbingWallScene, CompressionScene, Scene
from taichi_disk.scenes.setup import Setup


def build(scene: Scene) -> Setup:
    """Make the lattice and the initial state of `scene`. Raises InputError or SimulationError."""
    if isinstance(scene, CompressionScene):
        from taichi_disk.scenes.compression import Compression

        return Compression(scene)
    if isinstance(scene, AbsorbingWallScene):
        from taichi_disk.scenes.absorbing_wall import AbsorbingWall

        return AbsorbingWall(scene)
    from taichi_disk.scenes.exponential_wall import ExponentialWall

    return ExponentialWall(scene)
