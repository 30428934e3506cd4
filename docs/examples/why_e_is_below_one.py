"""Why a disk without dashpots comes back slower than it arrived: its normal modes go on
vibrating.

python docs/examples/why_e_is_below_one.py [picture]
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

from taichi_disk import load_scene, run

result = run(load_scene("exponential_wall").with_(eta_star=0, velocity=0.1))
modes, energy = result.modes(40), result.summary["energy"]
flight = result.series["translation"][0]
taken, lost = modes.energies / flight, 1.0 - result.restitution**2

print(
    f"1 - e^2 = {lost:.5f}; in vibration {energy['vibration_left']:.5f}, rotation"
    f" {energy['rotation'] / flight:.5f}"
)
print(
    f"the 40 lowest modes {taken.sum():.5f}, higher {modes.rest / flight:.5f}", end=", "
)
print(f"anharmonic {modes.anharmonic / flight:+.5f}")
strongest = np.argsort(taken)[:-4:-1]
for k in strongest:
    print(f"omega = {modes.frequencies[k]:.3f} c/R took {taken[k]:.5f}")

plt.rc("font", size=13)
plt.rc("legend", frameon=False)
plt.rc("axes.spines", top=False, right=False)
figure, axes = plt.subplot_mosaic("aaa;bcd", figsize=(7.2, 6.0), layout="constrained")
axes["a"].vlines(modes.frequencies, 0, 100 * taken, color="#00806A", linewidth=3)
axes["a"].plot(modes.frequencies, 100 * taken, "o", color="#00806A", label="each mode")
axes["a"].step(
    modes.frequencies,
    100 * taken.cumsum(),
    where="post",
    color="#C23F00",
    label="all up to here",
)
axes["a"].axhline(100 * lost, color="0.4", linestyle="--", label="1 − e²")
axes["a"].set(
    xlabel="frequency ω  [c/R]", ylabel="energy of vibration\n/ flight before  [%]"
)
axes["a"].legend()
rim = np.append(result.lattice.disk_surface, result.lattice.disk_surface[0])
for ax, k in zip((axes[name] for name in "bcd"), strongest, strict=True):
    at_rest, shape = result.lattice.positions[rim], modes.shapes[k, rim]
    ax.plot(*at_rest.T, color="0.7")
    for sign in (-0.1, 0.1):
        ax.plot(*(at_rest + sign * shape).T, color="#00806A")
    ax.set_title(
        f"ω = {modes.frequencies[k]:.2f} c/R: {100.0 * taken[k]:.2f} %", fontsize=13
    )
    ax.set(aspect="equal")
    ax.axis("off")
figure.savefig(sys.argv[1] if len(sys.argv) > 1 else "why_e_is_below_one.png", dpi=100)
