"""A ring under its own weight on a rigid wall, compared with the closed form of a thin
ring.

python docs/examples/ring.py
"""

from math import pi

from taichi_disk import load_scene, run
from taichi_disk.mechanics.lattice import bulk_moduli

LOAD, POINTS = 1e-6, 2000  # [M c^2/R], so small that the ring deforms linearly

# An inextensible ring of radius r: xi = P r^3/(pi EI) (pi^2/12 - 11/16), after
# Timoshenko, Strength of Materials II.
for hole in (0.5, 0.7, 0.8, 0.9):
    scene = load_scene("compression").with_(
        points=POINTS, hole=hole, pressure=LOAD, method="newton"
    )
    result = run(scene)
    young = bulk_moduli(POINTS, 0, scene.material.k_a, scene.lattice.min_spacing).young
    radius, thick, spacing = (
        0.5 * (1.0 + hole),
        1.0 - hole,
        float(result.lattice.rest_lengths.mean()),
    )
    # A spring on the outline belongs to one triangle but is as stiff as the others: a
    # skin of half a spring.
    bending = young * thick**3 / 12.0 + scene.material.k_a * spacing * thick**2 / 4.0
    thin = LOAD * radius**3 / (pi * bending) * (pi**2 / 12.0 - 11.0 / 16.0)
    print(
        f"hole {hole:g} R: xi/P = {result.xi / LOAD:.4g} R^2/(M c^2), thin ring"
        f" {thin / LOAD:.4g}"
    )
