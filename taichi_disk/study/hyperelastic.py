"""The pressed disk as a continuum of the lattice's springs at finite strain: how far the exact law errs there.

The continuum: springs of every direction in equal numbers, all stretched as the whole is (Cauchy and Born),
W = 3 E/2 <(|F e| - 1)^2> per area, <> over directions e, F the deformation gradient. For small strains that is
plane stress with E and nu = 1/3.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError
from taichi_disk.study.finite_elements import Sparse, Triangles, graded_points

Array = NDArray[np.float64]
POISSON = 1.0 / 3.0
DIRECTIONS = 12  # of springs: their mean of a fourth power of e is exact from 3 on
RAYS = 32  # of the finer mesh
ITERATIONS = 100


def finite_compression(pressure: float, young: float) -> float:
    """xi [R] of the disk under `pressure` [M c^2/R] on a hard wall, from centre of mass to lowest point.

    Of two meshes, whose error falls as the square of their size. Raises SimulationError when crushed.
    """
    coarse, fine = (_pressed(pressure, young, rays) for rays in (RAYS // 2, RAYS))
    return (4.0 * fine - coarse) / 3.0


def _pressed(pressure: float, young: float, rays: int) -> float:
    """Newton's method, the contact found node by node beside it."""
    from scipy.sparse.linalg import splu

    x, rim = graded_points(0.02 * np.sqrt(pressure / young), rays)
    mesh = Triangles(x)
    near = rim[x[rim, 1] < -0.8]
    room = x[near, 1] + 1.0  # above the wall
    touching = room < 0.3 * pressure / young
    middle = np.zeros(x.shape, bool)
    middle[[rim[np.argmin(x[rim, 1])], rim[np.argmax(x[rim, 1])]], 0] = True  # symmetry
    load = np.zeros_like(x)
    load[:, 1] = -pressure * mesh.share

    u = np.zeros_like(x)
    force, tangent = _springs(mesh, u, young)
    for _ in range(ITERATIONS):
        held = middle.copy()
        held[near[touching], 1] = True
        free = ~held.ravel()
        move = np.zeros_like(x)
        move[near[touching], 1] = -room[touching] - u[near[touching], 1]
        left = (load - force).ravel() - tangent @ move.ravel()
        move.ravel()[free] = splu(tangent[free][:, free].tocsc()).solve(left[free])
        u += move
        force, tangent = _springs(mesh, u, young)
        bears = (force - load)[near, 1]
        pulled = touching & (bears < 0.0)
        sunk = ~touching & (u[near, 1] < -room - 1e-12)
        size = np.abs(move).max()
        if size < 1e-11 and not (pulled.any() or sunk.any()):
            return -float(mesh.share @ u[:, 1])
        if size < 1e-3:  # not before the shape is about that of the contact so far
            touching = (touching & ~pulled) | sunk
    raise SimulationError(f"no equilibrium of the continuum at P = {pressure:g}, E = {young:g}")


def _springs(mesh: Triangles, u: Array, young: float) -> tuple[Array, Sparse]:
    """Forces (n, 2) with which the continuum resists the displacements u (n, 2), and their slope (2n, 2n)."""
    angle = np.arange(DIRECTIONS) * np.pi / DIRECTIONS
    e = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    weight = 3.0 * young / DIRECTIONS
    gradient = np.eye(2) + np.einsum("tni,tnj->tij", u[mesh.corners], mesh.slopes)
    spring = np.einsum("tij,dj->tdi", gradient, e)
    length = np.linalg.norm(spring, axis=2, keepdims=True)
    along = spring / length
    stress = weight * np.einsum("tdi,dj->tij", (length - 1.0) * along, e)
    force = np.zeros_like(u)
    np.add.at(force, mesh.corners, mesh.area[:, None, None] * np.einsum("tij,tnj->tni", stress, mesh.slopes))

    cross = along[..., :, None] * along[..., None, :] / length[..., None]
    each = weight * ((1.0 - 1.0 / length)[..., None] * np.eye(2) + cross)
    moduli = np.einsum("tdik,dj,dl->tijkl", each, e, e)
    blocks = np.einsum("t,tnj,tijkl,tml->tnimk", mesh.area, mesh.slopes, moduli, mesh.slopes, optimize=True)
    return force, mesh.matrix(blocks.reshape(-1, 6, 6))
