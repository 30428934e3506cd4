"""The lattice as the continuum's law has it: strains so small that springs pull linearly, on a perfectly hard wall.

What then differs from the law is the lattice alone: its grain, its disorder, its polygonal rim.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.newton import laid_down, lowest_lie
from taichi_disk.stiffness import tangent_stiffness

Array = NDArray[np.float64]


def hard_compression(disk: Lattice, k_a: float, pressures: Sequence[float], rim_share: float = 1.0) -> list[float]:
    """xi [R] of `disk` under each of `pressures` [M c^2/R], from centre of mass to lowest point.

    The disk lies as low as it can and is held against rolling. Forces between wall and rim points push only, and
    only where they touch: found point by point from the lattice's compliance. `rim_share`: the stiffness of springs
    along the rim, in k_a. At 1/2 they count for their one triangle, as inner springs count for their two.
    """
    from scipy.sparse.linalg import splu

    top = max(pressures)
    x = laid_down(disk, lowest_lie(disk, k_a, 1e9, top), 1.0, 1.0, 1.0).positions
    x = x - [x[:, 0].mean(), x[:, 1].min()]
    rim = disk.disk_surface
    # All that may touch: within two of Hertz's half-widths, and two points more on either side.
    reach = 2.0 * np.sqrt(4.0 * top / (np.pi * k_a)) + 4.0 * np.pi / len(rim)
    near = rim[(np.abs(x[rim, 0]) < reach) & (x[rim, 1] < 1.0)]

    # Three supports, which bear nothing but the torque of a contact beside the centre of mass.
    left, right = rim[np.argmin(x[rim, 0])], rim[np.argmax(x[rim, 0])]
    free = np.setdiff1d(np.arange(x.size), [2 * left, 2 * left + 1, 2 * right + 1])
    outer = np.isin(disk.bonds, rim).all(axis=1)
    stiffness = tangent_stiffness(x, disk.bonds, disk.rest_lengths, k_a, 0.0)
    stiffness -= (1.0 - rim_share) * tangent_stiffness(x, disk.bonds[outer], disk.rest_lengths[outer], k_a, 0.0)
    factor = splu(
        stiffness[free][:, free].tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )

    def heights(force: Array) -> Array:
        """Vertical displacements (n, k) under vertical forces (n, k)."""
        both = np.zeros((x.size, force.shape[1]))
        both[1::2] = force
        moved = np.zeros_like(both)
        moved[free] = factor.solve(both[free])
        return moved[1::2]

    pushes = np.zeros((len(x), len(near)))
    pushes[near, np.arange(len(near))] = 1.0
    push = heights(pushes)
    weight = heights(np.full((len(x), 1), -1.0 / len(x)))[:, 0]
    return [_sink(x[near, 1], push, weight, near, P) for P in pressures]


def _sink(room: Array, push: Array, weight: Array, near: NDArray[np.int32], pressure: float) -> float:
    """How far the centre of mass comes down on the wall, points `near` having `room` (k,) [R] above it."""
    touching = room <= np.sort(room)[1]
    while True:
        size = int(touching.sum())
        system = np.ones((size + 1, size + 1))
        system[:size, :size] = push[near[touching]][:, touching]
        system[size, size] = 0.0
        wanted = np.append(-room[touching] - pressure * weight[near[touching]], pressure)
        *force, shift = np.linalg.solve(system, wanted)
        moved = push[:, touching] @ np.array(force) + pressure * weight + shift
        pulled = touching.copy()
        pulled[touching] = np.array(force) < 0.0
        sunk = ~touching & (room + moved[near] < -1e-12)
        if not (pulled.any() or sunk.any()):
            return -float(moved.mean())
        touching = (touching & ~pulled) | sunk
