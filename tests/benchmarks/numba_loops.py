"""Numba on one thread, as fast as possible: fastmath, no checks, springs in the order
of their first points.

It does not sum up energies. (Tried and not faster: an order in which consecutive
springs share no point; storing the tensions of all springs first, so that roots and
divisions become vector instructions; separate arrays for x and y.)
"""

from __future__ import annotations

from math import exp, sqrt
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray


def leapfrog(impact: Any) -> NDArray[np.float64]:
    """Step an impact on the rigid wall, and return positions [R] and velocities [c] (2,
    n, 2) at the end."""
    scenario, h = impact.scenario, impact.dt
    lattice, springs, wall = (
        scenario.lattice,
        scenario.model.springs,
        scenario.model.wall,
    )
    first, second = (np.ascontiguousarray(end) for end in lattice.bonds.T)
    mass = float(lattice.masses[0])
    numbers = springs.k_a, springs.k_b, springs.eta, wall.a, wall.V0, wall.reach
    x, v = lattice.positions.copy(), scenario.velocities.copy()
    f = _leapfrog(
        x, v, first, second, lattice.rest_lengths, mass, h, impact.steps, numbers
    )
    return np.array([x, v + 0.5 * h / mass * f])


@numba.njit(fastmath=True, error_model="numpy", cache=True)
def _leapfrog(
    x: Any,
    v: Any,
    first: Any,
    second: Any,
    rest: Any,
    mass: float,
    h: float,
    steps: int,
    numbers: Any,
) -> Any:
    """Step x and v (n, 2) in place, v to half a step before the end, and return the
    force."""
    k_a, k_b, eta, a, V0, reach = numbers
    g = h / mass
    f, u = np.zeros_like(x), v.copy()
    for step in range(-1, steps):
        if step >= 0:
            for i in range(len(x)):
                for c in range(2):
                    v[i, c] += g * f[i, c]
                    x[i, c] += h * v[i, c]
                    if eta != 0.0:
                        u[i, c] = v[i, c] + 0.5 * g * f[i, c]
        for i in range(len(x)):
            f[i, 0], f[i, 1] = 0.0, 0.0
            if x[i, 1] < reach:
                f[i, 1] = a * V0 * exp(-a * x[i, 1])
        for b in range(len(first)):
            i, j = first[b], second[b]
            dx, dy = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
            r = sqrt(dx * dx + dy * dy)
            s = r - rest[b]
            pull = (k_a * s + k_b * s * s * s) / r
            fx, fy = pull * dx, pull * dy
            if eta != 0.0:
                fx += eta * (u[i, 0] - u[j, 0])
                fy += eta * (u[i, 1] - u[j, 1])
            f[i, 0] -= fx
            f[i, 1] -= fy
            f[j, 0] += fx
            f[j, 1] += fy
        if step < 0:
            v -= 0.5 * g * f
    return f
