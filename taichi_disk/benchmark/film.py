"""The whole of `taichi-disk run exponential_wall`, as a process of its own, with empty and with warm caches."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from time import perf_counter

from taichi_disk.benchmark.stopwatch import Timing

PART = "film"


def measure(repeats: int) -> list[Timing]:
    """One run that has to compile everything, then `repeats`; compared with the first."""
    with tempfile.TemporaryDirectory() as folder:
        environment = os.environ | {"TI_OFFLINE_CACHE_FILE_PATH": str(Path(folder) / "cache")}
        command = [sys.executable, "-m", "taichi_disk", "run", "exponential_wall", "--out", str(Path(folder) / "out")]
        seconds = []
        for _ in range(1 + repeats):
            began = perf_counter()
            subprocess.run(command, env=environment, check=True, stdout=subprocess.DEVNULL)
            seconds.append(perf_counter() - began)
    return [
        Timing(PART, "run exponential_wall to its film, caches empty", 1, seconds[:1], seconds[:1]),
        Timing(PART, "the same, caches warm", 1, seconds[1:], repeats * seconds[:1]),
    ]
