"""Measure whole commands, each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from time import perf_counter

from taichi_disk.simulation.simulation import KernelCache

from .kernel import Impact
from .timing import in_turn, table


def seconds(*arguments: str, cache: Path | None = None) -> float:
    """Return the wall-clock time of Python with these arguments. `cache`: folder of the
    compiled kernels."""
    environment = os.environ | (
        {"TI_OFFLINE_CACHE_FILE_PATH": str(cache)} if cache else {}
    )
    began = perf_counter()
    line = [sys.executable, *arguments]
    subprocess.run(
        line,
        env=environment,
        check=True,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    return perf_counter() - began


def command(name: str, scene: str, settings: tuple[str, ...]) -> list[str]:
    return [
        "-m",
        "taichi_disk",
        name,
        scene,
        *(f"--set={setting}" for setting in settings),
    ]


def start_up(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Measure commands that compute nothing, compared with Python itself."""
    runs: dict[str, Callable[[], float]] = {"python": partial(seconds, "-c", "")}
    runs["--help"] = partial(seconds, "-m", "taichi_disk", "--help")
    runs["check"] = partial(seconds, *command("check", "exponential_wall", settings))
    yield from table("start-up", in_turn(runs, repeats))


def film(repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Measure `run exponential_wall` with its film: once with empty caches, then warm,
    with and without a film."""
    with tempfile.TemporaryDirectory() as folder:
        cache, line = (
            Path(folder) / "cache",
            command("run", "exponential_wall", settings),
        )
        cold = seconds(*line, "--out", f"{folder}/film", cache=cache)
        runs: dict[str, Callable[[], float]] = {
            "caches warm": partial(
                seconds, *line, "--out", f"{folder}/film", cache=cache
            ),
            "caches warm, --no-video": partial(
                seconds, *line, "--no-video", "--out", f"{folder}/none", cache=cache
            ),
        }
        costs = in_turn(runs, min(repeats, 3))
    yield from table("run exponential_wall to its film", costs)
    yield f"  {'caches empty':<60}{'':8}{cold:9.3g}"


def sweep(_repeats: int, settings: tuple[str, ...]) -> Iterator[str]:
    """Measure once the sweeps of figures 3 and 6 in one process and in two, and the
    bare steps of their impacts."""
    for name in ("figure3", "figure6"):
        with tempfile.TemporaryDirectory() as folder:
            line = command("sweep", name, settings)
            seconds(
                *line,
                "--set=sweep.seed=[0]",
                "--set=sweep.velocity=[0.02]",
                "--out",
                f"{folder}/warm",
            )
            costs = {
                f"{jobs} process{'es' * (jobs > 1)}": [
                    seconds(*line, f"--jobs={jobs}", "--out", f"{folder}/{jobs}")
                ]
                for jobs in (1, 2)
            }
            yield from table(
                f"sweep {name}", {"bare steps": [bare_steps(Path(folder, "1"))]} | costs
            )


def bare_steps(folder: Path) -> float:
    """Return the time that the steps of a sweep's scenes alone take [s], each scene in
    one launch."""
    kernels = KernelCache()
    impacts = (Impact(kernels, scene) for scene in sorted(folder.glob("points/*.yaml")))
    return sum(impact.bare() * impact.work for impact in impacts)
