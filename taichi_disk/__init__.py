"""A two-dimensional elastic disk of mass points and springs: simulate it, measure it,
film it."""

from __future__ import annotations

from importlib import import_module
from time import perf_counter

from taichi_disk.version import __version__

TYPE_CHECKING = False  # importing it from typing would delay the handling of Ctrl-C
if TYPE_CHECKING:
    from typing import Any

    from taichi_disk.experiments.scenes import Scene, load_scene, load_sweep
    from taichi_disk.mechanics.lattice import Lattice
    from taichi_disk.runs.api import Result, run
    from taichi_disk.studies.sweep.sweep import run_sweep

BEGAN = perf_counter()  # start of the wall clock of a command
__all__ = [
    "Lattice",
    "Result",
    "Scene",
    "__version__",
    "load_scene",
    "load_sweep",
    "run",
    "run_sweep",
]

_MODULES = {
    "Lattice": "mechanics.lattice",
    "Result": "runs.api",
    "run": "runs.api",
    "run_sweep": "studies.sweep.sweep",
}
_MODULES |= dict.fromkeys(("Scene", "load_scene", "load_sweep"), "experiments.scenes")


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    # Names are imported on first use, so that `taichi-disk --help` and `check` need
    # neither Taichi nor SciPy.
    if name in _MODULES:
        return getattr(import_module(f"taichi_disk.{_MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
