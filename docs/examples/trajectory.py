"""States at any time as NumPy arrays: the motion of the top of the disk, and the most
strained spring.

python docs/examples/trajectory.py
"""

import numpy as np

from taichi_disk import load_scene, run

result = run(load_scene("exponential_wall").with_(points=300, eta_star=0))
times, positions, velocities = result.trajectory(
    np.linspace(0.0, result.series["t"][-1], 50)
)
print(f"positions {positions.shape}, velocities {velocities.shape}")

top = positions[0, :, 1].argmax()
print(
    f"the top comes down by {positions[0, top, 1] - positions[:, top, 1].min():.4f} R"
)

tightest = result.series["t"][result.series["elastic"].argmax()]
strain = result.field("strain", tightest).values  # strain of each spring
i, j = result.lattice.bonds[np.abs(strain).argmax()]
print(
    f"at t = {tightest:.3f} R/c the spring between points {i} and {j} is strained most,"
    f" by {strain.min():+.2%}"
)
pressure = result.field("pressure", tightest)  # pressure of each triangle
print(f"the largest pressure is {pressure.values.max():.3g} {pressure.unit}")
