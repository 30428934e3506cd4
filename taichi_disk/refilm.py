"""Filming finished runs again: computed anew from their scene.yaml, their results untouched."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from typing import Any

from taichi_disk.dynamics import move
from taichi_disk.errors import InputError, SimulationError
from taichi_disk.film import film, frame_count, still, strain_limit
from taichi_disk.model import runtime
from taichi_disk.model.stability import spectrum
from taichi_disk.outcome import Outcome
from taichi_disk.output import atomic_write, prepare_output
from taichi_disk.progress import Progress
from taichi_disk.quasistatic import press
from taichi_disk.render.film import require_film
from taichi_disk.render.video import FORMATS
from taichi_disk.scene import Scene
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build
from taichi_disk.scenes.compression import Compression
from taichi_disk.scenes.setup import Setup
from taichi_disk.time_step import choose


def film_again(folders: list[Path], out: Path, options: dict[str, Any], progress: Progress) -> None:
    """Film the run in each folder of `folders`, two of them side by side, into `out`.

    `out`: .mp4, .webm, .gif, or, for a single run, .png: the moment of the largest elastic energy.
    `options`: keys of a scene's `video` section, in place of what the scene says. Two films show the same
    times and the same scale of colours. Raises InputError for what is not a run or not a format.
    """
    allowed = (*FORMATS, ".png") if len(folders) == 1 else FORMATS
    if out.suffix not in allowed:
        raise InputError(f"cannot film into {out}: end the name with one of {', '.join(allowed)}")
    scenes = [_scene_of(folder, options) for folder in folders]
    require_film(scenes[0].video.size)
    prepare_output(out.parent)
    runtime.start("cpu")
    runs = [_compute(scene, progress) for scene in scenes]
    video = scenes[0].video
    if out.suffix == ".png":
        still(out, *runs[0], video.size)
        return
    longest, outcome = max(runs, key=lambda one: float(one[1].columns["t"][-1]))
    times = longest.frame_times(outcome.columns, frame_count(video))
    limit = max(strain_limit(*one) for one in runs)
    with tempfile.TemporaryDirectory() as folder:
        parts = [Path(folder, f"{number}.mp4") for number in range(len(runs))] if len(runs) > 1 else [out]
        for part, one in zip(parts, runs, strict=True):
            film(part, *one, video, progress, times=times, limit=limit)
        if len(runs) > 1:
            atomic_write(out, lambda beside: _join(parts, beside))


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
    step = choose(scene.time, setup.physics, modes, setup.point_force, force=True)
    return setup, move(setup, scene.time, modes, step, progress)


def _join(parts: list[Path], out: Path) -> None:
    """Set two films side by side. Raises SimulationError if ffmpeg fails."""
    import imageio_ffmpeg

    from taichi_disk.render.video import encoding

    inputs = [word for part in parts for word in ("-i", str(part))]
    filters = encoding(out.suffix)
    at = filters.index("-vf")
    graph = f"[0:v][1:v]hstack[w];[w]{filters[at + 1]}"
    rest = (*filters[:at], *filters[at + 2 :])
    command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-y", *inputs, "-filter_complex", graph, *rest, str(out)]
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode:
        raise SimulationError(f"ffmpeg could not write the comparison: {done.stderr.strip()}")
