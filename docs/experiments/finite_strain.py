"""The error of the exact law of compression, which assumes small strains, for a
continuum of the lattice's springs.

    python docs/experiments/finite_strain.py     (half a minute; needs `pip install
    scikit-fem`)

The continuum has equally many springs of all directions, which are stretched like the
material (Cauchy and Born): W = 3 E/2 <(|F e| - 1)^2> per area, with the mean over
directions e and the deformation gradient F. For small strains this is plane stress with
E and nu = 1/3. A disk of this material is pressed on a hard wall, with linear
triangles, Newton's method, and contact at the nodes. Neither the lattice nor the
exponential wall is used.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay
from skfem import (
    Basis,
    BilinearForm,
    ElementTriP1,
    ElementVector,
    LinearForm,
    MeshTri,
    condense,
    solve,
)
from skfem.helpers import ddot, grad

from taichi_disk.experiments.scenes.compression import exact_compression

Array = NDArray[np.float64]

POISSON = 1.0 / 3.0
# directions of springs; their mean of a fourth power of e is exact for 3 or more
ANGLES = np.arange(12) * np.pi / 12
E = np.stack([np.cos(ANGLES), np.sin(ANGLES)])  # (2, directions)
RAYS = 32  # rays of the finer mesh


def springs(w: Any) -> tuple[Array, Array]:
    """Return the stress P and its slope dP/dF of springs of unit modulus, at the
    displacements w.u."""
    F = grad(w.u) + np.eye(2)[:, :, None, None]
    spring = np.einsum("ij...,jd->id...", F, E)
    length = np.sqrt((spring**2).sum(axis=0))
    along = spring / length
    stress = 3.0 / 12 * np.einsum("d...,id...,jd->ij...", length - 1.0, along, E)
    each = (
        np.eye(2)[:, :, None, None, None] * (1.0 - 1.0 / length)
        + along[:, None] * along[None] / length
    )
    return stress, 3.0 / 12 * np.einsum(
        "ikd...,jd,ld->ijkl...", each, E, E, optimize=True
    )


@LinearForm
def resistance(v: Any, w: Any) -> Any:
    return ddot(springs(w)[0], grad(v))


@BilinearForm
def tangent(u: Any, v: Any, w: Any) -> Any:
    return np.einsum(
        "ijkl...,kl...,ij...", springs(w)[1], grad(u), grad(v), optimize=True
    )


@LinearForm
def height(v: Any, _w: Any) -> Any:
    return v[1]


def finite_compression(pressure: float, young: float, rays: int = RAYS) -> float:
    """Return xi [R] under `pressure` [M c^2/R], extrapolated by order 2 from two
    meshes."""
    coarse, fine = (pressed(pressure / young, count) for count in (rays // 2, rays))
    return (4.0 * fine - coarse) / 3.0


def pressed(load: float, rays: int) -> float:
    """Return how far the centre of mass moves down under the total body force `load`,
    in units of E R."""
    mesh, rim = graded_mesh(0.02 * np.sqrt(load), rays)
    basis = Basis(mesh, ElementVector(ElementTriP1()))
    weight = height.assemble(basis)
    weight /= weight.sum()
    _, y = mesh.p
    near = rim[y[rim] < -0.8]
    vertical = basis.nodal_dofs[1, near]
    room = y[near] + 1.0  # height above the wall
    # symmetry
    middle = basis.nodal_dofs[0, [rim[np.argmin(y[rim])], rim[np.argmax(y[rim])]]]
    touching, u = room < 0.3 * load, basis.zeros()
    for _ in range(100):
        now = {"u": basis.interpolate(u)}
        force = resistance.assemble(basis, **now)
        move = basis.zeros()
        move[vertical[touching]] = -room[touching] - u[vertical[touching]]
        held = np.concatenate([middle, vertical[touching]])
        move = solve(
            *condense(
                tangent.assemble(basis, **now), -load * weight - force, x=move, D=held
            )
        )
        u = u + move
        bears = resistance.assemble(basis, u=basis.interpolate(u)) + load * weight
        pulled = touching & (bears[vertical] < 0.0)
        sunk = ~touching & (u[vertical] < -room - 1e-12)
        if np.abs(move).max() < 1e-11 and not (pulled.any() or sunk.any()):
            return -float(weight @ u)
        # update the contact only when the shape has nearly converged
        if np.abs(move).max() < 1e-3:
            touching = (touching & ~pulled) | sunk
    raise ArithmeticError(f"no equilibrium at P = {load:g} E R")


def graded_mesh(smallest: float, rays: int) -> tuple[MeshTri, NDArray[np.intp]]:
    """Return a mesh of the unit disk, fine at (0, -1), and its nodes on the rim.

    It consists of half circles about the origin of the upper half-plane, with radii in
    geometric progression, mapped conformally.
    """
    radius = np.exp(np.arange(np.log(smallest), 4.0, np.pi / rays))
    w = np.concatenate(
        [
            [0.0],
            np.outer(radius, np.exp(1j * np.linspace(0.0, np.pi, rays + 1))).ravel(),
        ]
    )
    # 0 to -i, infinity to i, the real line to the circle
    z = -1j * (1.0 + 1j * w) / (1.0 - 1j * w)
    first = 1 + np.arange(len(radius)) * (rays + 1)
    rim = np.concatenate([[0], first, first + rays])
    z[rim] /= np.abs(z[rim])
    points = np.stack([z.real, z.imag], axis=1)
    corners = Delaunay(points).simplices
    a, b, c = (points[corners[:, k]] for k in range(3))
    twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    good = twice > 1e-14  # three neighbours on the rim may lie on a line
    return MeshTri(points.T.copy(), corners[good].T.copy()), rim


if __name__ == "__main__":
    print("P      xi [R]    over the exact law - 1, E = 1.1")
    for P in (1e-3, 4e-3, 1e-2):
        xi = finite_compression(P, 1.1)
        print(
            f"{P:<5g}  {xi:.6f} "
            f" {xi / float(exact_compression(P, 1.1, POISSON)) - 1.0:+.2%}"
        )
