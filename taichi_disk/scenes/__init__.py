"""The kinds of scenes, and how one is loaded. A new kind is a file here, a member of `Scene`, and a YAML file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias, cast, get_args

from taichi_disk.config import loader
from taichi_disk.config.loader import Source, shipped_scenes
from taichi_disk.config.scene_base import SceneBase
from taichi_disk.config.sweep_axes import Sweep
from taichi_disk.scenes.absorbing_wall import AbsorbingWallScene
from taichi_disk.scenes.compression import CompressionScene
from taichi_disk.scenes.exponential_wall import ExponentialWallScene

__all__ = ["SCENES", "Scene", "Sweep", "load_any", "load_scene", "load_sweep", "shipped_scenes"]

Scene: TypeAlias = CompressionScene | ExponentialWallScene | AbsorbingWallScene
SCENES: dict[str, type[SceneBase]] = {kind.scene: kind for kind in get_args(Scene)}


def load_scene(source: Source, overrides: Sequence[str] = ()) -> Scene:
    """Read a scene and check it.

    Args:
        source: path of a YAML file, bare name of a shipped scene ("exponential_wall"), YAML text, or a mapping.
        overrides: "section.key=value" each, the value written as in YAML; the last of several wins.

    Raises:
        InputError: with every fault at once, each as file:line:column: key: what is wrong.
    """
    return cast(Scene, loader.load(source, overrides, SCENES, want="scene"))


def load_sweep(source: Source, overrides: Sequence[str] = ()) -> Sweep:
    """Read a scene with a section `sweep:` and check every scene of it; else as `load_scene`.

    "sweep.key=[...]" in `overrides` sets an axis: where `sweep:` is a list of sections, in every one.
    """
    return cast(Sweep, loader.load(source, overrides, SCENES, want="sweep"))


def load_any(source: Source, overrides: Sequence[str] = ()) -> Scene | Sweep:
    """A sweep where the source has a section `sweep:`, else a scene. The source is read once."""
    return cast("Scene | Sweep", loader.load(source, overrides, SCENES))
