"""Normal restitution of oblique impacts on an elastic wall, after Kuninaka and Hayakawa, PRL 93, 154301 (2004).

    python docs/experiments/oblique.py [lattices] > docs/data/oblique.csv

Means over lattices, for walls softer and stiffer than the disk, both contact laws, plain and rough surfaces. A run is
discarded if it does not end, or if its energy is off at the end by more than DISCARD.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from math import atan, sin
from pathlib import Path

import numpy as np

from taichi_disk import Lattice, Scene, load_scene, runtime

runtime.start()

from taichi_disk.api import shared_kernels  # noqa: E402
from taichi_disk.errors import SimulationError  # noqa: E402
from taichi_disk.simulation.outcome import compute  # noqa: E402

SCENE = Path(__file__).with_suffix(".yaml")
WALLS = (10.0, 1.0, 0.1, 0.02)  # k_a [M c^2/R^2]; the disk's is 1
TANGENTS = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)  # of the angle between flight and normal
DISCARD = 0.02  # of the kinetic energy of the flight towards the wall


def thrown(tangent: float, **wall: float | str) -> Scene:
    """The scene at that angle, with other keys of its wall. An oblique throw lands so much before the wall's middle."""
    angle = atan(tangent)
    keys = {f"wall.{key}": value for key, value in wall.items()}
    return load_scene(str(SCENE)).with_({"impact.angle": angle, "impact.offset": -sin(angle), **keys})


def roughened(body: Lattice, roughness: float, seed: int) -> Lattice:
    """Disk and wall, their surface points moved along the normal by normal noise [R], the same springs unloaded.

    Where a triangle would be flatter than a quarter of what it was, its points of the surface are drawn again. The
    wall goes down until its highest point is at y = 0.
    """
    rng, n = np.random.default_rng([seed, 3]), body.disk_points
    surface = np.concatenate([body.disk_surface, body.wall_surface[1:-1]])  # the corners are held
    normal = np.where((surface < n)[:, None], body.positions[surface] - body.mean(body.positions), [0.0, 1.0])
    normal /= np.hypot(*normal.T)[:, None]
    noise, again = np.zeros(len(surface)), np.ones(len(surface), bool)
    while again.any():
        noise[again] = rng.normal(0.0, roughness, again.sum())
        x = body.positions.copy()
        x[surface] += noise[:, None] * normal
        flat = area(x, body.triangles) < 0.25 * area(body.positions, body.triangles)
        again = np.isin(surface, body.triangles[flat])
    x[n:, 1] -= x[n:, 1].max()
    i, j = body.bonds.T
    return replace(body, positions=x, rest_lengths=np.hypot(*(x[i] - x[j]).T))


def area(x: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    (ax, ay), (bx, by) = ((x[triangles[:, k]] - x[triangles[:, 0]]).T for k in (1, 2))
    return 0.5 * (ax * by - ay * bx)


def restitution(scene: Scene, body: Lattice) -> float:
    """Normal e, not a number if the run is discarded."""
    scenario = scene.scenario(body)
    try:
        outcome = compute(scenario, scene.time, kernels=shared_kernels(), estimate=False)
    except SimulationError:
        return np.nan
    good = abs(outcome.facts["energy"]["closing_imbalance"]) <= DISCARD
    return scenario.result(outcome.columns)["restitution"] if good else np.nan


def body(scene: Scene, roughness: float, seed: int) -> Lattice:
    plain = scene.with_(seed=seed).body()
    return roughened(plain, roughness, seed) if roughness else plain


if __name__ == "__main__":
    lattices = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    print("wall_k_a,contact,roughness,tan_gamma,lattices,discarded,e,error,lowest,highest,above_1")
    for contact in ("springs", "smooth"):
        for roughness in (0.0, 0.03):
            for k_a in WALLS:
                scenes = [thrown(tangent, k_a=k_a, contact=contact) for tangent in TANGENTS]
                bodies = [body(scenes[0], roughness, seed) for seed in range(lattices)]
                for tangent, scene in zip(TANGENTS, scenes, strict=True):
                    found = np.array([restitution(scene, one) for one in bodies])
                    e = found[np.isfinite(found)]
                    error = e.std(ddof=1) / len(e) ** 0.5 if len(e) > 1 else np.nan
                    row = [k_a, contact, roughness, tangent, lattices, lattices - len(e)]
                    row += [f"{one:.4f}" if len(e) else "" for one in (e.mean(), error, e.min(), e.max())]
                    print(*row, np.count_nonzero(e > 1.0), sep=",", flush=True)
