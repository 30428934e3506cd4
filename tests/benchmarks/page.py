"""Measure how smoothly the page of `taichi-disk view` moves, without a user."""

from __future__ import annotations

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from pathlib import Path
from statistics import median, quantiles

from tests.browser import MISSING, Browser, serving

from .pages import pages

SCENES = (
    ("compression",),
    ("exponential_wall",),
    ("absorbing_wall",),
    ("exponential_wall", "lattice.points=4400"),
    ("exponential_wall", "lattice.points=20000"),
)
WARM_UP = 2.0  # time before the measurement [s]
BROWSED = 4.0  # time of the measurement on the page [s]; no scene ends sooner
COUNTED = 200  # number of states that are measured


def page(settings):
    """Measure many pages at once, the states per second that Chromium draws, and the
    server's processor time for a state."""
    yield from pages(settings)
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


def states(scene, settings):
    """Return the server's processor time for a state without the computation [s], and
    the bytes of a state."""
    from taichi_disk import runtime

    runtime.start()
    from taichi_disk.scenes import load_scene
    from taichi_disk.simulation.simulation import KernelCache
    from taichi_disk.window.app import list_presets
    from taichi_disk.window.session import Common, Session

    presets = list_presets(load_scene(scene, settings))
    session = Session(Common(presets, KernelCache()))
    stepping = 0.0
    advance = session.sandbox.advance

    def stepped(*given):
        nonlocal stepping
        began = time.process_time()
        made = advance(*given)
        stepping += time.process_time() - began
        return made

    session.sandbox.advance = stepped
    session.hear({"do": "press", "key": "space"})
    for _ in range(COUNTED // 4):
        session.advance()
    stepping = 0.0
    began = time.process_time()
    for _ in range(COUNTED):
        session.advance()
    of_all = time.process_time() - began - stepping
    return of_all / COUNTED, len(session.messages["state"])


def browse(scene, settings):
    """Return the times between the pictures of a page [s], while its scene moves."""
    words = [f"--set={setting}" for setting in settings]
    with serving(Path(), "--no-open", scene, *words) as (_, address):
        browser = Browser((1400, 900))
        try:
            browser.open(address)
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
    return [(later - one) / 1000 for one, later in pairwise(shown)]
