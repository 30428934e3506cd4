"""Read the files of a run with NumPy alone: which springs are strained most at the end?

python docs/examples/read_results.py FOLDER
"""

import json
import sys
from pathlib import Path

import numpy as np

folder = Path(sys.argv[1])
summary = json.loads((folder / "summary.json").read_text())
print(
    f"{summary['scene']}: {summary['status']}, {summary['steps']} steps of"
    f" {summary['integrator']}"
)

lattice = np.load(folder / "lattice.npz")
final = np.load(folder / "final.npz")
i, j = lattice["bonds"].T
d = final["positions"][i] - final["positions"][j]
strain = np.hypot(d[:, 0], d[:, 1]) / lattice["rest_lengths"] - 1
worst = np.abs(strain).argmax()
print(
    f"t = {float(final['t']):.3f} R/c: strains from {strain.min():+.2e} to"
    f" {strain.max():+.2e}"
)
print(f"the largest is between points {i[worst]} and {j[worst]}")

energy = 0.5 * np.sum(lattice["masses"][:, None] * final["velocities"] ** 2)
print(
    f"kinetic energy {energy:.6e} M c^2; the energy balance says"
    f" {summary['energy']['kinetic']:.6e}"
)
