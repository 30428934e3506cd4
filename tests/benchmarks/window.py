"""Measure how smoothly the page and the window of `taichi-disk view` move, without a
user."""

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
# times before and during the measurement in the window [s]
WARM_UP = 2.0
WATCHED = 6.0
BROWSED = 4.0  # time of the measurement on the page [s]; no scene ends sooner
COUNTED = 200  # number of states that are measured


def window(_repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Measure pictures and steps per second of the shipped scenes and two larger
    disks."""
    from taichi_disk.window.app import window_problem

    problem = window_problem()
    if problem:
        yield f"window: not measured: {problem}"
        return
    yield f"{'the window':<46}{'pictures/s':>12}{'slowest 1 %':>13}{'steps/s':>10}"
    for scene, *own in SCENES:
        given = (*own, *settings)
        name = " ".join((scene, *given))
        # Each scene has its own process, because GLFW ends a process if it cannot open
        # a window.
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            try:
                seconds, steps = process.submit(watch, scene, given).result()
            except BrokenProcessPool:
                yield f"  {name}: not measured: the window's process died"
                continue
        slowest = quantiles(seconds, n=100)[-1]
        yield (
            f"  {name:<44}{1 / median(seconds):12.1f}{1 / slowest:13.1f}"
            f"{steps / sum(seconds):10,.0f}"
        )


def watch(scene: str, settings: tuple[str, ...]) -> tuple[list[float], int]:
    """Return the times between the pictures of a window [s], and the number of steps. A
    scene that has ended begins again.
    """
    from taichi_disk import runtime

    runtime.start()
    from taichi_disk.scenes import load_scene
    from taichi_disk.window.app import list_presets
    from taichi_disk.window.viewer import Viewer

    seconds = []
    steps = 0
    began = time.perf_counter()
    last = began
    with tempfile.TemporaryDirectory() as folder:
        presets = list_presets(load_scene(scene, settings))
        viewer = Viewer(presets, Path(folder), max_rate=1000)
        pictures = viewer.pictures()
        for made in pictures:
            now = time.perf_counter()
            if now > began + WARM_UP:
                seconds.append(now - last)
                steps += made
            last = now
            if now > began + WARM_UP + WATCHED:
                break
            if viewer.sandbox.paused:
                viewer.sandbox.begin()
                viewer.sandbox.pause()
        pictures.close()
    return seconds, steps


def page(_repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Measure the states per second that Chromium draws, and the server's processor
    time for a state."""
    from tests.browser import MISSING

    yield (
        f"{'the page, 1400 x 900':<46}{'ms/state':>10}{'kB/state':>10}"
        f"{'states/s':>10}{'slowest 1 %':>13}"
    )
    for scene, *own in SCENES:
        given = (*own, *settings)
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            seconds, size = process.submit(states, scene, given).result()
        name = " ".join((scene, *given))
        line = f"  {name:<44}{1e3 * seconds:10.2f}{1e-3 * size:10.1f}"
        if not MISSING:
            apart = browse(scene, given)
            line += f"{1 / median(apart):10.1f}{1 / quantiles(apart, n=100)[-1]:13.1f}"
        yield line
    if MISSING:
        yield f"states a second: not measured: {MISSING}"


def states(scene: str, settings: tuple[str, ...]) -> tuple[float, int]:
    """Return the server's processor time for a state without the computation [s], and
    the bytes of a state."""
    from taichi_disk import runtime

    runtime.start()
    from taichi_disk.scenes import load_scene
    from taichi_disk.simulation.simulation import KernelCache
    from taichi_disk.window.app import list_presets
    from taichi_disk.window.session import Session

    session = Session(list_presets(load_scene(scene, settings)), KernelCache())
    stepping = 0.0
    advance = session.sandbox.advance

    def stepped(*given: float) -> int:
        nonlocal stepping
        began = time.process_time()
        made = advance(*given)
        stepping += time.process_time() - began
        return made

    session.sandbox.advance = stepped  # type: ignore[method-assign]
    session.hear({"do": "press", "key": "space"})
    for _ in range(COUNTED // 4):
        session.advance()
    stepping = 0.0
    began = time.process_time()
    for _ in range(COUNTED):
        session.advance()
    of_all = time.process_time() - began - stepping
    state = session.messages(session.look)["state"]
    return of_all / COUNTED, len(state)


def browse(scene: str, settings: tuple[str, ...]) -> list[float]:
    """Return the times between the pictures of a page [s], while its scene moves."""
    from tests.browser import Browser

    command = [sys.executable, "-m", "taichi_disk", "view", scene, "--no-open"]
    command += [f"--set={setting}" for setting in settings]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert program.stdout
    try:
        found = re.search(r"http://\S+/", program.stdout.readline())
        assert found, "the page is not served"
        browser = Browser((1400, 900))
        try:
            browser.open(found[0])
            browser.click("drop")
            time.sleep(WARM_UP)
            browser.script(
                "window.shown = []; const { sandbox } = window, draw ="
                " sandbox.draw;sandbox.draw = function () {"
                " window.shown.push(performance.now()); draw.call(this); }"
            )
            time.sleep(BROWSED)
            shown = browser.script("return window.shown")
        finally:
            browser.driver.quit()
    finally:
        program.terminate()
        program.wait()
    return [(later - one) / 1000 for one, later in pairwise(shown)]
