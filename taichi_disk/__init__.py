"""A two-dimensional elastic disk of mass points and springs: simulate it, measure it, film it."""

from __future__ import annotations

from importlib import import_module
from time import perf_counter

from taichi_disk.version import __version__

TYPE_CHECKING = False  # as in typing, whose import would be the longest part of the time before a command can listen
if TYPE_CHECKING:
    from typing import Any

    from taichi_disk.api import Result, run
    from taichi_disk.lattice import Lattice
    from taichi_disk.scenes import Scene, load_scene, load_sweep
    from taichi_disk.sweep.sweep import run_sweep

BEGAN = perf_counter()  # the wall clock of a command counts from here
__all__ = ["Lattice", "Result", "Scene", "__version__", "load_scene", "load_sweep", "run", "run_sweep"]

_HOME = {
    "Lattice": "taichi_disk.lattice",
    "Result": "taichi_disk.api",
    "Scene": "taichi_disk.scenes",
    "load_scene": "taichi_disk.scenes",
    "load_sweep": "taichi_disk.scenes",
    "run": "taichi_disk.api",
    "run_sweep": "taichi_disk.sweep.sweep",
}


def __getattr__(name: str) -> Any:
    # Lazy, so that `taichi-disk --help` and `check` need neither Taichi nor SciPy.
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
