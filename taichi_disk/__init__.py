"""A two-dimensional elastic disk of mass points and springs: simulate it, measure it,
film it."""

from __future__ import annotations

from importlib import import_module
from time import perf_counter

from taichi_disk.version import __version__

TYPE_CHECKING = False  # importing it from typing would delay the handling of Ctrl-C
if TYPE_CHECKING:
    from typing import Any

    from taichi_disk.api import Result, run
    from taichi_disk.lattice import Lattice
    from taichi_disk.scenes import Scene, load_scene, load_sweep
    from taichi_disk.sweep.sweep import run_sweep

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
    "Lattice": "lattice",
    "Result": "api",
    "run": "api",
    "run_sweep": "sweep.sweep",
}
_MODULES |= dict.fromkeys(("Scene", "load_scene", "load_sweep"), "scenes")


def __dir__() -> list[str]:
    return __all__


def __getattr__(name: str) -> Any:
    # Names are imported on first use, so that `taichi-disk --help` and `check` need
    # neither Taichi nor SciPy.
    if name in _MODULES:
        return getattr(import_module(f"taichi_disk.{_MODULES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
