"""Where the wall touches the disk, and how hard: for pictures. What moves the disk is in `model`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taichi_disk.lattice import Lattice
from taichi_disk.model.physics import Physics

Array = NDArray[np.float64]


def contact_forces(lattice: Lattice, physics: Physics, x: Array) -> tuple[NDArray[np.intp], Array]:
    """(points (k,), forces (k, 2) [M c^2/R]) of the wall on the disk's points, with points at `x` (n, 2) [R].

    Rigid wall: a V0 exp(-a y), eq. (6). Elastic wall: a V0 exp(-a l) along the normal of the spring below, for
    points of the disk's surface nearer to it than the threshold. Points out of reach are left out.
    """
    strength = physics.a * physics.V0
    if physics.wall == "rigid":
        points = np.flatnonzero(x[: lattice.disk_points, 1] < physics.reach)
        return points, np.stack([np.zeros(len(points)), strength * np.exp(-physics.a * x[points, 1])], axis=1)
    points, chain = np.asarray(lattice.disk_surface, dtype=np.intp), x[lattice.wall_surface]
    # The first spring that ends beyond the point: the chain's points keep their order in x.
    right = np.searchsorted(chain[:, 0], x[points, 0], side="right")
    over = (right > 0) & (right < len(chain))
    points, right = points[over], right[over]
    along = chain[right] - chain[right - 1]
    normal = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    distance = ((x[points] - chain[right - 1]) * normal).sum(axis=1)
    near = distance < physics.threshold
    return points[near], (strength * np.exp(-physics.a * distance[near]))[:, None] * normal[near]
