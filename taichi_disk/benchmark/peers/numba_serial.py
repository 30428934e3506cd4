"""Numba: loops over springs and points as one would write them, without fastmath, one thread."""

from __future__ import annotations

from math import exp, sqrt
from time import perf_counter
from typing import Any

import numba
import numpy as np

from taichi_disk.benchmark.engine import Engine
from taichi_disk.benchmark.task import Task


class NumbaSerial(Engine):
    """The arithmetic of `velocity_verlet`, elastic and dissipated energy of every step included."""

    def __init__(self, task: Task, **options: Any) -> None:
        self._task = task

    def run(self) -> float:
        task, physics = self._task, self._task.physics
        mass = float(task.lattice.masses[0])
        x, v = task.lattice.positions.copy(), task.velocities[0].copy()
        numbers = physics.k_a, physics.k_b, physics.eta, physics.a, physics.V0, physics.reach
        began = perf_counter()
        f, _energy, _lost = _leapfrog(
            x, v, task.lattice.bonds, task.lattice.rest_lengths, mass, task.dt, task.steps, numbers
        )
        seconds = perf_counter() - began
        self._velocities = v + 0.5 * task.dt / mass * f
        return seconds

    def restitution(self) -> float:
        return self._task.restitution(self._velocities)


@numba.njit(fastmath=False)
def _leapfrog(x, v, bonds, rest, mass, h, steps, numbers):
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
        for b in range(len(bonds)):
            i, j = bonds[b, 0], bonds[b, 1]
            dx, dy = x[i, 0] - x[j, 0], x[i, 1] - x[j, 1]
            r = sqrt(dx * dx + dy * dy)
            s = r - rest[b]
            pull = (k_a * s + k_b * s * s * s) / r
            energy += 0.5 * k_a * s * s + 0.25 * k_b * s * s * s * s
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
