"""tau0 of equation (4) from the dashpots of the lattice, not fitted: 0.0039 eta* R/c
for N = 1099.

    python docs/experiments/contact_viscosity.py [points] [lattices] [a]

The dashpots have the matrix eta L, where L is the graph Laplacian of the springs; K is
the stiffness matrix. If all points move as u, the ratio of dissipated and elastic power
is tau0 = eta u.L u/(u.K u). Here u is the change of shape of a pressed disk when the
load changes, as in the middle of a slow impact.
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.sparse import identity
from scipy.sparse.linalg import splu

from taichi_disk import load_scene
from taichi_disk.mechanics.lattice.network import laplacian


def contact_viscosity(points: int, seed: int, a: float) -> float:
    """Return tau0/eta* [R/c] of a default lattice under P = 0.01 M c^2/R on a wall of
    hardness a [1/R]."""
    scene = load_scene("compression").with_(
        points=points, seed=seed, a=a, method="newton"
    )
    scenario = scene.scenario()
    lattice, model, rest = scenario.lattice, scenario.model, scenario.rest.positions
    shift = 1e-9 * identity(rest.size)  # the disk slides freely
    factor = splu((model.stiffness(lattice, rest) + shift).tocsc())
    arm = rest - rest.mean(axis=0)
    turn = np.stack([-arm[:, 1], arm[:, 0]], axis=1).ravel()
    motion, roll = (
        factor.solve(np.tile([0.0, -1.0 / points], points)),
        factor.solve(turn),
    )
    # an impact is too short for the disk to roll
    motion -= roll * (turn @ motion) / (turn @ roll)
    springs, dashpots = model.springs.stiffness(lattice, rest), laplacian(lattice)
    u = motion.reshape(-1, 2)
    return float(np.sum(u * (dashpots @ u)) / (motion @ (springs @ motion))) / points


if __name__ == "__main__":
    points, lattices, a = map(
        int, sys.argv[1:] + ["1099", "4", "300"][len(sys.argv) - 1 :]
    )
    found = np.array([contact_viscosity(points, seed, a) for seed in range(lattices)])
    each = ", ".join(f"{value:.3e}" for value in found)
    print(
        f"tau0/eta* = {found.mean():.3e} R/c, mean of {lattices}; lattice by lattice"
        f" {each}"
    )
