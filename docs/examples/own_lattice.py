"""A lattice of your own: a hexagon of a perfect triangular lattice, thrown at the rigid
wall.

python docs/examples/own_lattice.py
"""

import numpy as np

from taichi_disk import Lattice, load_scene, run

k = 8  # springs along an edge
i, j = (
    indices.ravel()
    for indices in np.meshgrid(np.arange(-k, k + 1), np.arange(-k, k + 1))
)
inside = np.abs(i + j) <= k
hexagon = Lattice.from_points(
    np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=1)[inside] / k
)

result = run(
    load_scene("exponential_wall").with_(eta_star=0, velocity=0.03), lattice=hexagon
)
print(
    f"{hexagon.disk_points} points, flat side down: e = {result.restitution:.4f}, the"
    " rest of the energy vibrates"
)
