"""Numba, one thread, as fast as it can be made: fastmath, no checks, springs in either of two orders.

(Tried and slower: pulls of all springs into an array first, so that roots and divisions become vector instructions;
separate arrays for x and y.)
"""

from __future__ import annotations

from math import exp, sqrt
from time import perf_counter
from typing import Any

import numba
import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.physics.ordering import spread

Array = NDArray[np.float64]


def orders(lattice: Lattice) -> dict[str, NDArray[np.integer[Any]]]:
    """Orders of the springs: by their first points, and so that neighbours in the list share none."""
    return {"sorted": np.arange(len(lattice.bonds)), "spread": spread(lattice.bonds, len(lattice.positions))}


def leapfrog(task: Any, order: NDArray[np.integer[Any]]) -> tuple[float, Array]:
    """Seconds of the steps of a task on the rigid wall, and the velocities (n, 2) at the end."""
    scenario, h = task.scenario, task.dt
    lattice, springs, wall = scenario.lattice, scenario.model.springs, scenario.model.wall
    first, second = (np.ascontiguousarray(end) for end in lattice.bonds[order].T)
    mass = float(lattice.masses[0])
    numbers = springs.k_a, springs.k_b, springs.eta, wall.a, wall.V0, wall.reach
    x, v = lattice.positions.copy(), scenario.velocities.copy()
    began = perf_counter()
    f, _, _ = _leapfrog(x, v, first, second, lattice.rest_lengths[order], mass, h, task.steps, numbers)
    return perf_counter() - began, v + 0.5 * h / mass * f


@numba.njit(fastmath=True, error_model="numpy")
def _leapfrog(
    x: Any, v: Any, first: Any, second: Any, rest: Any, mass: float, h: float, steps: int, numbers: Any
) -> tuple[Any, float, float]:
    """Steps x and v (n, 2) in place, v to half a step before the end; returns force, elastic energy, energy lost."""
    k_a, k_b, eta, a, V0, reach = numbers
    g = h / mass
    f, u = np.zeros_like(x), v.copy()
    lost, power, energy = 0.0, 0.0, 0.0
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
        energy, squares = 0.0, 0.0
        for b in range(len(first)):
            i, j = first[b], second[b]
            dx, dy = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
            r = sqrt(dx * dx + dy * dy)
            s = r - rest[b]
            pull = (k_a * s + k_b * s * s * s) / r
            energy += (0.5 * k_a + 0.25 * k_b * s * s) * s * s
            fx, fy = pull * dx, pull * dy
            if eta != 0.0:
                ux, uy = u[i, 0] - u[j, 0], u[i, 1] - u[j, 1]
                squares += ux * ux + uy * uy
                fx += eta * ux
                fy += eta * uy
            f[i, 0] -= fx
            f[i, 1] -= fy
            f[j, 0] += fx
            f[j, 1] += fy
        if step < 0:
            v -= 0.5 * g * f
        else:
            lost += 0.5 * h * (power + eta * squares)
        power = eta * squares
    return f, energy, lost
