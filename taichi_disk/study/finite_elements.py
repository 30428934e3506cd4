"""A continuous disk in linear triangles: what the lattice is compared with where no closed form is known.

Shares nothing with the lattice: neither springs nor points, nor how they are put together.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Sparse = Any  # scipy.sparse.csr_matrix, which has no type stubs


class Triangles:
    """A mesh of the unit disk from its points (n, 2) [R].

    Attributes:
        points: (n, 2) [R].
        corners: (t, 3) indices, counter-clockwise.
        area: (t,) [R^2].
        slopes: (t, 3, 2) gradients of the corners' linear functions [1/R].
        share: (n,) each point's share of the whole area.
    """

    def __init__(self, points: Array) -> None:
        from scipy.spatial import Delaunay

        corners = Delaunay(points).simplices
        a, b, c = (points[corners[:, k]] for k in range(3))
        twice = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        good = twice > 1e-14  # three neighbours on the rim may lie on a line
        a, b, c, twice = a[good], b[good], c[good], twice[good]
        self.points = points
        self.corners: Indices = corners[good]
        self.area = 0.5 * twice
        turned = np.stack([b - c, c - a, a - b], axis=1)[:, :, ::-1]
        self.slopes = turned * np.array([1.0, -1.0]) / twice[:, None, None]
        share = np.bincount(self.corners.ravel(), np.repeat(twice / 6.0, 3), minlength=len(points))
        self.share = share / share.sum()

    def matrix(self, blocks: Array) -> Sparse:
        """The (2n, 2n) matrix of the triangles' own (t, 6, 6), whose rows are x and y of corner after corner."""
        from scipy.sparse import coo_matrix

        dof = np.stack([2 * self.corners, 2 * self.corners + 1], axis=2).reshape(-1, 6)
        row, column = np.repeat(dof, 6, axis=1).ravel(), np.tile(dof, (1, 6)).ravel()
        return coo_matrix((blocks.ravel(), (row, column)), shape=(2 * len(self.points),) * 2).tocsr()

    def stiffness(self, young: float, poisson: float) -> Sparse:
        """Of plane stress at small strains, from E [M c^2/R^2] and nu."""
        strain = np.zeros((len(self.corners), 3, 6))
        strain[:, 0, 0::2] = strain[:, 2, 1::2] = self.slopes[:, :, 0]
        strain[:, 1, 1::2] = strain[:, 2, 0::2] = self.slopes[:, :, 1]
        shear = 0.5 * (1.0 - poisson)
        law = young / (1.0 - poisson**2) * np.array([[1.0, poisson, 0.0], [poisson, 1.0, 0.0], [0.0, 0.0, shear]])
        return self.matrix(self.area[:, None, None] * np.einsum("tai,ab,tbj->tij", strain, law, strain))


def graded_points(smallest: float, rays: int) -> tuple[Array, Indices]:
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


def ring_points(rings: int) -> tuple[Array, Indices]:
    """About 3 rings^2 points of the disk, evenly dense on circles, and the indices of those on its rim."""
    points = [np.zeros((1, 2))]
    for k in range(1, rings + 1):
        angle = 2.0 * np.pi * (np.arange(6 * k) + 0.5 * (k % 2)) / (6 * k) - 0.5 * np.pi
        points.append(k / rings * np.stack([np.cos(angle), np.sin(angle)], axis=1))
    x = np.concatenate(points)
    return x, np.arange(len(x) - 6 * rings, len(x))
