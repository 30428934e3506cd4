"""Check whether this machine can run and film scenes, in a separate process because
drivers may crash."""

from __future__ import annotations

import os
import platform
import signal
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from taichi_disk import engine
from taichi_disk.engine.environment import CACHE, cache_folder, keeps_kernels
from taichi_disk.machine import cores, free_memory, processor
from taichi_disk.signals import raise_if_interrupted

RUN = (
    "--set=lattice.points=20",
    "--set=material.eta_star=0",
    "--set=video.size=64",
    "--set=video.seconds=0.1",
)
SECONDS = 120
REMEDY = (
    "apt-get update && apt-get install -y --no-install-recommends libx11-6"
    " mesa-vulkan-drivers"
)
if sys.platform != "linux":
    REMEDY = (
        "install the Vulkan driver of the graphics card's maker; `run --no-video` needs"
        " none"
    )


def examine() -> bool:
    """Print the state of this machine, with remedies, and return whether scenes can be
    run and filmed."""
    cache = str(cache_folder())
    if not keeps_kernels():
        cache += (
            f" cannot be written: set {CACHE} and HOME, or every run compiles its"
            " kernels again"
        )
    found = {
        "Python": platform.python_version(),
        "engine": (
            " ".join(" ".join(one) for one in engine.versions().items())
            or "none: install taichi-disk again"
        ),
        "processor": processor(),
        "processor cores": cores(),
        "free memory": f"{free_memory() / 1e9:.1f} GB",
        "cache of kernels": cache,
        "display": (
            os.environ.get("DISPLAY")
            or os.environ.get("WAYLAND_DISPLAY")
            or "none (films need none)"
        ),
    }
    for name, value in found.items():
        print(f"{name:<16}  {value}")
    trouble = try_run()
    print(
        f"\nNot ready: {trouble}\n    {REMEDY}"
        if trouble
        else "\nReady: scenes can be run and filmed here."
    )
    return not trouble


def try_run() -> str:
    """Run and film a small scene. Return the last line of its error output, or an empty
    string on success."""
    with TemporaryDirectory() as folder:
        command = [
            sys.executable,
            "-m",
            "taichi_disk",
            "run",
            "exponential_wall",
            f"--out={Path(folder, 'run')}",
            *RUN,
        ]
        try:
            done = subprocess.run(
                command,
                capture_output=True,
                text=True,
                errors="replace",
                timeout=SECONDS,
            )
        except subprocess.TimeoutExpired:
            return f"no answer within {SECONDS} s"
    raise_if_interrupted()
    if done.returncode < 0:
        return f"crashed ({signal.Signals(-done.returncode).name})"
    return (
        done.stderr.strip().splitlines()[-1].removeprefix("error: ")
        if done.returncode
        else ""
    )
