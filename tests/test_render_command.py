"""Filming a finished run again: the formats, the comparison, and results that stay as they are."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from PIL import Image

from taichi_disk import run
from taichi_disk.cli import main
from taichi_disk.progress import QuietProgress
from taichi_disk.refilm import _compute
from taichi_disk.render.colours import GROUND, amount_colours
from taichi_disk.render.film import film_problem
from taichi_disk.render.layout import Layout
from taichi_disk.render.picture import Frame, Subject
from taichi_disk.scene_file import load_scene
from taichi_disk.scenes import build

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
    words = ["--size", "160", "--fps", "10", "--seconds", "1"]
    assert main(["render", str(runs[0]), "--out", str(out), *words]) == 0
    first = out.read_bytes()
    assert main(["render", str(runs[0]), "--out", str(out), *words]) == 0
    assert out.read_bytes() == first
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
    pressed = runs[0].with_name("pressed")
    pressed.mkdir()
    (pressed / "scene.yaml").write_text("scene: compression")
    for words, says in (
        ([str(tmp_path)], "no run is here"),
        ([str(runs[0]), "--out", str(tmp_path / "film.avi")], "end the name with"),
        ([str(runs[0]), "--out", str(tmp_path / "film.gif"), "--format", "mp4"], "says the format already"),
        ([str(runs[0]), "--compare", str(pressed)], "cannot compare an impact with a relaxation compression"),
        ([str(runs[0]), "--size", "4000"], "video.size: must be an even whole number from 64 to 2160"),
        ([str(runs[0]), "--colour", "stress"], "video.colour: must be strain, force, speed or kinetic, not stress"),
        ([str(runs[0]), "--supersample", "1.2"], "video.supersample: must be a multiple of 0.5 from 1 to 2"),
    ):
        assert main(["render", *words]) == 2
        assert says in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


@needs_vulkan
def test_a_film_in_png_is_a_folder_of_numbered_pictures(runs: tuple[Path, Path], tmp_path: Path) -> None:
    out, words = tmp_path / "frames", ["--size", "160", "--fps", "10", "--seconds", "0.3"]
    for _ in range(2):  # what an earlier film left is replaced
        assert main(["render", str(runs[0]), "--out", str(out), *words]) == 0
    pictures = sorted(out.iterdir())
    assert [path.name for path in pictures] == ["00001.png", "00002.png", "00003.png"]
    assert list(tmp_path.iterdir()) == [out]
    frames = np.array([np.asarray(Image.open(path)) for path in pictures])
    assert frames.shape == (3, 160, 160, 3)
    # Without loss, unlike the other formats.
    assert np.array_equal(frames[:, 0, 0], np.tile(np.rint(255 * np.array(GROUND)), (3, 1)))
    (out / "notes.txt").write_text("mine")
    assert main(["render", str(runs[0]), "--out", str(out), *words]) == 2
    assert (out / "notes.txt").read_text() == "mine"


@needs_vulkan
@pytest.mark.parametrize(
    ("options", "kind"),
    [(["--colour", "speed"], "violet"), (["--colour", "kinetic"], "violet"), (["--colour", "force"], "blue")],
)
def test_the_colours_show_what_was_asked_for(
    runs: tuple[Path, Path], tmp_path: Path, options: list[str], kind: str
) -> None:
    out = tmp_path / "picture.png"
    words = ["--size", "240", "--supersample", "1", "--draw", "springs"]
    assert main(["render", str(runs[0]), "--out", str(out), *options, *words]) == 0
    stage = np.asarray(Image.open(out)).astype(float)[40:200]
    ink = np.abs(stage - 255 * np.array(GROUND)).sum(axis=-1) > 60
    red, green, blue = stage[ink].mean(axis=0)
    # Nothing that moves is green; compression at the wall is blue without red.
    assert green < min(red, blue) if kind == "violet" else blue > red


@pytest.mark.validate
@needs_vulkan
def test_a_scene_says_how_its_run_is_filmed(tmp_path: Path) -> None:
    words = ["lattice.points=60", "video.size=120", "video.seconds=0.2", "video.fps=10", "video.draw=points"]
    sets = [word for one in words for word in ("--set", one)]
    for kind, name in (("gif", "video.gif"), ("png", "frames"), ("mp4", "video.mp4")):
        assert main(["run", "exponential_wall", *sets, "--set", f"video.format={kind}", "--out", str(tmp_path)]) == 0
        films = {"video.gif", "video.webm", "frames", "video.mp4"} & {path.name for path in tmp_path.iterdir()}
        assert films == {name}
        assert json.loads((tmp_path / "summary.json").read_text())["video"] == name


def test_a_run_that_sought_its_step_takes_the_same_one_when_it_is_filmed_again(tmp_path: Path) -> None:
    settings = ["lattice.points=60", "material.eta_star=0", "time.tolerance=1e-6"]
    made = run(load_scene("exponential_wall", settings), tmp_path, video=False).summary
    _, again = _compute(load_scene(tmp_path / "scene.yaml", ()), QuietProgress())
    assert (again.facts["dt"], again.facts["attempts"]) == (made["dt"], made["attempts"])


@needs_vulkan
@pytest.mark.parametrize("precision", ["f64", "f32"])
def test_filmed_again_without_options_a_film_is_the_same(tmp_path: Path, precision: str) -> None:
    words = ["lattice.points=60", "video.size=120", "video.seconds=0.3", "video.panel=true", "video.colour=force"]
    sets = [word for one in (*words, f"time.precision={precision}") for word in ("--set", one)]
    assert main(["run", "exponential_wall", *sets, "--out", str(tmp_path)]) == 0
    assert main(["render", str(tmp_path)]) == 0
    assert (tmp_path / "render.mp4").read_bytes() == (tmp_path / "video.mp4").read_bytes()


@needs_vulkan
def test_the_panel_s_curves_end_where_the_time_series_is(runs: tuple[Path, Path], tmp_path: Path) -> None:
    out, words = tmp_path / "frames", ["--size", "720", "--fps", "10", "--seconds", "0.6", "--panel"]
    assert main(["render", str(runs[0]), "--out", str(out), *words]) == 0
    frames = [np.asarray(Image.open(path)).astype(float) for path in sorted(out.iterdir())]
    assert frames[0].shape == (720, 1280, 3)
    blue = [
        np.abs(frame[:190, 740:] - (0, 114, 178)).sum(axis=-1) < 60 for frame in frames
    ]  # v_cm, in the uppermost axes
    # The dot, of 4 pixels radius, is the only place where three neighbours are blue in both directions.
    dots = []
    for one in blue:
        solid = np.all([one[1 + a : 189 + a, 1 + b : 539 + b] for a in (-1, 0, 1) for b in (-1, 0, 1)], axis=0)
        dots.append(np.argwhere(solid).mean(axis=0) + 1)
    rows, columns = np.array(dots).T
    series = np.genfromtxt(runs[0] / "timeseries.csv", delimiter=",", names=True)
    t = series["t"][-1] * (columns - columns[0]) / (columns[-1] - columns[0])
    v = np.interp(t, series["t"], series["com_vy"])
    # Rows are linear in v: the first and the last dot say how.
    expected = np.interp(v, [v[0], v[-1]], [rows[0], rows[-1]])
    assert 100 < rows[0] - rows[-1] < 190 and (np.diff(columns) > 0).all()
    assert rows == pytest.approx(expected, abs=1.0)
    # The result comes at the end, all at once.
    ink = [(frame[160:182, 1150:1250] < 120).all(axis=-1).sum() for frame in frames]
    assert ink[-1] > 50 and not any(ink[:3]) and set(ink) == {0, ink[-1]}
    # What is to come is not there yet: nothing blue right of the dot.
    for one, column in zip(blue, columns, strict=True):
        assert not one[:, int(column) + 7 :].any()


@needs_vulkan
def test_a_disk_that_flies_has_the_full_colour_of_its_speed(runs: tuple[Path, Path], tmp_path: Path) -> None:
    out, words = tmp_path / "frames", ["--size", "480", "--fps", "10", "--seconds", "0.2", "--draw", "points"]
    assert main(["render", str(runs[0]), "--out", str(out), "--colour", "speed", *words]) == 0
    flying, left = (np.asarray(Image.open(path)).astype(float)[60:420] for path in sorted(out.iterdir()))
    full = 255 * amount_colours(np.array(1.0), 1.0)
    points = (np.abs(flying - full).sum(axis=-1) < 6).sum()
    assert points > 1000  # some ten pixels each of 120 points
    # After the impact some shake against the motion of the whole.
    assert 0.2 * points < (np.abs(left - full).sum(axis=-1) < 6).sum() < 0.95 * points


@needs_vulkan
def test_the_disk_in_the_film_moves_as_its_centre_of_mass_does(
    runs: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Arrows hide the points at the wall, and colours of speed those that rest, against the ground.
    monkeypatch.setattr("taichi_disk.film.contact_forces", lambda *_: (np.empty(0, int), np.empty((0, 2))))
    out, words = tmp_path / "film.mp4", ["--size", "360", "--fps", "10", "--seconds", "1.5"]
    assert main(["render", str(runs[0]), "--out", str(out), "--draw", "points", *words]) == 0
    setup = build(load_scene(runs[0] / "scene.yaml"))
    series = np.genfromtxt(runs[0] / "timeseries.csv", delimiter=",", names=True)
    t = setup.frame_times({name: series[name] for name in series.dtype.names}, 15)
    centre = np.stack([np.interp(t, series["t"], series[name]) for name in ("com_x", "com_y")], axis=1)
    camera = Layout(Subject(setup.lattice, True, setup.title(), 1.0, setup.view), 360, 2).camera
    film = iio.imread(out).astype(float)
    assert film.shape == (15, 360, 360, 3)
    wall = int(camera.to_pixels((0.0, 0.0))[1])
    for picture, there in zip(film, camera.to_pixels(centre), strict=True):
        stage = picture[camera.top : wall - 1]
        # All points weigh the same.
        ink = np.abs(stage - 255 * np.array(GROUND)).sum(axis=-1) > 60
        row, column = np.argwhere(ink).mean(axis=0) + 0.5
        assert np.abs(np.array([column, row + camera.top]) - there).max() < 1.0


def test_a_film_says_how_fast_its_time_passes(
    runs: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    told: list[tuple[float, str]] = []

    def record(_path: Path, _subjects: object, frames: Iterable[list[Frame]], **_: object) -> None:
        told.extend((frame.t, frame.text[-1]) for (frame,) in frames)

    monkeypatch.setattr("taichi_disk.film.record_film", record)
    monkeypatch.setattr("taichi_disk.refilm.require_film", lambda size: None)
    assert main(["render", str(runs[0]), "--out", str(tmp_path / "film.mp4"), "--fps", "20", "--seconds", "4"]) == 0
    t, pace = np.array([(t, float(text.split()[3])) for t, text in told]).T
    assert len(t) == 80 and told[0][1] == f"1 s shows {pace[0]:g} R/c"
    # What was said adds up to the time that passed; the contact, in the middle, is slowed down.
    assert (pace[:-1] / 20).sum() == pytest.approx(t[-1] - t[0], rel=0.03)
    assert 1.8 * pace[40] < pace[1] and 1.8 * pace[40] < pace[-2]
