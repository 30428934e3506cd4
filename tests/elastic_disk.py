"""A plane-stress disk on a rigid wall by finite elements: linear triangles, contact node by node.

It shares nothing with the lattice, the wall's exponential, Hertz's pressure or Michell's series.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import splu
from scipy.spatial import Delaunay


def pressed_disk(pressure: float, young: float, poisson: float, rays: int) -> float:
    """How far the centre of mass of the unit disk comes down on its lowest point [R], small strains."""
    x, rim = graded_points(0.02 * np.sqrt(pressure / young), rays)
    stiffness, share = assemble(x, young, poisson)
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


def graded_points(smallest: float, rays: int) -> tuple[np.ndarray, np.ndarray]:
    """Points of the disk, fine at (0, -1), and the indices of those on its rim.

    Half circles about the origin of the upper half-plane, of radii in geometric progression, mapped conformally.
    """
    ratio = np.pi / rays
    radius = np.exp(np.arange(np.log(smallest), 4.0, ratio))
    angle = np.linspace(0.0, np.pi, rays + 1)
    w = np.concatenate([[0.0], np.outer(radius, np.exp(1j * angle)).ravel()])
    z = -1j * (1.0 + 1j * w) / (1.0 - 1j * w)  # 0 to -i, infinity to i, the real line to the circle
    first = 1 + np.arange(len(radius)) * (rays + 1)
    rim = np.concatenate([[0], first, first + rays])
    z[rim] /= np.abs(z[rim])
    return np.stack([z.real, z.imag], axis=1), rim


def assemble(x: np.ndarray, young: float, poisson: float):
    """Stiffness matrix (2n, 2n) of plane stress, and each point's share of the disk's area."""
    corners = Delaunay(x).simplices
    a, b, c = (x[corners[:, k]] for k in range(3))
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    good = twice > 1e-14
    corners, twice = corners[good], twice[good]
    a, b, c = a[good], b[good], c[good]
    grad = np.stack([b - c, c - a, a - b], axis=1)[:, :, ::-1] * np.array([1.0, -1.0]) / twice[:, None, None]
    strain = np.zeros((len(corners), 3, 6))
    strain[:, 0, 0::2] = strain[:, 2, 1::2] = grad[:, :, 0]
    strain[:, 1, 1::2] = strain[:, 2, 0::2] = grad[:, :, 1]
    law = young / (1 - poisson**2) * np.array([[1, poisson, 0], [poisson, 1, 0], [0, 0, (1 - poisson) / 2]])
    block = 0.5 * twice[:, None, None] * np.einsum("tai,ab,tbj->tij", strain, law, strain)
    dof = np.stack([2 * corners, 2 * corners + 1], axis=2).reshape(-1, 6)
    row, column = np.repeat(dof, 6, axis=1).ravel(), np.tile(dof, (1, 6)).ravel()
    stiffness = coo_matrix((block.ravel(), (row, column)), shape=(2 * len(x), 2 * len(x))).tocsr()
    share = np.bincount(corners.ravel(), np.repeat(twice / 6.0, 3), minlength=len(x))
    return stiffness, share / share.sum()
