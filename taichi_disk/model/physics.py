"""The numbers of one simulation, and from them what has to be modelled at all."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Wall = Literal["none", "rigid", "elastic"]
Boundary = Literal["none", "reset", "pinned", "dashpot"]
Integrator = Literal["velocity_verlet", "trapezoidal", "vefrl"]


@dataclass(frozen=True)
class Physics:
    """Parameters of the equations of motion (paper eqs. 1, 3 and 6), in M, R and c.

    A feature whose parameter is zero or absent is neither allocated nor compiled nor computed.

    Attributes:
        k_a, k_b: spring constants [M c^2/R^2], [M c^2/R^4].
        eta: dashpot constant eta_dis = eta* m c/R of every spring [M c/R].
        wall: no wall, the rigid exponential wall at y = 0, or the lattice's own elastic wall.
        a, V0: hardness [1/R] and strength [M c^2] of the wall's potential V0 exp(-a l).
        threshold: reach of the contact with the elastic wall [R].
        load: total force P pressing the disk down, spread over its points [M c^2/R].
        boundary: what happens at the sides and bottom of the elastic wall.
        reset_interval: time between two settings of the boundary's velocities to zero [R/c].
        impedance: (k, 2) x and y dashpot constants Z of the boundary points [M c/R].
        integrator: how a step is made; see `taichi_disk.model.integrators`.
        pulled: whether a hand may pull at a point; see `World.take_hold`.
    """

    k_a: float = 1.0
    k_b: float = 0.0
    eta: float = 0.0
    wall: Wall = "none"
    a: float = 300.0
    V0: float = 150.0
    threshold: float = 0.1
    load: float = 0.0
    boundary: Boundary = "none"
    reset_interval: float = 0.0
    impedance: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 2)))
    integrator: Integrator = "velocity_verlet"
    pulled: bool = False

    @property
    def cubic(self) -> bool:
        return self.k_b != 0.0

    @property
    def explicit_dashpot(self) -> bool:
        return self.eta != 0.0 and self.integrator == "velocity_verlet"

    @property
    def implicit_dashpot(self) -> bool:
        return self.eta != 0.0 and self.integrator == "trapezoidal"

    @property
    def dissipates(self) -> bool:
        return self.eta != 0.0

    @property
    def damped(self) -> bool:
        """Whether any force depends on velocity."""
        return self.dissipates or self.boundary == "dashpot"

    @property
    def reach(self) -> float:
        """Height above the rigid wall beyond which a V0 exp(-a y) < e^-45 [M c^2/R]: no exponential is computed."""
        return max(0.0, (np.log(self.a * self.V0) + 45.0) / self.a)
