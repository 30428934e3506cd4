"""A disk and how it moves: lattice, laws, integrators, kernels, equilibria, fields. It
knows no scene, no file of a scene and no picture.

A program of your own imports from here what it needs for laws and integrators.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from taichi_disk.mechanics.integrators import VELOCITY_VERLET, Integrator
    from taichi_disk.mechanics.lattice import Array, Lattice
    from taichi_disk.mechanics.physics import BodyForce, ExponentialWall, Model, Springs
    from taichi_disk.mechanics.simulation.simulation import Simulation

_NAMES = {
    "integrators": ("VELOCITY_VERLET", "Integrator"),
    "lattice": ("Array", "Lattice"),
    "physics": ("BodyForce", "ExponentialWall", "Model", "Springs"),
    "simulation.simulation": ("Simulation",),
}


def __getattr__(name: str) -> Any:
    # on first use, because a scene file is checked without Taichi and SciPy
    for module, names in _NAMES.items():
        if name in names:
            return getattr(import_module(f"{__name__}.{module}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
