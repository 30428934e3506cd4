"""A scene made ready to move in the sandbox, and the way back: the scene that `run` would have to be given."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from taichi_disk.lattice import Lattice
from taichi_disk.model.stability import Spectrum, spectrum
from taichi_disk.scene import AbsorbingWallScene, CompressionScene, Scene, least_threshold
from taichi_disk.scenes import body_of, build
from taichi_disk.scenes.setup import Setup
from taichi_disk.time_step import TimeStep, choose


@dataclass(frozen=True)
class Stage:
    """What was built from `scene`: its unloaded lattice `body`, its state at t = 0, its first step.

    `modes` bound the step for any viscosity, so that one can be added later.
    """

    scene: Scene
    body: Lattice
    setup: Setup
    modes: Spectrum
    step: TimeStep


def set_up(scene: Scene, before: Stage | None = None) -> Stage:
    """Raises TaichiDiskError. What `before` has in common with `scene` is not built again."""
    scene = _live(scene)
    same = before is not None and _body_keys(scene) == _body_keys(before.scene)
    body = before.body if before is not None and same else body_of(scene)
    setup = build(scene, body)
    modes = spectrum(setup.lattice, replace(setup.physics, eta=setup.physics.eta or 1.0))
    return Stage(scene, body, setup, modes, choose(scene.time, setup.physics, modes, setup.point_force))


def _live(scene: Scene) -> Scene:
    """`scene` without what cannot be had while it moves and any knob may be turned; so is the scene that is saved.

    That is single precision, an integrator without dashpots, a tolerance that takes several runs, and Newton's
    method, in which nothing moves in time.
    """
    plain = {"precision": "f64", "tolerance": "none"}
    if scene.time.integrator == "vefrl":
        plain["integrator"] = "auto"
    changes: dict[str, Any] = {"time": scene.time.model_copy(update=plain)}
    if isinstance(scene, CompressionScene):
        changes["compression"] = scene.compression.model_copy(update={"method": "relaxation"})
    return scene.model_copy(update=changes)


def _body_keys(scene: Scene) -> tuple[Any, ...]:
    """All that the unloaded lattice depends on."""
    wall = (scene.wall.points, scene.wall.width) if isinstance(scene, AbsorbingWallScene) else ()
    return (scene.lattice, *wall)


def with_key(scene: Scene, key: str, value: Any) -> Scene:
    """`scene` with one dotted key changed, and with it what has to follow.

    A softer contact or a slower disk needs a farther threshold; a wall has as many points on its area as the disk.
    Raises ValidationError for a value that the scene refuses.
    """
    section, name = key.split(".")
    values = scene.model_dump()
    before = values[section][name]
    values[section][name] = value
    if isinstance(scene, AbsorbingWallScene):
        wall = values["wall"]
        if key in ("wall.a", "impact.velocity") and value > 0.0:
            least = least_threshold(scene.wall.model_copy(update={"a": wall["a"]}), values["impact"]["velocity"])
            wall["threshold"] = max(wall["threshold"], float(f"{1.001 * least:.4g}"))
        if key == "lattice.points":
            wall["points"] = max(4, round(wall["points"] * value / before))
    return type(scene).model_validate(values)


def as_run(stage: Stage, scene: Scene) -> Scene:
    """`scene` with the step that is taken in the sandbox, so that `run` computes the very same numbers."""
    if scene != stage.scene:
        return scene
    dt = stage.step.dt
    between = scene.time.sample_interval
    if between != "auto" and between < dt:
        scene = with_key(scene, "time.sample_interval", dt)  # a row for every step, as here
    return with_key(with_key(scene, "time.integrator", stage.step.integrator), "time.dt", dt)
