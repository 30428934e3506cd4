"""Filming finished runs again: the film of the run, comparison, refusals, and results that stay as they are."""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from PIL import Image

from taichi_disk import load_scene, run
from taichi_disk.cli import main
from taichi_disk.render import film_problem

needs_vulkan = pytest.mark.skipif(film_problem() is not None, reason=str(film_problem()))


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """An impact that is filmed, and one without film and with weak dashpots."""
    folder, problem = tmp_path_factory.mktemp("runs"), film_problem()
    small = ["lattice.points=100", "impact.velocity=0.05", "video.size=240", "video.seconds=0.5", "video.fps=10"]
    for name, eta in (("lossy", 20), ("elastic", 1)):
        scene = load_scene("exponential_wall", [*small, f"material.eta_star={eta}", "video.colour=force"])
        run(scene, folder / name, video=name == "lossy" and not problem)
    return folder / "lossy", folder / "elastic"


def pictures_in(folder):
    return np.array([np.asarray(Image.open(path)) for path in sorted(folder.iterdir())]).astype(float)


@needs_vulkan
def test_filmed_again_by_another_process_a_film_is_the_same_and_the_results_stay(runs):
    before = {path.name: path.read_bytes() for path in runs[0].iterdir()}
    subprocess.run([sys.executable, "-m", "taichi_disk", "render", str(runs[0])], check=True)
    after = {path.name: path.read_bytes() for path in runs[0].iterdir()}
    assert after.pop("render.mp4") == before["video.mp4"] and after == before


@pytest.mark.validate
@needs_vulkan
def test_a_comparison_shows_two_runs_side_by_side(runs, tmp_path):
    out = tmp_path / "both"
    assert main(["render", str(runs[0]), "--compare", str(runs[1]), "--out", str(out)]) == 0
    left, right = np.split(pictures_in(out), 2, axis=2)
    assert left.shape == right.shape == (5, 240, 240, 3)
    stage = slice(80, 190)
    # Until the contact the two disks do the same; at the end the more elastic one is the higher.
    assert np.abs(left[0, stage] - right[0, stage]).mean() < 1.0
    assert np.abs(left[-1, stage] - right[-1, stage]).mean() > 2.0


def test_what_cannot_be_filmed_is_said(runs, tmp_path, capsys):
    pressed = runs[0].with_name("pressed")
    pressed.mkdir()
    (pressed / "scene.yaml").write_text("scene: compression")
    one = str(runs[0])
    for words, says in (
        ([str(tmp_path)], "no run is here"),
        (
            [one, "--out", str(tmp_path / "film.avi")],
            "film.avi: end the name with .mp4, .webm or .gif for a film, with",
        ),
        ([one, "--out", str(tmp_path / "film.gif"), "--format", "mp4"], "says the format already"),
        ([one, "--compare", str(pressed)], "cannot compare an impact with a relaxation compression"),
        ([one, "--size", "4000"], "video.size"),
        ([one, "--colour", "stress"], "video.colour"),
        ([one, "--supersample", "1.2"], "video.supersample"),
    ):
        assert main(["render", *words]) == 2
        assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@needs_vulkan
def test_a_folder_with_something_else_in_it_is_not_filmed_into(runs, tmp_path):
    words = ["render", str(runs[1]), "--out", str(tmp_path), "--size", "120", "--seconds", "0.3"]
    (tmp_path / "00009.png").touch()  # what an earlier film left is replaced
    assert main(words) == 0
    assert sorted(path.name for path in tmp_path.iterdir()) == [f"{k:05d}.png" for k in range(1, 4)]
    (tmp_path / "notes.txt").write_text("mine")
    assert main(words) == 2
    assert (tmp_path / "notes.txt").read_text() == "mine" and len(list(tmp_path.iterdir())) == 4
