"""How smoothly the window of `taichi-disk view` moves: the real one, with nobody at it."""

from __future__ import annotations

import multiprocessing
import tempfile
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path
from statistics import median, quantiles

SCENES = (
    ("compression",),
    ("exponential_wall",),
    ("absorbing_wall",),
    ("exponential_wall", "lattice.points=4400"),
    ("exponential_wall", "lattice.points=20000"),
)
WARM_UP, WATCHED = 2.0, 6.0  # seconds


def window(_repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Pictures and steps a second, of the shipped scenes and two larger disks."""
    from taichi_disk.window.app import window_problem

    if problem := window_problem():
        yield f"window: not measured: {problem}"
        return
    yield f"{'the window':<46}{'pictures/s':>12}{'slowest 1 %':>13}{'steps/s':>10}"
    for scene, *own in SCENES:
        given = (*own, *settings)
        name = " ".join((scene, *given))
        # One process each, because GLFW ends a process that it finds no window for.
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            try:
                seconds, steps = process.submit(watch, scene, given).result()
            except BrokenProcessPool:
                yield f"  {name}: not measured: the window's process died"
                continue
        slowest = quantiles(seconds, n=100)[-1]
        yield f"  {name:<44}{1 / median(seconds):12.1f}{1 / slowest:13.1f}{steps / sum(seconds):10,.0f}"


def watch(scene: str, settings: tuple[str, ...]) -> tuple[list[float], int]:
    """Seconds between the pictures of a window, and the steps made for them; what has ended begins again."""
    from taichi_disk import runtime

    runtime.start()
    from taichi_disk.scenes import load_scene
    from taichi_disk.window.app import presets, screen
    from taichi_disk.window.viewer import Viewer

    seconds, steps, clock = [], 0, 0.0
    with tempfile.TemporaryDirectory() as folder:
        viewer = Viewer(presets(load_scene(scene, settings)), Path(folder), screen(), fastest=1000)
        pictures = viewer.pictures()
        for elapsed, made in pictures:
            clock += elapsed
            if clock > WARM_UP:
                seconds.append(elapsed)
                steps += made
            if clock > WARM_UP + WATCHED:
                break
            if viewer.sandbox.paused:
                viewer.sandbox.begin()
                viewer.sandbox.pause()
        pictures.close()
    return seconds, steps
