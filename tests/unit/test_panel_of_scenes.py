"""The panel of every kind of scene has the controls of what that scene has."""

from __future__ import annotations

from pathlib import Path

import pytest

from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.app import presets
from taichi_disk.window.session import Session


@pytest.mark.parametrize(
    ("scene", "labels"),
    [
        ("compression", ["P", "wall a", "points"]),
        ("exponential_wall", ["v / c", "angle", "spin", "friction", "wall a", "points"]),
        ("absorbing_wall", ["v / c", "angle", "spin", "wall a", "points"]),
    ],
)
def test_a_scene_opens_with_the_sliders_of_its_own_keys(
    scene: str, labels: list[str], kernels: KernelCache, tmp_path: Path
) -> None:
    session = Session(presets(load_scene(scene, ["lattice.points=60"])), tmp_path, kernels)
    assert [slider.label for slider in session.controls.sliders("Experiment")][1:] == labels
