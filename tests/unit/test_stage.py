"""The window's camera, without a window."""

from __future__ import annotations

from unittest.mock import MagicMock

import pytest

from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.sandbox import Sandbox
from taichi_disk.window.scene_view import SIZE, SceneView


@pytest.mark.parametrize("columns", [50.0, 5000.0], ids=["in view", "out of view"])
def test_the_disk_that_is_followed_stays_where_it_is_in_view(kernels: KernelCache, columns: float) -> None:
    sandbox = Sandbox(load_scene("exponential_wall", ["lattice.points=60", "impact.velocity=0.05"]), kernels=kernels)
    view = SceneView(sandbox)
    view.draw(MagicMock(), SIZE)
    before = view.camera.to_pixels(view.centre)
    view.pan(columns, 0.0)
    view.follow()
    view.draw(MagicMock(), SIZE)
    place = view.camera.to_pixels(view.centre)
    assert view.point_at(*place)
    if columns == 50.0:
        assert place == pytest.approx(before + (columns, 0.0))
    height, sandbox.paused = view.centre[1], False
    assert sandbox.advance(1.0, patience=60.0) > 10  # however slow the machine is
    view.draw(MagicMock(), SIZE)
    assert view.centre[1] < height - 0.01
    assert view.camera.to_pixels(view.centre) == pytest.approx(place)
