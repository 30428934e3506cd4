"""Filming finished runs again: the same film, comparisons, refusals."""

import numpy as np
import pytest
from PIL import Image
from programs import contents, film_problem

from taichi_disk import load_scene, run
from taichi_disk.cli import main

needs_vulkan = pytest.mark.skipif(
    film_problem() is not None, reason=str(film_problem())
)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return impacts with and without film, one from Python, and a compression."""
    folder = tmp_path_factory.mktemp("runs")
    problem = film_problem()
    small = ["lattice.points=100", "impact.velocity=0.05", "video.colour=force"]
    small += ["video.size=240", "video.seconds=0.5", "video.fps=10"]
    for name, eta in (("lossy", 20), ("elastic", 1)):
        scene = load_scene("exponential_wall", [*small, f"material.eta_star={eta}"])
        run(scene, folder / name, video=name == "lossy" and not problem, lattices=1)
    thrown = {"velocities": np.tile([0.01, -0.05], (100, 1))}
    run(scene, folder / "own", **thrown, video=False, lattices=1)
    press = ["lattice.points=100", "compression.method=newton"]
    run(load_scene("compression", press), folder / "pressed", video=False, lattices=1)
    return [folder / name for name in ("lossy", "elastic", "own", "pressed")]


@needs_vulkan
@pytest.mark.validate
def test_filmed_again_a_film_is_the_same_and_so_beside_another(runs, tmp_path, capsys):
    before = contents(runs[0])
    assert main(["render", str(runs[0])]) == 0
    after = contents(runs[0])
    assert after.pop("render.mp4") == before["video.mp4"]
    assert after == before
    path = tmp_path / "both.png"
    words = [str(runs[0]), "--compare", str(runs[1]), "--out", str(path)]
    assert main(["render", *words]) == 0
    assert f"written: {path}, " in capsys.readouterr().out
    left, right = np.split(np.asarray(Image.open(path)).astype(float), 2, axis=1)
    assert np.abs(left[80:190] - right[80:190]).mean() > 2.0


@pytest.mark.validate
def test_what_cannot_be_filmed_is_refused_and_why(runs, tmp_path, capsys, monkeypatch):
    impact, _, own, pressed = map(str, runs)
    # the removed text said that the lattice came from Python
    (runs[2] / "summary.json").write_text("{}")
    monkeypatch.chdir(tmp_path)
    nameless = "film.avi: end the name with .mp4, .webm or .gif for a film, .html for"
    for words, says in (
        ([str(tmp_path)], "no run is here"),
        ([own], "no summary.json that can be read"),
        ([impact, "--out", str(tmp_path / "film.avi")], nameless),
        ([impact, "--out", f"{impact}/plot.png"], "plot.png is the name of curves"),
        ([impact, "--out", "."], "the current folder"),
        (
            [impact, "--out", "film.mp4", "--format", "png"],
            "--format png contradicts --out film.mp4",
        ),
        (
            [impact, "--out", "pictures", "--format", "gif"],
            "--format gif contradicts --out pictures",
        ),
        ([impact, "--compare", pressed], "cannot be compared"),
        ([impact, "--size", "4000"], "video.size"),
        ([impact, "--colour", "stress"], "video.colour"),
        ([impact, "--supersample", "1.2"], "video.supersample"),
        ([impact, "--out", "new/film.mp4", "--from", "1e9"], "no moment 1e9"),
        ([impact, "--out", "new/film.png", "--at", "never"], "no moment never"),
    ):
        assert main(["render", *words]) == 2
        assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
