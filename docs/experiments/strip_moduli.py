"""Moduli of the lattice in the bulk, and the apparent Poisson ratio of a short, wide
strip held by its grips.

    python docs/experiments/strip_moduli.py      (ten seconds)

The paper's nu = 0.075 is not a bulk value; a clamped strip four times as wide as long
has a similar value.
"""

from __future__ import annotations

import numpy as np

from taichi_disk.mechanics.lattice.network import bulk_moduli, rectangle, stretch

SEEDS, LENGTH, WIDTH = 8, 0.9, 3.6


def moduli(spacing: float, seed: int, points: int = 1000) -> tuple[float, float, float]:
    """Return E/k_a and nu of a square sample, and the apparent nu of the strip;
    `spacing` is `lattice.min_spacing`."""
    bulk, strip = (
        bulk_moduli(points, seed, 1.0, spacing),
        rectangle(points, seed, spacing, LENGTH, WIDTH),
    )
    x, y = strip.positions.T
    rise = stretch(strip, 1.0, x == 0.0, x == LENGTH, clamped=True)[:, 1]
    narrowing = rise[y == 0.0].mean() - rise[y == WIDTH].mean()
    return bulk.young, bulk.poisson, narrowing / WIDTH


if __name__ == "__main__":
    print(
        "least spacing  E/k_a          nu             apparent nu of the strip   (mean"
        f" ± deviation of {SEEDS} seeds)"
    )
    for spacing in (0.7, 0.35, 0.0):
        found = np.array([moduli(spacing, seed) for seed in range(SEEDS)])
        cells = [
            f"{mean:.3f} ± {scatter:.3f}"
            for mean, scatter in zip(found.mean(0), found.std(0, ddof=1), strict=True)
        ]
        print(f"{spacing:<13g}  " + "  ".join(cells))
