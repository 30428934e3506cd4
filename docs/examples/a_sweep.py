"""A sweep from Python: restitution against speed on three lattices, with the fit of
equation (5).

python docs/examples/a_sweep.py [folder]
"""

import sys

from taichi_disk import load_sweep, run_sweep

SWEEP = """
scene: exponential_wall
lattice: {points: 200}
material: {viscosity: 0.0091}
sweep: {seed: {range: 3}, velocity: {geom: [1.0e-2, 5.0e-2, 4]}}
"""


def main() -> None:
    # You can stop the sweep at any time and start it again: finished scenes are not
    # computed twice.
    result = run_sweep(
        load_sweep(SWEEP), sys.argv[1] if len(sys.argv) > 1 else "out/a_sweep"
    )
    for row in result.rows:
        print(
            f"seed {row['seed']}  v = {row['velocity']:.4f} c  e ="
            f" {row['restitution']:.5f}"
        )
    fit = result.summary["curves"][0]["fits"]["eq5"]
    for name, value in fit["values"].items():
        low, high = fit["intervals_95"][name]
        print(f"{name} = {value:.4f}, between {low:.4f} and {high:.4f} (95 %)")


if __name__ == "__main__":  # the sweep's worker processes import this file
    main()
