"""A lattice of your own: a perfect triangular one, cut out as a hexagon, thrown at the rigid wall.

python docs/examples/own_lattice.py
"""

import numpy as np

from taichi_disk import load_scene
from taichi_disk.dynamics import move
from taichi_disk.lattice import Lattice, bond_lengths
from taichi_disk.model import runtime
from taichi_disk.model.stability import spectrum
from taichi_disk.progress import QuietProgress
from taichi_disk.scenes import build
from taichi_disk.triangulation import triangulate

k = 8  # points along an edge, less one
i, j = (one.ravel() for one in np.meshgrid(np.arange(-k, k + 1), np.arange(-k, k + 1)))
inside = np.abs(i + j) <= k
points = np.stack([i + 0.5 * j, np.sqrt(0.75) * j], axis=1)[inside] / k
mesh = triangulate(points)
n, none = len(points), np.zeros(0, np.int32)
lengths = bond_lengths(mesh.positions, mesh.bonds)
hexagon = Lattice(mesh.positions, mesh.bonds, lengths, np.full(n, 1 / n), n, mesh.outline, none, none)

runtime.start("cpu")
scene = load_scene("exponential_wall", [f"lattice.points={n}", "material.eta_star=0", "impact.velocity=0.03"])
setup = build(scene, hexagon)
modes = spectrum(setup.lattice, setup.physics)
outcome = move(setup, scene.time, modes, QuietProgress())
e = setup.headline(outcome.columns).values["restitution"]
print(f"{n} points, flat side down: e = {e:.4f}, the rest of the energy vibrates")
