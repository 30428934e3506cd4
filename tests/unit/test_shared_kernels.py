"""Sandboxes that share compiled simulations: each goes on as if it were alone."""

from __future__ import annotations

import numpy as np
import pytest

from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window import history
from taichi_disk.window.history import Memory
from taichi_disk.window.sandbox import Experiment, Sandbox

pytestmark = pytest.mark.usefixtures("kernels")  # Taichi has started
SMALL = ["lattice.points=120", "impact.velocity=0.05"]
SCENES = [
    ("exponential_wall", [*SMALL, "material.eta_star=1"]),
    ("exponential_wall", [*SMALL, "material.eta_star=1", "lattice.seed=3"]),
    ("exponential_wall", [*SMALL, "material.eta_star=90"]),  # implicit dashpots
    ("exponential_wall", [*SMALL, "material.eta_star=90", "impact.velocity=0.08"]),
    ("exponential_wall", [*SMALL, "lattice.points=300", "material.eta_star=1"]),
]


def moved(sandbox: Sandbox, k: int) -> None:
    """Let a picture's time pass; after some pictures the mouse pulls a point, another
    viscosity is set, time goes back."""
    if k == 30:
        sandbox.pull(0.3, 2.4)
    elif k == 45:
        sandbox.pull(0.6, 2.6)
    elif k == 60:
        sandbox.release()
    elif k == 80:
        sandbox.set("material.eta_star", 2.0)
    elif k == 100:
        sandbox.step(-4)
        sandbox.pause()
    sandbox.advance(0.03, np.inf)


def test_sandboxes_in_turn_move_as_each_does_alone(kernels: KernelCache) -> None:
    ends = []
    for count in (1, len(SCENES)):
        groups = [SCENES] if count > 1 else [[one] for one in SCENES]
        for group in groups:
            boxes = [Sandbox(load_scene(*one), kernels) for one in group]
            for one in boxes:
                one.pause()
            for k in range(160):
                for one in boxes:
                    moved(one, k)
            ends += [(one.time.display.row, one.time.display.x) for one in boxes]
    for alone, together in zip(ends[: len(SCENES)], ends[len(SCENES) :], strict=True):
        assert np.array_equal(alone[0], together[0])
        assert np.array_equal(alone[1], together[1])


@pytest.mark.validate
def test_a_simulation_that_a_larger_lattice_replaces_goes_on_from_its_state() -> None:
    kernels = KernelCache()
    small = Sandbox(load_scene("exponential_wall", SCENES[0][1]), kernels)
    small.pause()
    alone = Sandbox(load_scene("exponential_wall", SCENES[0][1]), KernelCache())
    alone.pause()
    for k in range(40):
        if k == 20:  # more than the smallest capacity
            Sandbox(
                load_scene("exponential_wall", [*SCENES[0][1], "lattice.points=13000"]),
                kernels,
            )
        for one in (small, alone):
            one.advance(0.03, np.inf)
    assert np.array_equal(small.time.display.x, alone.time.display.x)


def test_only_undisturbed_experiments_are_reported(kernels: KernelCache) -> None:
    told: list[Experiment] = []
    sandbox = Sandbox(
        load_scene("exponential_wall", SCENES[0][1]), kernels, report=told.append
    )
    for disturbed in (False, True):
        sandbox.begin()
        sandbox.pause()
        sandbox.advance(0.3, np.inf)
        if disturbed:
            sandbox.set("material.eta_star", 2.0)
        while not sandbox.paused:
            sandbox.advance(1.0, np.inf)
    assert len(sandbox.results) == 2 and told == sandbox.results[:1]


@pytest.mark.parametrize("sharers", [1, 30])
def test_timelines_share_their_memory(
    kernels: KernelCache, monkeypatch: pytest.MonkeyPatch, sharers: int
) -> None:
    memory = Memory()
    memory.sharers = sharers
    sandbox = Sandbox(load_scene("exponential_wall", SCENES[0][1]), kernels, memory)
    sandbox.pause()
    sandbox.advance(2.0, np.inf)
    states = sandbox.time.checkpoints
    size = states[-1].snapshot.vectors.nbytes
    assert len(states) > 50 if sharers == 1 else 5 < len(states) < 20
    monkeypatch.setattr(history, "MAX_BYTES", 8 * size * sharers)
    sandbox.paused = False
    sandbox.advance(1.0, np.inf)
    assert 3 <= len(sandbox.time.checkpoints) <= 8
