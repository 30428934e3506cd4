"""How a core changes the restitution: its stiffness and its density, each over a
hundredfold range.

python docs/examples/composite_sweep.py [folder]
"""

import sys

from taichi_disk import load_sweep, run_sweep

SWEEP = """
scene: exponential_wall
lattice: {points: 300, core_radius: 0.6}
material: {eta_star: 0}
impact: {velocity: 0.05}
sweep:
  core_stiffness: {geom: [0.1, 10.0, 3]}
  core_density: {geom: [0.1, 10.0, 3]}
  seed: {range: 2}
"""


def main() -> None:
    result = run_sweep(
        load_sweep(SWEEP), sys.argv[1] if len(sys.argv) > 1 else "out/composite_sweep"
    )
    found: dict[tuple[float, float], list[float]] = {}
    for row in result.rows:
        found.setdefault((row["core_stiffness"], row["core_density"]), []).append(
            row["restitution"]
        )
    print("core: k ×   rho ×   e (mean of the lattices)")
    for (stiffness, density), each in found.items():
        print(f"{stiffness:9g} {density:7g}   {sum(each) / len(each):.4f}")


if __name__ == "__main__":  # the sweep's worker processes import this file
    main()
