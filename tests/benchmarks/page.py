"""The server of `taichi-disk view`: its processor time for a state."""

from __future__ import annotations

import multiprocessing
import time
from concurrent.futures import ProcessPoolExecutor

SCENES = (
    ("compression",),
    ("exponential_wall",),
    ("absorbing_wall",),
    ("exponential_wall", "lattice.points=4400"),
    ("exponential_wall", "lattice.points=20000"),
)
COUNTED = 200  # number of states that are measured


def page(settings):
    """Measure the server's processor time for a state."""
    yield f"{'a state':<46}{'ms':>10}{'kB':>10}"
    for scene, *own in SCENES:
        given = (*own, *settings)
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            seconds, size = process.submit(states, scene, given).result()
        name = " ".join((scene, *given))
        yield f"  {name:<44}{1e3 * seconds:10.2f}{1e-3 * size:10.1f}"


def states(scene, settings):
    """Return the server's processor time for a state without the computation [s], and
    the bytes of a state."""
    from taichi_disk.base import runtime

    runtime.start()
    from taichi_disk.experiments.scenes import load_scene
    from taichi_disk.sandbox.app import list_presets
    from taichi_disk.sandbox.session import Session

    presets = list_presets(load_scene(scene, settings))
    session = Session(presets)
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
