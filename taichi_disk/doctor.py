"""Check whether this machine can run and film scenes, in a separate process because
drivers may crash."""

from __future__ import annotations

import platform
import signal
import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory

from taichi_disk import engine
from taichi_disk.engine.environment import CACHE, cache_folder, keeps_kernels
from taichi_disk.machine import REMEDY, cores, processor, python_command
from taichi_disk.signals import raise_if_interrupted

RUN = (
    "--set=lattice.points=20",
    "--set=material.eta_star=0",
    "--set=video.size=64",
    "--set=video.seconds=0.1",
)
_START = "from taichi_disk.__main__ import process; process()"
SECONDS = 120
_CRASHED = "crashed"


def examine() -> bool:
    """Print the state of this machine, with remedies, and return whether scenes can be
    run and filmed."""
    from taichi_disk.render.shaders import fit_engine

    cache = str(cache_folder())
    if not keeps_kernels():
        cache += (
            f" cannot be written: set {CACHE} and HOME, or every run compiles its"
            " kernels again"
        )
    names_and_versions = [" ".join(one) for one in engine.versions().items()]
    found = {
        "Python": platform.python_version(),
        "engine": " ".join(names_and_versions) or "none: install taichi-disk again",
        "processor": processor(),
        "processor cores": cores(),
        "cache of kernels": cache,
        "springs in films": "hard lines, as the engine has other shaders",
    }
    if fit_engine():
        found["springs in films"] = "soft lines"
    for name, value in found.items():
        print(f"{name:<16}  {value}")
    trouble, has_film = try_run()
    if has_film:
        print("\nReady: scenes can be run and filmed here.")
        return True
    if not trouble:
        print(
            "\nReady: scenes can be run here, and films are pages (video.html).\n"
            f"    For MP4, WebM, GIF and PNG, as root: {REMEDY}"
        )
        return True
    print(f"\nNot ready: {trouble}\n    {REMEDY}")
    if trouble.startswith(_CRASHED):
        print(
            "    If that is done, the cache of kernels may be damaged: delete the"
            f" folder {cache_folder()}"
        )
    return False


def try_run() -> tuple[str, bool]:
    """Run and film a small scene. Return the last line of its error output, or an empty
    string on success, and whether there is a film."""
    with TemporaryDirectory() as folder:
        out = Path(folder, "run")
        try:
            done = subprocess.run(
                python_command(_START, "run", "exponential_wall", f"--out={out}", *RUN),
                capture_output=True,
                text=True,
                errors="replace",
                timeout=SECONDS,
            )
        except subprocess.TimeoutExpired:
            return f"no answer within {SECONDS} s", False
        has_film = (out / "video.mp4").is_file()
    raise_if_interrupted()
    if done.returncode < 0:
        return f"{_CRASHED} ({signal.Signals(-done.returncode).name})", False
    if done.returncode > 0:
        lines = done.stderr.strip().splitlines() or ["no message"]
        return lines[-1].removeprefix("error: "), False
    return "", has_film
