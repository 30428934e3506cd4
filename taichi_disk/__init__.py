"""A two-dimensional elastic disk of mass points and springs: simulate it, measure it, film it."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from taichi_disk.runner import run
    from taichi_disk.scene_file import load_scene

__version__ = "0.1.0"
__all__ = ["__version__", "load_scene", "run"]

_HOME = {"load_scene": "taichi_disk.scene_file", "run": "taichi_disk.runner"}


def __getattr__(name: str) -> Any:
    # Lazy, so that `taichi-disk --help` and `check` need neither Taichi nor SciPy.
    if name in _HOME:
        return getattr(import_module(_HOME[name]), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
