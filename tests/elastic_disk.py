"""A plane-stress disk on a rigid wall by finite elements: linear triangles, contact node by node.

It shares nothing with the lattice, the wall's exponential, Hertz's pressure or Michell's series.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse.linalg import splu

from taichi_disk.study.finite_elements import Triangles, graded_points


def pressed_disk(pressure: float, young: float, poisson: float, rays: int) -> float:
    """How far the centre of mass of the unit disk comes down on its lowest point [R], small strains."""
    x, rim = graded_points(0.02 * np.sqrt(pressure / young), rays)
    mesh = Triangles(x)
    stiffness, share = mesh.stiffness(young, poisson), mesh.share
    load = np.zeros((len(x), 2))
    load[:, 1] = -pressure * share
    bottom, top = rim[np.argmin(x[rim, 1])], rim[np.argmax(x[rim, 1])]
    near = rim[(x[rim, 1] < -0.8)]
    room = x[near, 1] + 1.0  # how far a point of the rim may sink
    held = np.zeros(x.shape, bool)
    held[[bottom, top], 0] = True  # symmetry
    touching = room < 0.01 * pressure / young
    while True:
        u = np.zeros_like(x)
        u[near[touching], 1] = -room[touching]
        fixed = held.copy()
        fixed[near[touching], 1] = True
        fixed = fixed.ravel()
        rows = stiffness[~fixed]
        push = load.ravel()[~fixed] - rows[:, fixed] @ u.ravel()[fixed]
        flat = u.ravel()
        flat[~fixed] = splu(rows[:, ~fixed].tocsc()).solve(push)
        reaction = (stiffness @ flat).reshape(-1, 2) - load
        pulled = touching & (reaction[near, 1] < 0.0)
        sunk = ~touching & (u[near, 1] < -room - 1e-12)
        if not (pulled.any() or sunk.any()):
            np.testing.assert_allclose(reaction[near, 1].sum(), pressure, rtol=1e-8)
            return -float(share @ u[:, 1])
        touching = (touching & ~pulled) | sunk
