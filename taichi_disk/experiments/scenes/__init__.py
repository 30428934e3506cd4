"""The kinds of scenes, how one is loaded, and whether it can be computed.

A new kind needs a file here, a place in `Scene`, and a file with its defaults in the
folder `scenes` of the project.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias, get_args

from taichi_disk.experiments.config.tree import (
    Source,
    Tree,
    read_tree,
    shipped_scenes as shipped_scenes,
)
from taichi_disk.experiments.scenes.absorbing_wall import AbsorbingWallScene
from taichi_disk.experiments.scenes.compression import CompressionScene
from taichi_disk.experiments.scenes.exponential_wall import ExponentialWallScene
from taichi_disk.experiments.scenes.scene import DiskScene, check
from taichi_disk.experiments.scenes.sweep_axes import Sweep, check_sweep

Scene: TypeAlias = CompressionScene | ExponentialWallScene | AbsorbingWallScene
SCENES: dict[str, type[DiskScene]] = {kind.scene: kind for kind in get_args(Scene)}


def load_scene(source: Source, overrides: str | Sequence[str] = ()) -> Scene:
    """Read a scene and check it.

    Args:
        source: path of a YAML file, bare name of a shipped scene ("exponential_wall"),
            YAML text, or a mapping.
        overrides: "section.key=value", one or several, with the value as in YAML; the
            last one for a key applies.

    Raises:
        InputError: lists all faults, each as file:line:column: key: what is wrong.
    """
    tree = read_tree(source, overrides)
    if "sweep" in tree.value:
        what = (
            "this scene has a sweep: compute it with `taichi-disk sweep`, or leave this"
            " section out"
        )
        tree.fault(tree.entries[("sweep",)].key, ("sweep",), what)
    return _checked(tree)


def load_sweep(source: Source, overrides: str | Sequence[str] = ()) -> Sweep:
    """Read a scene with a section `sweep:` and check all its scenes. Arguments and
    errors are those of `load_scene`.

    "sweep.key=[...]" in `overrides` sets the values of an axis. If `sweep:` is a list
    of sections, it sets the axis in each of them.
    """
    tree = read_tree(source, overrides)
    if "sweep" not in tree.value:
        what = (
            "there is no sweep: section: compute a single scene with `taichi-disk run`,"
            " or add one, for example `sweep: {seed: {range: 8}}`"
        )
        tree.fault(tree.entries[()].value, (), what)
    return _checked(tree)


def load_any(source: Source, overrides: str | Sequence[str] = ()) -> Scene | Sweep:
    return _checked(read_tree(source, overrides))


def _checked(tree: Tree) -> Any:
    """Return the scene or the sweep of a tree."""
    if "sweep" in tree.value:
        found: Any = check_sweep(tree, SCENES)
    else:
        found = check(tree, SCENES)
    tree.refuse()
    return found


def check_feasible(scene: Scene | Sweep) -> None:
    """Raise InputError if `run` would, because of the lattice or a step beyond the
    stability limit.

    Only the first scene of a sweep is checked. The lattice is built only to check a
    user's step.
    """
    if isinstance(scene, Sweep):
        return check_feasible(scene.scenes[0])
    spec = scene.lattice
    points = spec.points
    if (spec.file, spec.outline) != ("none", "none"):
        points = scene.body().disk_points
    scene.check_wall(points)
    if scene.time.dt == "auto":
        return
    from taichi_disk.experiments.computation.stability import spectrum
    from taichi_disk.experiments.computation.step_control import StepControl

    scenario = scene.scenario()
    if not scenario.static:
        StepControl(scenario, spectrum(scenario.lattice, scenario.model))
