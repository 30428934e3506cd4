"""Check whether this machine can run and film scenes, in a separate process because
drivers may crash."""

from __future__ import annotations

import platform
from concurrent.futures import BrokenExecutor
from pathlib import Path
from tempfile import TemporaryDirectory

from taichi_disk.base import engine
from taichi_disk.base.engine.environment import CACHE, cache_folder, cache_problem
from taichi_disk.base.files import PROGRAM
from taichi_disk.base.machine import REMEDY, cores, foreign_packages, processor
from taichi_disk.base.processes.pool import Pool, result_of

SETTINGS = [
    "lattice.points=20",
    "material.eta_star=0",
    "video.size=64",
    "video.seconds=0.1",
]
SECONDS = 120
_CRASHED = "crashed"


def examine() -> bool:
    """Print the state of this machine, with remedies, and return whether scenes can be
    run and filmed."""
    folder = cache_folder()
    cache = str(folder)
    if cache_problem():
        cache = (
            f"none ({cache_problem()}): set {CACHE} and HOME, or every run compiles its"
            " kernels again"
        )
    names_and_versions = [" ".join(one) for one in engine.versions().items()]
    found = {
        "program": f"{PROGRAM} in {Path(__file__).parent}",
        "Python": platform.python_version(),
        "engine": " ".join(names_and_versions) or "none: install taichi-disk again",
        "processor": processor(),
        "processor cores": cores(),
        "cache of kernels": cache,
    }
    foreign = foreign_packages()
    if foreign:
        found["foreign packages"] = foreign
    for name, value in found.items():
        print(f"{name:<16}  {value}")
    trouble, films = try_run()
    if not trouble:
        print(f"\nReady: scenes can be run {films}")
        return True
    print(f"\nNot ready: {trouble}\n    {foreign or REMEDY}")
    if trouble.startswith(_CRASHED):
        print(
            "    If that is done, the cache of kernels may be damaged: delete the"
            f" folder {folder}"
        )
    return False


def try_run() -> tuple[str, str]:
    """Run and film a small scene in another process. Return what failed, or "", and how
    the sentence "scenes can be run" goes on."""
    pool = Pool(1)
    try:
        with TemporaryDirectory() as folder:
            out = Path(folder, "run")
            return result_of(pool.submit(film_small, out, SETTINGS), SECONDS)
    except TimeoutError:
        return f"no answer within {SECONDS} s", ""
    except BrokenExecutor as error:
        return f"{_CRASHED} ({error})", ""
    except Exception as error:
        return str(error), ""
    finally:
        pool.kill()


def film_small(out: Path, settings: list[str]) -> tuple[str, str]:
    """Run and film a scene into `out`. Returns as `try_run`."""
    from taichi_disk.experiments.scenes import load_scene
    from taichi_disk.runs.api import run
    from taichi_disk.runs.api.work import ERRORS

    summary = run(load_scene("exponential_wall", settings), out, lattices=1).summary
    troubles = [summary[key] for key in ERRORS.values() if key in summary]
    films = "and filmed here."
    for text in summary.get("notes", ()):
        if "video.html" in text:
            films = f"here, and {text}"
    return "; ".join(troubles), films
