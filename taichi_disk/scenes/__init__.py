"""The kinds of scenes, and how one is loaded. A new kind is a file here and an entry of SCENES."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias, cast

from taichi_disk.config.scene_base import SceneBase, check
from taichi_disk.config.sweep_axes import Sweep, check_sweep
from taichi_disk.config.tree import Source, read_tree, shipped_scenes
from taichi_disk.scenes.absorbing_wall import AbsorbingWallScene
from taichi_disk.scenes.compression import CompressionScene
from taichi_disk.scenes.exponential_wall import ExponentialWallScene

__all__ = ["SCENES", "Scene", "Sweep", "load_any", "load_scene", "load_sweep", "shipped_scenes"]

Scene: TypeAlias = CompressionScene | ExponentialWallScene | AbsorbingWallScene
SCENES: dict[str, type[SceneBase]] = {
    "compression": CompressionScene,
    "exponential_wall": ExponentialWallScene,
    "absorbing_wall": AbsorbingWallScene,
}


def load_scene(source: Source, overrides: Sequence[str] = ()) -> Scene:
    """Read a scene and check it.

    Args:
        source: path of a YAML file, bare name of a shipped scene ("exponential_wall"), YAML text, or a mapping.
        overrides: "section.key=value" each, the value written as in YAML; the last of several wins.

    Raises:
        InputError: with every fault at once, each as file:line:column: key: what is wrong.
    """
    return cast(Scene, _load(source, overrides, "scene"))


def load_sweep(source: Source, overrides: Sequence[str] = ()) -> Sweep:
    """Read a scene with a section `sweep:` and check every scene of it; else as `load_scene`.

    "sweep.key=[...]" in `overrides` sets an axis: where `sweep:` is a list of sections, in every one.
    """
    return cast(Sweep, _load(source, overrides, "sweep"))


def load_any(source: Source, overrides: Sequence[str] = ()) -> Scene | Sweep:
    """A sweep where the source has a section `sweep:`, else a scene. The source is read once."""
    return cast("Scene | Sweep", _load(source, overrides))


def _load(source: Source, overrides: Sequence[str], want: str = "any") -> SceneBase | Sweep:
    tree = read_tree(source, overrides)
    has_sweep = "sweep" in tree.value
    if has_sweep and want == "scene":
        what = "this scene has a sweep: compute it with `taichi-disk sweep`, or leave this section out"
        tree.fault(tree.entries[("sweep",)].key, ("sweep",), what)
    if not has_sweep and want == "sweep":
        what = "there is no sweep: section: compute a single scene with `taichi-disk run`, or add one, for example "
        tree.fault(tree.entries[()].value, (), what + "`sweep: {seed: {range: 8}}`")
    found = check_sweep(tree, SCENES) if has_sweep else check(tree, SCENES)
    tree.refuse()
    assert found is not None
    return found
