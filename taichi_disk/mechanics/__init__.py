"""A disk and how it moves: lattice, laws, integrators, kernels, equilibria, fields. It
knows no scene, no file of a scene and no picture.

A program of your own imports from here what it needs for laws and integrators.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from taichi_disk.mechanics.integrators import (
        VELOCITY_VERLET as VELOCITY_VERLET,
        Integrator as Integrator,
    )
    from taichi_disk.mechanics.lattice import (
        Array as Array,
        Lattice as Lattice,
    )
    from taichi_disk.mechanics.physics import (
        BodyForce as BodyForce,
        ExponentialWall as ExponentialWall,
        Model as Model,
        Springs as Springs,
    )
    from taichi_disk.mechanics.simulation.simulation import Simulation as Simulation

_MODULES = {
    "VELOCITY_VERLET": "taichi_disk.mechanics.integrators",
    "Integrator": "taichi_disk.mechanics.integrators",
    "Array": "taichi_disk.mechanics.lattice",
    "Lattice": "taichi_disk.mechanics.lattice",
    "BodyForce": "taichi_disk.mechanics.physics",
    "ExponentialWall": "taichi_disk.mechanics.physics",
    "Model": "taichi_disk.mechanics.physics",
    "Springs": "taichi_disk.mechanics.physics",
    "Simulation": "taichi_disk.mechanics.simulation.simulation",
}


def __dir__() -> list[str]:
    return list(_MODULES)


if not TYPE_CHECKING:  # or mypy and Pyright would take every name for one of these

    def __getattr__(name: str) -> object:
        # on first use, because a scene file is checked without Taichi and SciPy
        if name in _MODULES:
            return getattr(import_module(_MODULES[name]), name)
        raise AttributeError(
            f"module 'taichi_disk.mechanics' has no attribute {name!r}"
        )
