"""Keys, and files that the window writes, without a window."""

from __future__ import annotations

import shutil
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from taichi_disk.window.recorder import Recorder, picture_of

from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.controls import LEAST, REPEATED, Controls
from taichi_disk.window.sandbox import Sandbox


@pytest.fixture
def controls(kernels: KernelCache, tmp_path: Path) -> Controls:
    speeds = (0.02, 0.05)
    playlist = [
        (f"v = {v}", partial(load_scene, "exponential_wall", ["lattice.points=120", f"impact.velocity={v}"]))
        for v in speeds
    ]
    nothing = lambda *_: None  # noqa: E731
    view: Any = SimpleNamespace(contact=nothing, follow=nothing, home=nothing, zoom=nothing)
    out = tmp_path / "out"
    out.mkdir()
    return Controls(Sandbox(playlist[0][1](), kernels=kernels), view, playlist, out)


@pytest.mark.validate
def test_every_key_is_explained_and_reaches_what_it_names(controls: Controls) -> None:
    sandbox = controls.sandbox
    explained = " ".join(keys for keys, _ in controls.reference).split()
    assert set(explained) == set(controls.actions) >= set(REPEATED) and len(explained) == len(set(explained))
    for key in ("a", "Up", "e", "t", "c", "f", "n", "w"):
        controls.press(key)
    assert sandbox.scene.wall.a == 300.0 and controls.number == 1  # the next scene has its own numbers
    assert sandbox.scene.impact.velocity == 0.05 and sandbox.scene.video.theme == "dark"  # type: ignore[union-attr]
    assert sandbox.speed == 1.12 and load_scene(controls.out / "view-1.yaml") == sandbox.scene
    for _ in range(60):
        controls.press("d")
    assert sandbox.scene.material.eta_star == 0.0
    controls.press("e")
    assert sandbox.scene.material.eta_star == LEAST["material.eta_star"]
    for _ in range(60):
        controls.press("a")
    assert sandbox.scene.wall.a == 3000.0
    controls.press("k")
    assert sandbox.scene.lattice.points == 180
    controls.press("F1")  # a key that means nothing


@pytest.mark.validate
def test_the_keys_for_points_keep_the_viscosity_of_the_body(controls: Controls) -> None:
    sandbox = controls.sandbox
    eta = sandbox.segment.scenario.model.springs.eta
    assert controls.dashpot_key == "material.eta_star"
    for key in ("k", "j", "j"):
        controls.press(key)
        assert sandbox.segment.scenario.model.springs.eta == eta == 10.0 / 120
    assert sandbox.scene.lattice.points != 120 and controls.dashpot_key == "material.viscosity"
    controls.press("e")
    assert sandbox.scene.material.viscosity == pytest.approx(1.12 * eta, rel=1e-2)
    for _ in range(80):
        controls.press("d")
    assert sandbox.scene.material.viscosity == 0.0
    controls.press("e")
    assert sandbox.scene.material.viscosity == LEAST["material.viscosity"]


def test_a_key_raises_the_viscosity_from_zero(controls: Controls) -> None:
    controls.sandbox.set("material.eta_star", 0.0)
    controls.press("e")
    assert controls.value("material.eta_star") == LEAST["material.eta_star"]


def test_files_that_cannot_be_written_are_told_and_the_window_lives(controls: Controls) -> None:
    sandbox, out = controls.sandbox, controls.out
    recorder = Recorder(controls)
    take = lambda: recorder.take(0.1, lambda: np.zeros((120, 50, 4), np.float32), 0.5)  # noqa: E731
    controls.press("v")
    take()
    controls.press("v")
    take()
    assert [one.name for one in out.iterdir()] == ["view-1.mp4"] and "view-1.mp4" in sandbox.message
    shutil.rmtree(out)
    out.write_text("")
    for key in ("p", "v"):
        sandbox.message = ""
        controls.press(key)
        for _ in range(50):
            take()
        assert "write" in sandbox.message and not controls.recording
    controls.press("w")
    assert "Not a directory" in sandbox.message


@pytest.mark.parametrize("size", [(121, 51), (120, 50)])
def test_a_picture_shows_the_view_upright(controls: Controls, size: tuple[int, int]) -> None:
    drawn = np.zeros((*size, 4), np.float32)
    drawn[60, size[1] // 2 * 2 - 1] = (1.0, 0.5, 0.0, 1.0)  # the upper left corner of the view: rows run upwards
    picture = picture_of(drawn, 60 / size[0])
    assert picture.shape == (50, 60, 3) and picture[0, 0].tolist() == [255, 128, 0] and picture.sum() == 383
