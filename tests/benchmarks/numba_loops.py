"""Numba on one thread, as fast as possible: fastmath, no checks, springs in the order
of their first points.

It does not sum up energies. (Tried and not faster: an order in which consecutive
springs share no point; storing the tensions of all springs first, so that roots and
divisions become vector instructions; separate arrays for x and y.)
"""

from __future__ import annotations

from math import exp, sqrt

import numba
import numpy as np


def leapfrog(impact):
    """Step an impact on the rigid wall by velocity Verlet, and return positions [R] and
    velocities [c] (2, n, 2) at the end."""
    return _stepped(impact, correction=0.0)


def takahashi_imada(impact):
    """Step an undamped impact as the program's `takahashi_imada` does: leapfrog with
    the force at x + (h^2/12) F(x)/m. Returns (2, n, 2) as `leapfrog` does."""
    # The flight starts and ends far from the wall, where x and the transformed
    # position are equal.
    mass = float(impact.scenario.lattice.masses[0])
    return _stepped(impact, correction=impact.dt**2 / (12.0 * mass))


def _stepped(impact, correction):
    scenario = impact.scenario
    h = impact.dt
    lattice = scenario.lattice
    springs = scenario.model.springs
    wall = scenario.model.wall
    first, second = (np.ascontiguousarray(end) for end in lattice.bonds.T)
    mass = float(lattice.masses[0])
    numbers = springs.k_a, springs.k_b, springs.eta, wall.a, wall.V0, wall.reach
    x = lattice.positions.copy()
    v = scenario.velocities.copy()
    f = _step(
        x,
        v,
        first,
        second,
        lattice.rest_lengths,
        mass,
        h,
        impact.steps,
        numbers,
        correction,
    )
    return np.array([x, v + 0.5 * h / mass * f])


@numba.njit(fastmath=True, error_model="numpy", cache=True)
def _forces(x, u, f, first, second, rest, numbers):
    """Write the forces at positions x and velocities u (n, 2) to f (n, 2)."""
    k_a, k_b, eta, a, V0, reach = numbers
    for i in range(len(x)):
        f[i, 0] = 0.0
        f[i, 1] = 0.0
        if x[i, 1] < reach:
            f[i, 1] = a * V0 * exp(-a * x[i, 1])
    for b in range(len(first)):
        i = first[b]
        j = second[b]
        dx = x[i, 0] - x[j, 0]
        dy = x[i, 1] - x[j, 1]
        r = sqrt(dx * dx + dy * dy)
        s = r - rest[b]
        pull = (k_a * s + k_b * s * s * s) / r
        fx = pull * dx
        fy = pull * dy
        if eta != 0.0:
            fx += eta * (u[i, 0] - u[j, 0])
            fy += eta * (u[i, 1] - u[j, 1])
        f[i, 0] -= fx
        f[i, 1] -= fy
        f[j, 0] += fx
        f[j, 1] += fy


@numba.njit(fastmath=True, error_model="numpy", cache=True)
def _step(  # noqa: PLR0913 (Numba takes arrays one by one)
    x, v, first, second, rest, mass, h, steps, numbers, correction
):
    """Step x and v (n, 2) in place, v to half a step before the end, and return the
    force. If `correction` is not 0, the force is that at x + correction F(x)."""
    eta = numbers[2]
    g = h / mass
    f = np.zeros_like(x)
    u = v.copy()
    moved = x.copy()
    for step in range(-1, steps):
        if step >= 0:
            for i in range(len(x)):
                for c in range(2):
                    v[i, c] += g * f[i, c]
                    x[i, c] += h * v[i, c]
                    if eta != 0.0:
                        u[i, c] = v[i, c] + 0.5 * g * f[i, c]
        _forces(x, u, f, first, second, rest, numbers)
        if correction != 0.0:
            for i in range(len(x)):
                for c in range(2):
                    moved[i, c] = x[i, c] + correction * f[i, c]
            _forces(moved, u, f, first, second, rest, numbers)
        if step < 0:
            v -= 0.5 * g * f
    return f
