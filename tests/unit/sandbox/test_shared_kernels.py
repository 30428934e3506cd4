"""Sandboxes that share compiled simulations: each goes on as if it were alone."""

import numpy as np
import pytest

from taichi_disk.experiments.scenes import load_scene
from taichi_disk.sandbox.sandbox import Sandbox

pytestmark = pytest.mark.usefixtures("kernels")  # Taichi has started
SMALL = ["lattice.points=120", "impact.velocity=0.05"]
SCENES = [
    ("exponential_wall", [*SMALL, "material.eta_star=1"]),
    ("exponential_wall", [*SMALL, "material.eta_star=1", "lattice.seed=3"]),
    ("exponential_wall", [*SMALL, "material.eta_star=90"]),  # implicit dashpots
    ("exponential_wall", [*SMALL, "material.eta_star=90", "impact.velocity=0.08"]),
    ("exponential_wall", [*SMALL, "lattice.points=300", "material.eta_star=1"]),
]


def moved(sandbox, k):
    """Let a picture's time pass, and do what belongs to picture `k`."""
    if k == 10:
        sandbox.pull(0.3, 2.4)
    elif k == 15:
        sandbox.pull(0.6, 2.6)
    elif k == 20:
        sandbox.release()
    elif k == 30:
        sandbox.set("material.eta_star", 2.0)
    elif k == 40:
        sandbox.step(-4)
        sandbox.pause()
    sandbox.advance(0.06, np.inf)


def ends(kernels, scenes):
    """Return what the sandboxes of `scenes` show after fifty pictures each."""
    boxes = [Sandbox(load_scene(*one)) for one in scenes]
    for one in boxes:
        one.pause()
    for k in range(50):
        for one in boxes:
            moved(one, k)
    return [one.time.display for one in boxes]


def test_sandboxes_in_turn_move_as_each_does_alone(kernels):
    together = ends(kernels, SCENES)
    for scene, end in zip(SCENES, together, strict=True):
        (alone,) = ends(kernels, [scene])
        assert np.array_equal(alone.row, end.row)
        assert np.array_equal(alone.x, end.x)
