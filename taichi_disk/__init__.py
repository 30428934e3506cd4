"""A two-dimensional elastic disk of mass points and springs: simulate it, measure it,
film it."""

from __future__ import annotations

from importlib import import_module
from time import perf_counter

from taichi_disk.version import __version__

# Importing it from typing would delay the handling of Ctrl-C. If it were a plain False,
# Jedi, which completes names in IPython and Spyder, would skip these imports.
TYPE_CHECKING = __name__ == "typing"
if TYPE_CHECKING:
    from taichi_disk.base.errors import InputError, SimulationError, TaichiDiskError
    from taichi_disk.experiments.scenes import Scene, load_scene, load_sweep
    from taichi_disk.mechanics.lattice import Lattice
    from taichi_disk.runs.api import Result, run
    from taichi_disk.studies.sweep.sweep import run_sweep

BEGAN = perf_counter()  # start of the wall clock of a command
__all__ = [
    "InputError",
    "Lattice",
    "Result",
    "Scene",
    "SimulationError",
    "TaichiDiskError",
    "__version__",
    "load_scene",
    "load_sweep",
    "run",
    "run_sweep",
]

_MODULES = {
    "InputError": "taichi_disk.base.errors",
    "Lattice": "taichi_disk.mechanics.lattice",
    "Result": "taichi_disk.runs.api",
    "Scene": "taichi_disk.experiments.scenes",
    "SimulationError": "taichi_disk.base.errors",
    "TaichiDiskError": "taichi_disk.base.errors",
    "load_scene": "taichi_disk.experiments.scenes",
    "load_sweep": "taichi_disk.experiments.scenes",
    "run": "taichi_disk.runs.api",
    "run_sweep": "taichi_disk.studies.sweep.sweep",
}


def __dir__() -> list[str]:
    return __all__


if not TYPE_CHECKING:  # or mypy and Pyright would take every name for one of these

    def __getattr__(name: str) -> object:
        # Names are imported on first use, so that `taichi-disk --help` and `check` need
        # neither Taichi nor SciPy.
        if name in _MODULES:
            return getattr(import_module(_MODULES[name]), name)
        raise AttributeError(f"module 'taichi_disk' has no attribute {name!r}")
