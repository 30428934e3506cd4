"""One impact: choose numbers, run it, read what came out.

python docs/examples/one_impact.py [folder]
"""

import sys

import numpy as np

from taichi_disk import load_scene, run

out = sys.argv[1] if len(sys.argv) > 1 else "out/one_impact"

# A shipped scene with some keys changed; `taichi-disk check exponential_wall` lists all keys.
scene = load_scene("exponential_wall", ["lattice.points=300", "material.eta_star=10", "impact.velocity=0.03"])
result = run(scene, out, video=False)

print(f"restitution  {result.headline['restitution']:.5f}")
print(f"contact time {result.headline['contact_time']:.3f} R/c")

# The time series, one column per quantity, named in the first line.
series = np.genfromtxt(result.out / "timeseries.csv", delimiter=",", names=True)
peak = series["wall_force"].argmax()
print(f"largest force of the wall {series['wall_force'][peak]:.4g} M c^2/R at t = {series['t'][peak]:.3f} R/c")
loss = series["dissipated"][-1] / series["kinetic"][0]
print(f"the dashpots took {loss:.1%} of the kinetic energy")
