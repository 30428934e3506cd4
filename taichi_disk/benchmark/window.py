"""How smoothly the window of `taichi-disk view` moves: the real one, with nobody at it."""

from __future__ import annotations

import multiprocessing
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from taichi_disk.benchmark.stopwatch import Timing
from taichi_disk.view.display import window_problem

PART = "window"
SCENES = ("compression", "exponential_wall", "absorbing_wall")  # as they are shipped
LARGER = (4_400, 20_000)  # points of exponential_wall
WARM_UP, WATCHED = 2.0, 6.0  # seconds


@dataclass(frozen=True)
class Watched:
    """What a window did: seconds between its pictures, the steps made in them, and time in the scene, as seen [R/c].

    `speed`: simulated time per second of the clock that was asked for [R/c per s].
    """

    seconds: list[float]
    steps: int
    passed: float
    speed: float

    @property
    def frames(self) -> float:
        """Pictures per second, the median."""
        return 1.0 / float(np.median(self.seconds))

    @property
    def slowest(self) -> float:
        """Pictures per second of the slowest hundredth."""
        return 1.0 / float(np.percentile(self.seconds, 99.0))

    @property
    def steps_per_second(self) -> float:
        return self.steps / sum(self.seconds)

    @property
    def pace(self) -> float:
        """The speed at which time passed, over the one asked for."""
        return self.passed / sum(self.seconds) / self.speed


def measure() -> tuple[list[Timing], list[str]]:
    """Seconds of every picture, case by case, and what to print of them; none, and why, where no window opens."""
    if problem := window_problem():
        return [], [f"window: not measured: {problem}"]
    cases = {scene: (scene, 1099) for scene in SCENES}
    cases |= {name_of(points): (SCENES[1], points) for points in LARGER}
    timings: list[Timing] = []
    watched: dict[str, Watched] = {}
    absent: list[str] = []
    for name, (scene, points) in cases.items():
        # One process each, because GLFW ends a process that it finds no window for.
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            try:
                watched[name] = process.submit(watch, scene, [f"lattice.points={points}"], WARM_UP, WATCHED).result()
            except BrokenProcessPool:
                absent.append(f"  {name}: not measured: the window's process died")
                continue
        seconds = watched[name].seconds
        timings.append(Timing(PART, name, 1, seconds, seconds, points=points))
    return timings, [*table(watched), *absent]


def name_of(points: int) -> str:
    return f"{SCENES[1]}, {points:,} points"


def watch(scene: str, settings: Sequence[str], warm_up: float, seconds: float) -> Watched:
    """Open a window of the usual size and look at it for `seconds`, after `warm_up`. What has ended begins again."""
    from taichi_disk.model import runtime
    from taichi_disk.scene_file import load_scene
    from taichi_disk.view.window import Viewer

    runtime.start("cpu")
    times: list[float] = []
    steps, passed, clock, before = 0, 0.0, 0.0, 0.0
    with TemporaryDirectory() as folder:
        viewer = Viewer(load_scene(scene, settings), Path(folder))
        pictures = viewer.pictures()
        for elapsed, made in pictures:
            motion = viewer.sandbox.motion
            # What is made again with a shorter step passes unseen until it has caught up.
            now = motion.ledger.t + motion.behind
            clock += elapsed
            if clock > warm_up:
                times.append(elapsed)
                steps += made
                passed += max(0.0, now - before)
            before = now
            if viewer.sandbox.paused:
                viewer.sandbox.restart()
                before = 0.0
            if clock > warm_up + seconds:
                break
        pictures.close()
        return Watched(times, steps, passed, viewer.sandbox.speed)


def table(watched: dict[str, Watched]) -> Iterator[str]:
    yield f"{'the window, frames/s':<46}{'median':>8}{'slowest 1 %':>13}{'steps/s':>10}{'pace':>7} of that asked for"
    for name, one in watched.items():
        line = f"  {name:<44}{one.frames:8.1f}{one.slowest:13.1f}{one.steps_per_second:10,.0f}{one.pace:7.2f}"
        yield line
