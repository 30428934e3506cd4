"""Equation (4) of the paper, the quasi-static impact of a viscous disk, integrated in
time: e, contact time, xi."""

from __future__ import annotations

import math
from typing import NamedTuple

from scipy.integrate import solve_ivp

from taichi_disk.mechanics.lattice import Array


class QuasistaticImpact(NamedTuple):
    """Solution of eq. (4): e, contact time [R/c], and largest compression [R]."""

    restitution: float
    contact_time: float
    compression: float


def quasistatic_impact(
    velocity: float, tau0: float, e_star: float, rtol: float = 1e-9
) -> QuasistaticImpact:
    """Integrate eq. (4), xi'' = -pi E_* (xi + tau0 xi')/ln(4/xi), from xi = 0, xi' = v
    [c] until separation.

    The disk separates when the force vanishes, xi + tau0 xi' = 0, because a contact
    cannot pull. Integration to xi = 0 would change e by O(tau0^2). The paper takes e at
    the fixed time pi (R/c) sqrt(ln(4 c/v)) instead.

    `velocity`: v [c]; `tau0`: time scale of dissipation [R/c]; `e_star`: E_* [M
    c^2/R^2]; `rtol`: relative tolerance. Raises ValueError if xi reaches 4 R/e, where
    the stiffness of the law has no meaning.
    """
    stiffness = math.pi * e_star
    deepest = 4.0 / math.e / velocity

    def rate(_t: float, y: Array) -> list[float]:
        z, w = y  # xi/v and xi'/v, which are of order 1 at any speed
        if z <= 0.0:
            return [w, 0.0]
        return [
            w,
            -stiffness
            * (z + tau0 * w)
            / (math.log(4.0 / velocity) - math.log(min(z, deepest))),
        ]

    def force(_t: float, y: Array) -> float:
        return float(y[0] + tau0 * y[1])

    force.terminal, force.direction = True, -1.0  # type: ignore[attr-defined]
    end = (
        100.0
        * math.sqrt(math.log(4.0 / min(velocity, 1.0)) / stiffness)
        * (1.0 + tau0 * math.sqrt(stiffness))
    )
    steps = {"rtol": rtol, "atol": 1e-3 * rtol, "max_step": 0.02 * end}
    motion = solve_ivp(
        rate,
        (0.0, end),
        [0.0, 1.0],
        "DOP853",
        events=(force, lambda _t, y: y[1]),
        **steps,
    )
    if not motion.t_events[0].size or motion.y_events[1][0][0] >= deepest:
        raise ValueError(
            f"eq. (4) has no impact at v = {velocity:g} c, tau0 = {tau0:g} R/c, E_* ="
            f" {e_star:g}"
        )
    (_, last), (top, _) = motion.y_events[0][0], motion.y_events[1][0]
    return QuasistaticImpact(
        float(-last), float(motion.t_events[0][0]), float(velocity * top)
    )
