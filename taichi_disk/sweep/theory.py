"""Continuum laws for the disk: compression, the quasi-static impact, and the paper's closed forms.

Units: disk mass M = radius R = reference speed c = 1, so the density is rho = 1/pi. E and nu are the lattice's own
two-dimensional (plane stress) moduli. Equation numbers are those of Kuninaka and Hayakawa's paper. The paper's
E_* = E/(1 - nu^2) is that of plane strain; for a sheet that is free to thin it is E, and that belongs in `e_star`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from taichi_disk.lattice import Array
from taichi_disk.scenes.compression import exact_compression as exact_compression
from taichi_disk.scenes.compression import paper_compression as paper_compression


def paper_restitution(velocity: ArrayLike, d1: float, d2: float) -> Array:
    """Eq. (5): e = d1 sqrt(1 - d2/sqrt(ln(4 c/v))), 0 where the root has no real value; with c = 1 in the logarithm."""
    inner = 1.0 - d2 / np.sqrt(np.log(4.0 / np.asarray(velocity, float)))
    return np.asarray(d1 * np.sqrt(np.maximum(inner, 0.0)))


class QuasistaticImpact(NamedTuple):
    """An impact after eq. (4): e, the time of contact [R/c], the largest compression [R]."""

    restitution: float
    contact_time: float
    compression: float


def quasistatic_impact(velocity: float, tau0: float, e_star: float, rtol: float = 1e-9) -> QuasistaticImpact:
    """Integrate eq. (4), xi'' = -pi E_* (xi + tau0 xi')/ln(4/xi), from xi = 0, xi' = v [c] until separation.

    Disk and wall separate where the force has fallen to zero, xi + tau0 xi' = 0: contact does not pull. Integrating
    on to xi = 0 would change e by O(tau0^2). The paper takes e at the fixed time pi (R/c) sqrt(ln(4 c/v)) instead.

    Args:
        velocity: v [c].
        tau0: the time scale of dissipation [R/c].
        e_star: E_* [M c^2/R^2].
        rtol: relative tolerance of the integration.

    Raises:
        ValueError: the disk would be crushed, xi = 4 R/e; beyond that the law's stiffness has no meaning.
    """
    from scipy.integrate import solve_ivp

    stiffness = math.pi * e_star
    deepest = 4.0 / math.e / velocity

    def rate(_t: float, y: Array) -> list[float]:
        z, w = y  # xi/v and xi'/v: of order one at any speed
        if z <= 0.0:
            return [w, 0.0]
        return [w, -stiffness * (z + tau0 * w) / (math.log(4.0 / velocity) - math.log(min(z, deepest)))]

    def force(_t: float, y: Array) -> float:
        return float(y[0] + tau0 * y[1])

    force.terminal, force.direction = True, -1.0  # type: ignore[attr-defined]
    end = 100.0 * math.sqrt(math.log(4.0 / min(velocity, 1.0)) / stiffness) * (1.0 + tau0 * math.sqrt(stiffness))
    steps = {"rtol": rtol, "atol": 1e-3 * rtol, "max_step": 0.02 * end}
    motion = solve_ivp(rate, (0.0, end), [0.0, 1.0], "DOP853", events=(force, lambda _t, y: y[1]), **steps)
    if not motion.t_events[0].size or motion.y_events[1][0][0] >= deepest:
        raise ValueError(f"eq. (4) has no impact at v = {velocity:g} c, tau0 = {tau0:g} R/c, E_* = {e_star:g}")
    (_, last), (top, _) = motion.y_events[0][0], motion.y_events[1][0]
    return QuasistaticImpact(float(-last), float(motion.t_events[0][0]), float(velocity * top))
