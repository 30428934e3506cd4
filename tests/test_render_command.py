"""Filming a finished run again: the formats, the comparison, and results that stay as they are."""

from __future__ import annotations

import hashlib
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from PIL import Image

from taichi_disk.cli import main
from taichi_disk.render.colours import GROUND
from taichi_disk.render.film import film_problem

needs_vulkan = pytest.mark.skipif(film_problem() is not None, reason=str(film_problem()))


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("runs")
    for name, eta in (("elastic", 0), ("lossy", 20)):
        overrides = ["lattice.points=120", "impact.velocity=0.05", f"material.eta_star={eta}"]
        words = [word for override in overrides for word in ("--set", override)]
        assert main(["run", "exponential_wall", *words, "--no-video", "--out", str(folder / name)]) == 0
    return folder / "elastic", folder / "lossy"


def contents(folder: Path) -> dict[str, str]:
    return {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in folder.iterdir()}


@needs_vulkan
@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_a_run_is_filmed_again_and_its_results_stay(runs: tuple[Path, Path], tmp_path: Path, suffix: str) -> None:
    before, out = contents(runs[0]), tmp_path / f"film{suffix}"
    assert main(["render", str(runs[0]), "--out", str(out), "--size", "160", "--fps", "10", "--seconds", "1"]) == 0
    assert contents(runs[0]) == before
    assert list(tmp_path.iterdir()) == [out]
    film = np.array([frame[..., :3] for frame in iio.imiter(out)])
    assert film.shape == (10, 160, 160, 3)
    assert np.abs(film[0, 2, 2].astype(float) - 255 * np.array(GROUND)).max() < 6


@needs_vulkan
def test_a_comparison_shows_both_runs_at_the_same_times(runs: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "both.mp4"
    options = ["--out", str(out), "--size", "240", "--fps", "10", "--seconds", "2"]
    assert main(["render", str(runs[0]), "--compare", str(runs[1]), *options]) == 0
    left, right = np.split(iio.imread(out).astype(float), 2, axis=2)
    assert left.shape == right.shape == (20, 240, 240, 3)
    # Until the contact the two disks do the same; at the end the one without dashpots is the higher.
    stage = slice(70, 190)
    assert np.abs(left[0, stage] - right[0, stage]).mean() < 2.0

    def middle(picture: np.ndarray) -> float:
        ink = np.abs(picture[40:195] - 255 * np.array(GROUND)).sum(axis=-1) > 100
        return float(np.nonzero(ink)[0].mean())

    assert middle(left[-1]) < middle(right[-1]) - 0.5


@needs_vulkan
def test_a_picture_is_that_of_the_greatest_deformation(runs: tuple[Path, Path], tmp_path: Path) -> None:
    out = tmp_path / "picture.png"
    assert main(["render", str(runs[0]), "--out", str(out), "--size", "240"]) == 0
    picture = np.asarray(Image.open(out)).astype(float)
    assert picture.shape == (240, 240, 3)
    # Blue, the colour of compression, is where the disk touches the wall.
    blue = (picture[..., 2] - picture[..., 0])[60:205] > 60
    assert blue.any() and np.nonzero(blue)[0].mean() > 0.6 * blue.shape[0]


def test_what_cannot_be_filmed_is_said(
    runs: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for words, says in (
        ([str(tmp_path)], "no run is here"),
        ([str(runs[0]), "--out", str(tmp_path / "film.avi")], "end the name with"),
        ([str(runs[0]), "--compare", str(runs[1]), "--out", str(tmp_path / "film.png")], "end the name with"),
        ([str(runs[0]), "--size", "4000"], "video.size"),
    ):
        assert main(["render", *words]) == 2
        assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
