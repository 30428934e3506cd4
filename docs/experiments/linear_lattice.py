"""Restitution of the lattice without dashpots, its springs replaced by the stiffness
matrix of the unloaded lattice.

    python docs/experiments/linear_lattice.py [points] [lattices] >
    docs/data/linear_lattice.csv

The difference from the lattice is the effect of finite strains and rotations; that from
disk_modes.py is the effect of the lattice.
"""

import sys

import numpy as np
from scipy.sparse import csr_matrix, diags
from scipy.sparse.linalg import eigsh

from taichi_disk.mechanics.lattice import Lattice


def restitution(points: int, seed: int, velocity: float, a: float = 3000.0) -> float:
    """Return e on the wall exp(-a y) per point, with k_a = 1, by velocity Verlet."""
    lattice = Lattice.disk(points, seed)
    x, (i, j), m = lattice.positions, lattice.bonds.T, len(lattice.bonds)
    direction = (x[i] - x[j]) / lattice.rest_lengths[:, None]
    rows = np.repeat(np.arange(m), 4)
    columns = np.stack([2 * i, 2 * i + 1, 2 * j, 2 * j + 1], axis=1).ravel()
    stretch = csr_matrix(
        (np.hstack([direction, -direction]).ravel(), (rows, columns)),
        shape=(m, 2 * points),
    )
    # over the mass of a point
    stiffness = (points * (stretch.T @ diags(np.ones(m)) @ stretch)).tocsr()
    fastest = float(eigsh(stiffness, k=1, return_eigenvectors=False)[0])
    dt = 0.8 / np.sqrt(fastest + (2.0 * a * velocity) ** 2)

    height = x[:, 1] - x[:, 1].min()
    near = np.flatnonzero(height < 0.5)
    gap = float(np.log(np.exp(-a * height).sum() / (1e-10 * 0.5 * velocity**2))) / a
    height = height[near] + gap
    u, v = np.zeros_like(x), np.tile([0.0, -velocity], (points, 1))

    def acceleration() -> np.ndarray:
        f = -(stiffness @ u.ravel()).reshape(-1, 2)
        f[near, 1] += points * a * np.exp(-a * (height + u[near, 1]))
        return f

    pull = acceleration()
    while not (v[:, 1].mean() > 0.0 and (height + u[near, 1]).min() > gap + velocity):
        v += 0.5 * dt * pull
        u += dt * v
        pull = acceleration()
        v += 0.5 * dt * pull
    energy = 0.5 * float((v**2).sum() + u.ravel() @ (stiffness @ u.ravel())) / points
    assert abs(energy / (0.5 * velocity**2) - 1.0) < 1e-3
    return float(v[:, 1].mean()) / velocity


if __name__ == "__main__":
    points, lattices = map(int, sys.argv[1:] + ["4396", "4"][len(sys.argv) - 1 :])
    print("points,lattices,velocity,e,error")
    for velocity in (3e-3, 7.5e-3, 2e-2, 5e-2):
        e = np.array([restitution(points, seed, velocity) for seed in range(lattices)])
        error = e.std(ddof=1) / len(e) ** 0.5
        print(f"{points},{lattices},{velocity},{e.mean():.6f},{error:.6f}", flush=True)
