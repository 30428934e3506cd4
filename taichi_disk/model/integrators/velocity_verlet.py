"""Velocity Verlet in its leapfrog form: order 2, symplectic, one force evaluation a step.

    v_{k+1/2} = v_{k-1/2} + h f_k/m,    x_{k+1} = x_k + h v_{k+1/2},    v_k = v_{k-1/2} + h/2 f_k/m

(Hairer, Lubich & Wanner, Acta Numerica 12, 2003). The cheapest way to an error of e above 1e-7: the highest lattice
frequency sets the step before accuracy does. Dashpots need v_k before the force is known; they get the prediction
u_k = v_{k-1/2} + h/2 f_{k-1}/m, whose error is O(h^2), so the order stays 2. For weak dashpots: they shorten the stable
step to (h omega)^2 + 4 h damping < 4 (`stability.explicit_limit`).
"""

from __future__ import annotations

from taichi_disk.model.integrators.splitting import Splitting

VELOCITY_VERLET = Splitting(order=2, kicks=(0.5, 0.5), moves=(1.0,), stable=2.0, damped=True)
