"""Measure whole commands, each in a process of its own."""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path

from taichi_disk.simulation.simulation import KernelCache

from .kernel import Impact
from .timing import in_turn, seconds_of_python, table


def command(name, scene, settings):
    options = [f"--set={setting}" for setting in settings]
    return ["-m", "taichi_disk", name, scene, *options]


def start_up(repeats, settings):
    """Measure commands that compute nothing, compared with Python itself."""
    lines = {
        "python": ["-c", ""],
        "--help": ["-m", "taichi_disk", "--help"],
        "check": command("check", "exponential_wall", settings),
    }
    runs = {name: partial(seconds_of_python, *line) for name, line in lines.items()}
    yield from table("start-up", in_turn(runs, repeats))


def film(repeats, settings):
    """Measure `run exponential_wall` with its film: once with empty caches, then warm,
    with and without a film."""
    with tempfile.TemporaryDirectory() as folder:
        line = command("run", "exponential_wall", settings)
        in_cache = partial(
            seconds_of_python, *line, TI_OFFLINE_CACHE_FILE_PATH=f"{folder}/cache"
        )
        with_film = partial(in_cache, "--out", f"{folder}/film")
        without = partial(in_cache, "--no-video", "--out", f"{folder}/none")
        cold = with_film()
        runs = {"caches warm": with_film, "caches warm, --no-video": without}
        costs = in_turn(runs, min(repeats, 3))
    yield from table("run exponential_wall to its film", costs)
    yield f"  {'caches empty':<60}{'':8}{cold:9.3g}"


def sweep(_repeats, settings):
    """Measure once the sweeps of figures 3 and 6 in one process and in two, and the
    bare steps of their impacts."""
    for name in ("figure3", "figure6"):
        with tempfile.TemporaryDirectory() as folder:
            line = command("sweep", name, settings)
            first = ["--set=sweep.seed=[0]", "--set=sweep.velocity=[0.02]"]
            seconds_of_python(*line, *first, "--out", f"{folder}/warm")
            one = seconds_of_python(*line, "--jobs=1", "--out", f"{folder}/1")
            two = seconds_of_python(*line, "--jobs=2", "--out", f"{folder}/2")
            bare = bare_steps(Path(folder, "1"))
        costs = {"bare steps": [bare], "1 process": [one], "2 processes": [two]}
        yield from table(f"sweep {name}", costs)


def bare_steps(folder):
    """Return the time that the steps of a sweep's scenes alone take [s], each scene in
    one launch."""
    kernels = KernelCache()
    impacts = (Impact(kernels, scene) for scene in sorted(folder.glob("points/*.yaml")))
    return sum(impact.bare() * impact.work for impact in impacts)
