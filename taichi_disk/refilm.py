"""Filming finished runs again: computed anew from their scene.yaml, their results untouched."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from taichi_disk.dynamics import move
from taichi_disk.errors import InputError
from taichi_disk.film import film, still
from taichi_disk.model import runtime
from taichi_disk.model.stability import spectrum
from taichi_disk.outcome import Outcome
from taichi_disk.output import check_pictures, prepare_output
from taichi_disk.progress import Progress
from taichi_disk.quasistatic import press
from taichi_disk.render.film import require_film
from taichi_disk.scene import CompressionScene, Scene
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.setup import Setup

ALLOWED = (".mp4", ".webm", ".gif", ".png", "")


def film_again(folders: list[Path], out: Path | None, options: dict[str, Any], progress: Progress) -> Path:
    """Film the run in each folder of `folders`, side by side, into `out`; returns where the film is.

    `out`: .mp4, .webm, .gif, a folder for numbered pictures, or .png for one picture of the moment of the largest
    elastic energy; by default in the first folder. `options`: keys of a scene's `video` section, in place of what
    the scene says. Raises InputError for what is not a run or not a format.
    """
    if out is not None and "format" in options:
        raise InputError("--out and --format: the name after --out says the format already")
    if out is not None and out.suffix not in ALLOWED:
        raise InputError(f"cannot film into {out}: end the name with one of {', '.join(ALLOWED)}, or with none")
    scenes = [_scene_of(folder, options) for folder in folders]
    if len({_kind(scene) for scene in scenes}) > 1:
        raise InputError(f"cannot compare {' with '.join(map(_kind, scenes))}: they have no time in common")
    video = scenes[0].video
    if out is None:
        name = "comparison" if len(folders) > 1 else "render"
        out = folders[0] / (name if video.format == "png" else f"{name}.{video.format}")
    require_film(video.size)
    prepare_output(out.parent)
    if not out.suffix:
        check_pictures(out)
    single = all(scene.time.precision == "f32" for scene in scenes)
    runtime.start("cpu", precision="f32" if single else "f64")
    runs = [_compute(scene, progress) for scene in scenes]
    if out.suffix == ".png":
        still(out, runs, video)
    else:
        film(out, runs, video, progress)
    return out


def _kind(scene: Scene) -> str:
    return f"a {scene.compression.method} compression" if isinstance(scene, CompressionScene) else "an impact"


def _scene_of(folder: Path, options: dict[str, Any]) -> Scene:
    path = folder / "scene.yaml"
    if not path.is_file():
        raise InputError(f"{folder}: no run is here (no scene.yaml); make one with `taichi-disk run --out {folder}`")
    return load_scene(path, [f"video.{name}={value}" for name, value in options.items()])


def _compute(scene: Scene, progress: Progress) -> tuple[Setup, Outcome]:
    setup = build(scene)
    if isinstance(setup, Compression) and setup.scene.compression.method == "newton":
        return setup, press(setup)
    modes = spectrum(setup.lattice, setup.physics)
    # The run was made: what it took, also a step by force, is taken again.
    return setup, move(setup, scene.time, modes, progress, force=True)
