"""The window's camera, without a window."""

from __future__ import annotations

from unittest.mock import MagicMock

import pytest

from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.sandbox import Sandbox
from taichi_disk.window.stage import SIZE, Stage


@pytest.mark.parametrize("columns", [50.0, 5000.0], ids=["in view", "out of view"])
def test_the_disk_that_is_followed_stays_where_it_is_in_view(kernels: KernelCache, columns: float) -> None:
    sandbox = Sandbox(load_scene("exponential_wall", ["lattice.points=60", "impact.velocity=0.05"]), kernels=kernels)
    stage = Stage(MagicMock(), sandbox)
    stage.draw(SIZE)
    before = stage.camera.to_pixels(stage.centre)
    stage.pan(columns, 0.0)
    stage.follow()
    stage.draw(SIZE)
    place = stage.camera.to_pixels(stage.centre)
    assert stage.place(*place)
    if columns == 50.0:
        assert place == pytest.approx(before + (columns, 0.0))
    height, sandbox.paused = stage.centre[1], False
    assert sandbox.advance(1.0, patience=60.0) > 10  # however slow the machine is
    stage.draw(SIZE)
    assert stage.centre[1] < height - 0.01
    assert stage.camera.to_pixels(stage.centre) == pytest.approx(place)
