"""How smoothly the window of `taichi-disk view` moves, and its page in a browser: the real ones, nobody at them."""

from __future__ import annotations

import multiprocessing
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from itertools import pairwise
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
BROWSED = 4.0  # the same of the page: no scene ends so soon


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


def page(_repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Pictures a second that a Chromium beside the program shows, of the same scenes."""
    from tests.integration.test_browser import MISSING

    if MISSING:
        yield f"the page: not measured: {MISSING}"
        return
    yield f"{'the page, 1400 x 900':<46}{'pictures/s':>12}{'slowest 1 %':>13}"
    for scene, *own in SCENES:
        given = (*own, *settings)
        seconds = browse(scene, given)
        slowest = quantiles(seconds, n=100)[-1]
        yield f"  {' '.join((scene, *given)):<44}{1 / median(seconds):12.1f}{1 / slowest:13.1f}"


def browse(scene: str, settings: tuple[str, ...]) -> list[float]:
    """Seconds between the pictures of a page, while its scene moves."""
    from tests.integration.test_browser import Visitor

    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "taichi_disk", "view", scene, "--browser", "--out", folder]
        command += [f"--set={setting}" for setting in settings]
        program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        assert program.stdout
        try:
            found = re.search(r"http://\S+/", program.stdout.readline())
            assert found, "the page is not served"
            visitor = Visitor(found[0])
            try:
                visitor.key(" ")
                time.sleep(WARM_UP)
                visitor.script(
                    "window.shown = []; document.querySelector('#canvas img')"
                    ".addEventListener('load', () => window.shown.push(performance.now()))"
                )
                time.sleep(BROWSED)
                shown = visitor.script("return window.shown")
                visitor.key("q")
                program.wait(20.0)
            finally:
                visitor.driver.quit()
        finally:
            program.kill()
    return [(later - one) / 1000 for one, later in pairwise(shown)]
