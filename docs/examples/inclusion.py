"""A disk with an off-centre inclusion, stiffer, softer or heavier: it comes back
spinning.

python docs/examples/inclusion.py [picture.png]
"""

import sys

import numpy as np

from taichi_disk import Lattice, load_scene, run

disk, scene = (
    Lattice.disk(500, seed=1),
    load_scene("exponential_wall").with_(eta_star=0, velocity=0.05),
)
middle = disk.positions[disk.bonds].mean(axis=1)
points, springs = (
    np.hypot(x - 0.35, y + 0.2) < 0.4 for x, y in (disk.positions.T, middle.T)
)

for name, stiffness, density in (
    ("none", 1.0, 1.0),
    ("stiff", 20.0, 1.0),
    ("soft", 0.05, 1.0),
    ("heavy", 1.0, 10.0),
):
    body = Lattice.from_points(
        disk.positions,
        disk.bonds,
        # times k_a, k_b and eta of each spring
        stiffness=np.where(springs, stiffness, 1.0),
        masses=np.where(points, density, 1.0),  # scaled to a total of 1 M
    )
    result = run(scene, lattice=body)
    aside = body.mean(body.positions)[0]  # x of the centre of mass
    spin = result.series["angular_momentum"][-1]
    print(
        f"{name:6} e = {result.restitution:.4f}, centre of mass at x = {aside:+.3f} R,"
        f" spin after {spin:+.5f} M R c"
    )
    if name == "stiff" and len(sys.argv) > 1:
        result.film(sys.argv[1])  # one picture, at the greatest compression
