"""The time integrators, by the name that a scene gives them."""

import taichi_disk.physics  # noqa: F401 (prepares what Taichi reads when it is imported)
from taichi_disk.integrators.schemes import VEFRL, VELOCITY_VERLET, Integrator
from taichi_disk.integrators.trapezoidal import TRAPEZOIDAL

INTEGRATORS: dict[str, Integrator] = {one.name: one for one in (VELOCITY_VERLET, TRAPEZOIDAL, VEFRL)}

__all__ = ["INTEGRATORS", "TRAPEZOIDAL", "VEFRL", "VELOCITY_VERLET", "Integrator"]
