"""Films: the right content, complete or not at all, the same bytes each time, and with
explanations."""

from __future__ import annotations

import hashlib
import os
import re
import resource
import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import imageio.v3 as iio
import numpy as np
import pytest
from PIL import Image

from taichi_disk import Lattice, api, load_scene, runtime
from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.outcome import compute
from taichi_disk.errors import InputError, SimulationError, TaichiDiskError
from taichi_disk.progress import silent as QUIET
from taichi_disk.render import film as film_module
from taichi_disk.render import film_problem, shaders
from taichi_disk.render.moments import Span, contact_of, titles
from taichi_disk.render.moments import time_of as time_in
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES
from taichi_disk.render.recording import Flight

needs_vulkan = pytest.mark.skipif(
    film_problem() is not None, reason=str(film_problem())
)
FORMATS = pytest.mark.parametrize(
    "suffix", [".mp4", pytest.param(".webm", marks=pytest.mark.validate), ".gif", ""]
)
COUNT = 10
SIZE = 240


@pytest.fixture(scope="module")
def run():
    runtime.start()
    # with a flight
    settings = [
        "lattice.points=150",
        "impact.velocity=0.05",
        "material.eta_star=5",
        "impact.gap=0.2",
    ]
    scene = load_scene("exponential_wall", settings)
    scenario = scene.scenario()
    outcome = compute(scenario)
    # The states are stored, so that tests may restart Taichi.
    # beyond the end, because films show the flight after it
    times = np.linspace(0.0, 2.0 * outcome.series["t"][-1], 800)
    states = list(outcome.replay(times))
    replay = lambda wanted: (states[int(np.abs(times - t).argmin())] for t in wanted)  # noqa: E731
    return replace(outcome, replay=replay, frames=replay)


def video(**keys):
    keys = {
        "size": SIZE,
        "fps": 10,
        "seconds": 1,
        "panel": "false",
        "magnify": 1,
    } | keys
    return load_scene(
        "exponential_wall", [f"video.{key}={value}" for key, value in keys.items()]
    ).video


@pytest.fixture
def captions(monkeypatch):
    """Return a function that returns the words of each picture of the last film, those
    of compared runs one after the other."""
    calls = []
    original = film_module.captions

    def record(run, cues):
        calls.append(list(original(run, cues)))
        return calls[-1]

    monkeypatch.setattr(film_module, "captions", record)
    return lambda: [one for each in zip(*calls, strict=True) for one in each]


def pictures_in(folder):
    return np.array(
        [np.asarray(Image.open(path)) for path in sorted(folder.iterdir())]
    ).astype(float)


def digests(files):
    return {path: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def film(*arguments):
    film_module.draw_film(*arguments)


@needs_vulkan
@FORMATS
def test_a_film_has_the_frames_size_and_rate_asked_for_and_the_same_bytes_twice(
    run, tmp_path, suffix
):
    path = tmp_path / f"film{suffix}"
    calls = []
    film(path, [run], video(), lambda *what: calls.append(what))
    assert calls == [("render", done, COUNT) for done in range(COUNT + 1)]
    assert list(tmp_path.iterdir()) == [path]
    files = sorted(path.iterdir()) if path.is_dir() else [path]
    first = digests(files)
    film(path, [run], video(), QUIET)  # replaces the existing film
    assert digests(files) == first
    pictures = (
        np.array([frame[..., :3] for frame in iio.imiter(path)])
        if suffix
        else pictures_in(path)
    )
    if suffix == ".gif":  # repeated pictures become one picture that lasts longer
        with Image.open(path) as gif:
            assert (
                sum(gif.seek(k) or gif.info["duration"] for k in range(gif.n_frames))
                == 100 * COUNT
            )
    else:
        assert len(pictures) == COUNT
        assert not suffix or iio.immeta(path, plugin="pyav")["fps"] == 10
    assert pictures.shape[1:] == (SIZE, SIZE, 3)
    assert np.abs(pictures[:, 2, 2] - 255 * np.array(THEMES["light"].ground)).max() < 6


@needs_vulkan
def test_a_gif_has_no_more_pictures_in_a_second_than_browsers_show(run, tmp_path):
    path = tmp_path / "film.gif"
    film(path, [run], video(fps=120), QUIET)
    durations = []
    with Image.open(path) as gif:
        for k in range(gif.n_frames):
            gif.seek(k)
            durations.append(gif.info["duration"])
    assert sum(durations) == 1000
    assert min(durations) == 20


ENCODE = """
import sys, numpy as np
from functools import partial
from pathlib import Path
from taichi_disk.render.video import video
path, (rows, columns) = Path(sys.argv[1]), np.mgrid[:240, :240]
with video(path, path.suffix, (240, 240), 10, "") as write:
    for k in range(10):
        phase = 0.002 * (rows - 4 * k) ** 2 + 0.01 * columns * np.cos(k)
        grey = 128 + 100 * np.sin(phase)
        write(partial(np.stack, [grey.astype(np.uint8)] * 4, axis=2))
"""


@pytest.mark.parametrize(
    "suffix",
    [
        ".mp4",
        *(
            pytest.param(suffix, marks=pytest.mark.validate)
            for suffix in (".webm", ".gif")
        ),
    ],
)
def test_the_bytes_of_a_film_do_not_depend_on_what_lay_in_memory(tmp_path, suffix):
    files = [tmp_path / f"{fill}{suffix}" for fill in (0, 170)]
    # glibc fills freed memory with this number, and new memory with its complement
    for path in files:
        environment = os.environ | {"MALLOC_PERTURB_": path.stem}
        subprocess.run(
            [sys.executable, "-c", ENCODE, path], env=environment, check=True
        )
    assert len(set(digests(files).values())) == 1


@needs_vulkan
def test_the_disk_in_the_film_moves_as_its_centre_of_mass_does(
    run, tmp_path, captions, monkeypatch
):
    # without words and scales, so that everything above the wall is the disk
    monkeypatch.setattr("taichi_disk.render.letters._LABELLED", 1000)
    film(
        tmp_path / "film.mp4",
        [run],
        video(draw="field", colour="strain", theme="dark", size=360),
        QUIET,
    )
    times = np.array([one.t for one in captions()])
    series = run.series
    theme = THEMES["dark"]
    assert len(times) == COUNT
    assert (np.diff(times) >= 0.0).all()
    # It flies before t = 0 and after the end, as high at both ends.
    assert times[0] < -1.0
    assert captions()[0].lines[0] == "before t = 0"
    assert times[-1] > series["t"][-1] + 1.0
    middles = []
    areas = []
    for picture in iio.imread(tmp_path / "film.mp4").astype(float):
        outside = np.abs(picture - 255 * np.array(theme.ground)).sum(axis=-1) < 30
        above = np.flatnonzero(outside[:, 0])[:-1]  # the wall's haze ends there
        columns = np.flatnonzero(~outside[above].all(axis=0))
        tops, bottoms = outlines(~outside[above][:, columns])
        heights = bottoms - tops
        areas.append(heights.sum())
        middles.append((heights * (tops + bottoms) / 2.0).sum() / areas[-1])
    scale = np.sqrt(areas[0] / np.pi)  # pixels per R, of the disk that is still round
    last = series["t"][-1]
    centre = np.interp(times, series["t"], series["com_y"])
    centre += np.minimum(times, 0.0) * series["com_vy"][0]
    centre += np.maximum(times - last, 0.0) * series["com_vy"][-1]
    assert np.ptp(middles + scale * centre) < 1.5
    assert np.ptp(middles) > 30.0
    assert abs(middles[0] - middles[-1]) < 1.5


def outlines(disk):
    """Return the rows of the upper and lower outline in each column."""
    tops = disk.argmax(axis=0)
    return tops, len(disk) - disk[::-1].argmax(axis=0)


@needs_vulkan
def test_a_disk_that_flies_aside_stays_whole_in_the_film_and_the_wall_spans_it(
    tmp_path,
):
    aside = np.tile([0.2, -0.05], (60, 1))
    result = api.run(
        load_scene(
            "exponential_wall",
            ["lattice.points=60", "material.eta_star=0", "impact.gap=0.13"],
        ),
        velocities=aside,
        lattices=1,
    )
    size = 200  # without words
    result.film(tmp_path / "film", size=size, seconds=0.5, draw="points")
    last = pictures_in(tmp_path / "film")[-1]
    ground = 255 * np.array(THEMES["light"].ground)
    wall = np.flatnonzero((np.abs(last - ground).max(axis=2) > 20).all(axis=1))
    assert len(wall) > 5
    assert np.ptp(last[wall], axis=1).max() <= 1
    stage = last[: wall[0] - 4]
    rows, columns = np.nonzero(np.abs(stage - ground).max(axis=2) > 20)
    assert np.ptp(columns) == pytest.approx(np.ptp(rows), abs=4)
    assert columns.max() > 0.8 * size


@needs_vulkan
@pytest.mark.validate
def test_an_arrow_of_any_force_ends_in_the_picture(tmp_path, monkeypatch):
    # A rod that falls on its side is bent most between two hits, during which the force
    # is far larger.
    scales = []
    paint = Painter.paint

    def record(self, *arguments):
        scales.append(self.full_force)
        paint(self, *arguments)

    monkeypatch.setattr(Painter, "paint", record)
    rod = np.stack(
        np.meshgrid(np.linspace(-1.5, 1.5, 31), np.linspace(-0.15, 0.15, 4)), axis=-1
    ).reshape(-1, 2)
    scene = load_scene("exponential_wall", ["impact.turn=0.5", "material.eta_star=1"])
    result = api.run(scene, lattice=Lattice.from_points(rod), lattices=1)
    result.film(tmp_path / "film", size=SIZE, seconds=0.2)
    _, states, _ = result.trajectory(np.linspace(0.0, result.series["t"][-1], 500))
    pushes = [
        np.hypot(
            *result.scenario.model.wall.contact_forces(result.lattice, x)[1].T
        ).max(initial=0.0)
        for x in states
    ]
    assert 1.0 < max(pushes) / scales[0] < 5.0  # 0.35 R each


@needs_vulkan
def test_the_film_holds_at_the_greatest_compression_and_ends_with_the_result(
    run, tmp_path, captions
):
    scenario = run.scenario
    outcome = run
    film(tmp_path / "film.mp4", [run], video(seconds=4), QUIET)
    result = f"e = {scenario.result(outcome.series)['restitution']:.3f}"
    words = captions()
    _, end = contact_of(run)
    assert [one.result for one in words[-7:]] == 7 * [result]
    for one in words:
        assert one.result == (result if one.t >= end else "")
    held = [one.lines[0] for one in words if one.note == "greatest compression"]
    peak = outcome.series["t"][outcome.series["elastic"].argmax()]
    assert len(held) >= 2
    assert set(held) == {f"t = {peak:.2f} R/c"}
    pictures = iio.imread(tmp_path / "film.mp4").astype(int)
    # nothing moves at the end
    assert np.abs(pictures[-1] - pictures[-4])[60:].mean() < 1.0
    # and the bold result is there
    ink = (pictures[-1, :60, 120:].sum(axis=-1) < 300).sum()
    assert ink > 20 + (pictures[5, :60, 120:].sum(axis=-1) < 300).sum()
    moving = list({one.t: one.pace for one in words if one.pace}.items())
    pace = np.array([float(lines[0].split()[3]) for _, lines in moving])
    # The stated paces add up to the simulated time; the contact in the middle is in
    # slow motion.
    assert (pace[:-1] / 10).sum() == pytest.approx(np.ptp(times_of(words)), rel=0.04)
    is_slow = [len(lines) > 1 for _, lines in moving]
    assert is_slow[len(is_slow) // 2]
    assert not is_slow[2]
    assert not is_slow[-2]
    assert 0.5 < np.mean(is_slow) < 0.95
    factor = re.fullmatch("slow motion, ([0-9]+) times", moving[len(moving) // 2][1][1])
    assert float(factor[1]) == pytest.approx(pace.max() / pace.min(), rel=0.2)
    assert pace.max() > 4.0 * pace.min()


def times_of(words):
    return [one.t for one in words]


@needs_vulkan
@pytest.mark.parametrize(
    ("colour", "theme"), [("pressure", "light"), ("fringes", "dark"), ("force", "dark")]
)
def test_a_single_picture_is_of_the_greatest_compression(
    run, tmp_path, captions, colour, theme
):
    film(tmp_path / "picture.png", [run], video(colour=colour, theme=theme), QUIET)
    series = run.series
    assert captions()[0].t == pytest.approx(
        series["t"][series["elastic"].argmax()], abs=0.1
    )
    picture = np.asarray(Image.open(tmp_path / "picture.png")).astype(float)
    assert picture.shape == (SIZE, SIZE, 3)
    assert np.abs(picture[1, 1] - 255 * np.array(THEMES[theme].ground)).max() < 1.5
    assert len(np.unique(picture[70:180].reshape(-1, 3).round(-1), axis=0)) > 15


@needs_vulkan
def test_a_comparison_shows_both_runs_at_the_same_times_in_the_same_colours(
    run, tmp_path, captions
):
    film(tmp_path / "both", [run, run], video(), QUIET)
    left, right = np.split(pictures_in(tmp_path / "both"), 2, axis=2)
    # two are 16 : 9
    assert left.shape == (COUNT, SIZE, 2 * round(SIZE * 4 / 9), 3)
    below = SIZE - 60  # the position of the scales, which both disks share
    assert np.array_equal(left[:, :below], right[:, :below])
    assert captions()[0::2] == captions()[1::2]


def test_runs_side_by_side_are_named_by_what_sets_them_apart():
    def named(*changes):
        scenes = [
            load_scene("exponential_wall", ["lattice.points=20", *change])
            for change in changes
        ]
        runs = [SimpleNamespace(scenario=scene.scenario()) for scene in scenes]
        return [title[0] for title in titles(runs)]

    assert named(["material.eta_star=0"], ["material.eta_star=100"]) == [
        "η* = 0",
        "η* = 100",
    ]
    assert named(["wall.a=50", "impact.velocity=0.1"], []) == [
        "v = 0.1 c    a = 50/R",
        "v = 0.02 c    a = 300/R",
    ]
    assert named([], []) == ["Impact on a rigid wall"] * 2  # nothing does


@needs_vulkan
@pytest.mark.parametrize(("at", "t"), [("contact", None), ("end", None), (1.5, 1.5)])
def test_a_picture_is_of_the_moment_asked_for(run, tmp_path, captions, at, t):
    series = run.series
    touches = series["t"][
        np.argmax(series["wall_force"] > 0.01 * series["wall_force"].max())
    ]
    film(tmp_path / "picture.png", [run], video(), QUIET, Span(at=at))
    expected = {"contact": touches, "end": series["t"][-1]}.get(at, t)
    assert captions()[0].t == pytest.approx(expected, abs=0.006)
    assert captions()[0].note == {"contact": "first contact"}.get(at, "")
    assert bool(captions()[0].result) == (at == "end")


@needs_vulkan
def test_a_part_of_a_film_begins_and_ends_where_asked_at_the_pace_of_the_whole(
    run, tmp_path, captions
):
    film(
        tmp_path / "part",
        [run],
        video(seconds=2),
        QUIET,
        Span(start="contact", end="greatest"),
    )
    times = times_of(captions())
    series = run.series
    assert times[0] == pytest.approx(time_in("contact", series), abs=0.006)
    assert times[-1] == pytest.approx(greatest_compression(series), abs=0.006)
    assert len(times) == 20


@pytest.mark.parametrize(
    "span", [Span(at="later"), Span(at=-1.0), Span(at=1e9), Span(at=float("nan"))]
)
def test_an_unknown_moment_is_refused_with_the_list_of_known_ones(run, tmp_path, span):
    with pytest.raises(
        InputError,
        match=r"write greatest, contact, end, or a time within the run, 0 to \d",
    ):
        film(tmp_path / "picture.png", [run], video(), QUIET, span)


@needs_vulkan
@pytest.mark.validate
def test_a_picture_of_a_comparison_shows_the_whole_of_a_disk_that_has_left_already(
    tmp_path,
):
    slow, fast = (
        api.run(
            load_scene("exponential_wall").with_(points=60, velocity=v, eta_star=0),
            lattices=1,
        )
        for v in (0.02, 0.3)
    )
    slow.film(tmp_path / "both.png", compare=fast, size=360, draw="field", panel=False)
    # between the words
    picture = np.asarray(Image.open(tmp_path / "both.png")).astype(float)[76:280, 360:]
    inked = (
        np.abs(picture - 255 * np.array(THEMES["light"].ground)).max(axis=2) > 20
    ).sum(axis=1)
    assert 0 < inked[np.flatnonzero(inked)[0]] < 120  # the top of the text is complete


@needs_vulkan
@pytest.mark.validate
def test_a_faster_disk_stays_whole_in_a_comparison_to_the_end(tmp_path):
    slow, fast = (
        api.run(
            load_scene(
                "exponential_wall", ["lattice.points=60", f"impact.velocity={v}"]
            ),
            lattices=1,
        )
        for v in (0.02, 0.2)
    )
    slow.film(tmp_path / "both", compare=fast, size=128, fps=10, seconds=1)
    last = pictures_in(tmp_path / "both")[-1]
    inked = (last[:, 128:] != last[0, 0]).any(axis=2).sum(axis=1)
    assert inked[:4].max() < 60 < inked[20]  # the top of the text is complete


@needs_vulkan
@pytest.mark.validate
def test_a_small_compression_is_visible_with_magnified_displacements(tmp_path):
    pressed = api.run(
        load_scene("compression", ["lattice.points=60", "compression.method=newton"]),
        lattices=1,
    )
    flatness = []
    for factor in (1.0, 30.0):
        file = pressed.film(
            tmp_path / f"{factor}.png",
            magnify=factor,
            draw="field",
            size=200,  # without words
        )
        # above the wall
        disk = np.asarray(Image.open(file).convert("RGB")).astype(int)[:-26]
        inked = np.abs(disk - disk[0, 0]).sum(axis=2) > 60
        flatness.append(inked.any(axis=1).sum() / inked.any(axis=0).sum())
    assert flatness[1] < 0.9 * flatness[0]


@needs_vulkan
def test_by_default_a_film_magnifies_the_flattening_to_a_twentieth_of_r_and_says_so(
    tmp_path, monkeypatch
):
    painters = []
    original = film_module.painter_of

    def record(*arguments):
        painters.append(original(*arguments))
        return painters[-1]

    monkeypatch.setattr(film_module, "painter_of", record)
    pressed = api.run(
        load_scene("compression", ["lattice.points=60", "compression.method=newton"]),
        lattices=1,
    )
    pressed.film(tmp_path / "picture.png", size=240)
    (painter,) = painters
    x = pressed.state(1.0).positions
    n = 60
    rest = pressed.lattice.positions[:n, 1]
    drawn = painter.placed(x)[:n, 1]
    floor = x[:n, 1].min()
    # the wall hides everything below
    seen = (rest.mean() - rest.min()) - (drawn.mean() - floor)
    assert painter.magnify > 1.0
    assert f"displacements × {painter.magnify:g}" in painter.remarks
    assert seen == pytest.approx(0.05, rel=0.2)  # the factor is a round number


def test_a_compression_begins_with_no_minus_before_its_zero():
    scenario = load_scene("compression", ["lattice.points=60"]).scenario()
    row = {"t": 0.0, "com_y": scenario.unloaded + 1e-9, "lowest_y": 0.0}
    assert scenario.caption(row)[-1] == "ξ = 0.0000 R"


@needs_vulkan
def test_in_a_comparison_only_the_run_at_its_greatest_compression_is_captioned_so(
    run, tmp_path, captions
):
    other = api.run(
        load_scene("exponential_wall", ["lattice.points=20", "impact.velocity=0.2"]),
        lattices=1,
    )
    film(tmp_path / "both.png", [run, other], video(), QUIET)
    assert [one.note for one in captions()] == ["greatest compression", ""]


@needs_vulkan
@pytest.mark.validate
def test_the_panel_s_curves_are_coloured_up_to_now_and_show_the_time_series(
    run, tmp_path, captions
):
    film(tmp_path / "frames", [run], video(size=720, seconds=0.8, panel="true"), QUIET)
    frames = pictures_in(tmp_path / "frames")
    assert frames.shape[1:] == (720, 1280, 3)
    # The velocity in the uppermost axes: the last pixels of its colour below its title.
    green = 255 * np.array(THEMES["light"].velocity)
    columns = []
    rows = []
    times = []
    start, end = contact_of(run)
    for caption, frame in zip(captions(), frames, strict=True):
        t = caption.t
        if start < t < end:
            is_curve = np.abs(frame[40:212, 780:] - green).sum(axis=-1) < 60
            found = np.argwhere(
                is_curve[:, : is_curve.any(axis=0).nonzero()[0].max() + 1]
            )
            columns.append(found[:, 1].max() - 5)  # radius of the dot
            rows.append(found[found[:, 1] >= found[:, 1].max() - 8, 0].mean())
            times.append(t)
    assert len(times) >= 3
    slope, _ = np.polyfit(times, columns, 1)
    offsets = np.array(columns) - slope * np.array(times)
    assert np.ptp(offsets) < 3.0
    assert np.ptp(columns) > 100
    v = np.interp(times, run.series["t"], run.series["com_vy"])
    # Rows are linear in v.
    fit = np.polyval(np.polyfit(v, rows, 1), v)
    assert rows == pytest.approx(fit, abs=3.0)
    assert np.ptp(rows) > 60
    # Still to come: grey, from the first picture on.
    assert np.abs(frames[0][40:212, 840:] - green).sum(axis=-1).min() > 60


@needs_vulkan
def test_colours_survive_the_encoding(run, tmp_path):
    for name in ("film.mp4", "frames"):
        film(tmp_path / name, [run], video(size=360, seconds=0.3), QUIET)
    off = iio.imread(tmp_path / "film.mp4") - pictures_in(tmp_path / "frames")
    assert np.abs(off.mean(axis=(1, 2))).max() < 1.5
    assert np.abs(off).mean() < 4.0


# ---- failures


@needs_vulkan
@FORMATS
def test_an_interrupted_film_leaves_the_old_one_as_it_was(run, tmp_path, suffix):
    def impatient(stage, done, total):
        if done == 5:
            raise KeyboardInterrupt

    path = tmp_path / f"film{suffix}"
    film(path, [run], video(seconds=0.3), QUIET)
    before = digests(path for path in tmp_path.rglob("*") if path.is_file())
    with pytest.raises(KeyboardInterrupt):
        film(path, [run], video(), impatient)
    assert digests(path for path in tmp_path.rglob("*") if path.is_file()) == before
    # after a failure with an open window, the next must work
    film(path, [run], video(seconds=0.3), QUIET)


@needs_vulkan
@pytest.mark.parametrize(
    ("suffix", "room"),
    [
        (".mp4", 0),
        (".mp4", 3000),
        (".gif", 3000),
        ("", 3000),
        pytest.param(".webm", 3000, marks=pytest.mark.validate),
    ],
)
def test_a_full_file_system_is_reported_and_leaves_no_film(run, tmp_path, suffix, room):
    # A limit on file sizes simulates a full disk: the same system error in the same
    # calls.
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, most))
    try:
        with pytest.raises(
            SimulationError,
            match=rf"cannot write {tmp_path}/film{suffix}: File too large",
        ):
            film(tmp_path / f"film{suffix}", [run], video(), QUIET)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    assert not list(tmp_path.iterdir())


@needs_vulkan
def test_a_vulkan_that_does_not_work_is_reported(run, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("device lost")

    monkeypatch.setattr("taichi_disk.render.offscreen.Window", broken)
    with pytest.raises(TaichiDiskError, match=r"Vulkan cannot draw .* device lost"):
        film(tmp_path / "film.mp4", [run], video(), QUIET)
    assert not list(tmp_path.iterdir())


def test_without_vulkan_the_message_names_the_remedy(tmp_path):
    nowhere = os.environ | {
        "VK_ICD_FILENAMES": "/nonexistent",
        "VK_DRIVER_FILES": "/nonexistent",
    }
    nowhere["PYTHONPATH"] = str(Path(__file__).parents[2])
    code = "from taichi_disk.render import require_film; require_film()"
    done = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=nowhere,
        capture_output=True,
        text=True,
    )
    assert "NoPictures: " in done.stderr
    assert "no Vulkan driver" in done.stderr
    assert (
        "apt-get update && apt-get install -y --no-install-recommends libx11-6"
        " mesa-vulkan-drivers" in done.stderr
    )


@pytest.mark.parametrize(("spin", "eta_star"), [(0.3, 10), (0.8, 10), (0.5, 0)])
def test_the_greatest_compression_of_a_spinning_disk_is_where_it_turns_back(
    spin, eta_star
):
    scene = load_scene("exponential_wall").with_(
        points=60, spin=spin, eta_star=eta_star
    )
    columns = api.run(scene, lattices=1).series
    force = columns["wall_force"]
    stretched = columns["elastic"].argmax()
    # stretched by its spin before it touches the wall
    assert force[stretched] < 1e-3 * force.max()
    assert (
        abs(np.interp(greatest_compression(columns), columns["t"], columns["com_vy"]))
        < 0.1 * scene.impact.velocity
    )


@needs_vulkan
@pytest.mark.validate
def test_the_film_of_a_loading_shows_the_fraction_of_the_load_and_moves_without_a_leap(
    tmp_path, captions
):
    pressed = api.run(
        load_scene("compression", ["lattice.points=60", "compression.method=newton"]),
        lattices=1,
    )
    pressed.film(tmp_path / "frames", size=SIZE, fps=10, seconds=4, compare=pressed)
    words = captions()
    assert words[0::2] == words[1::2]
    assert len(words) == 80
    parts = [100.0 * t for t in times_of(words[::2])]
    assert words[0].lines[0] == "P = 1 % of 0.01 Mc²/R"
    assert words[0].note == ""
    assert parts == sorted(parts)
    assert parts[-5:] == [100.0] * 5
    assert words[-1].result == f"ξ = {pressed.xi:.3g} R"
    steps = np.abs(np.diff(pictures_in(tmp_path / "frames")[:, 70:180], axis=0)).mean(
        axis=(1, 2, 3)
    )
    assert steps[1:30].min() > 0.0
    assert steps[3:].max() < 4.0 * np.median(steps)


def test_a_loading_is_not_compared_with_a_relaxation_which_takes_time(tmp_path):
    runs = []
    for method in ("newton", "relaxation"):
        scenario = load_scene(
            "compression", ["lattice.points=20", f"compression.method={method}"]
        ).scenario()
        runs.append(scenario.quasistatic(loads=2))
    with pytest.raises(
        InputError, match="differ in the meaning of time or in their results"
    ):
        film(tmp_path / "film.mp4", runs, video(), QUIET)


def test_the_film_of_a_compression_on_a_soft_wall_shows_the_disk_from_its_start():
    settings = ["lattice.points=60", "wall.a=10", "compression.method=newton"]
    scenario = load_scene("compression", settings).scenario()
    assert scenario.lattice.positions[:, 1].max() <= scenario.view[3]


@needs_vulkan
@pytest.mark.validate
def test_curves_without_room_beside_a_small_film_are_left_out(tmp_path):
    result = api.run(load_scene("exponential_wall", ["lattice.points=20"]), lattices=1)
    for size, width in ((64, 64), (358, 358), (360, 640)):
        assert iio.imread(
            result.film(tmp_path / f"{size}.png", size=size, panel=True)
        ).shape[:2] == (size, width)


# ---- soft springs


@needs_vulkan
def test_an_engine_with_other_shaders_draws_hard_springs(run, tmp_path, monkeypatch):
    film(tmp_path / "soft.png", [run], video(), QUIET)
    monkeypatch.setitem(shaders.REPLACED, "Triangles_vk_frag.spv", "another")
    assert not shaders.fit_engine()
    film(tmp_path / "hard.png", [run], video(), QUIET)
    soft, hard = (
        np.asarray(Image.open(tmp_path / name)).astype(float)
        for name in ("soft.png", "hard.png")
    )
    assert soft.shape == hard.shape
    assert not np.array_equal(soft, hard)
    assert np.abs(soft - hard).mean() < 2.0  # springs are as heavy


def test_a_window_that_does_not_open_with_these_shaders_opens_without(monkeypatch):
    from taichi_disk.render import offscreen

    opened = []

    class Core:
        def PyWindow(self, *arguments):
            raise RuntimeError("no such shader")

    class Plain:
        def __init__(self, title, size, **options):
            opened.append((title, size, options["show_window"]))

    monkeypatch.setattr(offscreen.ti._lib, "core", Core())
    monkeypatch.setattr(offscreen.Window, "__init__", offscreen.Window.__init__)
    monkeypatch.setattr(offscreen.ti.ui.Window, "__init__", Plain.__init__)
    window = offscreen.open_window((20, 20))
    assert not window.is_soft
    assert opened == [(offscreen.TITLE, (20, 20), False)]


@pytest.mark.skipif(
    shutil.which("glslangValidator") is None, reason="no compiler of GLSL"
)
@pytest.mark.parametrize("stage", ["vert", "frag"])
def test_the_compiled_shaders_are_those_of_the_source(tmp_path, stage):
    folder = Path(shaders.__file__).parent
    compiled = tmp_path / "compiled.spv"
    source = folder / f"Triangles_vk.{stage}"
    command = ["glslangValidator", "-V", source, "-o", compiled]
    subprocess.run(command, check=True, capture_output=True)
    shipped = (folder / f"Triangles_vk_{stage}.spv").read_bytes()
    # The header names the version of the compiler, in the third word.
    assert compiled.read_bytes()[12:] == shipped[12:]


# ---- flights


@needs_vulkan
def test_a_film_without_flight_shows_the_run_alone(run, tmp_path, captions):
    film(tmp_path / "film", [run], video(flight=0), QUIET)
    times = times_of(captions())
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(run.series["t"][-1], abs=0.006)


@pytest.mark.parametrize(
    ("settings", "flies"),
    [
        (["material.eta_star=0"], True),
        (["material.eta_star=10", "impact.spin=0.1"], False),
        (["material.eta_star=10", "impact.spin=0.1", "material.dashpot=axial"], True),
    ],
)
@pytest.mark.validate
def test_a_disk_flies_before_the_run_only_if_it_would_keep_its_spin(settings, flies):
    scene = load_scene("exponential_wall", ["lattice.points=60", *settings])
    outcome = api.run(scene, lattices=1)
    flight = Flight.of(outcome, 0.33)
    assert (flight.start < 0.0) == flies
    if flies:
        _, x, v = next(flight.frames(np.array([flight.start])))
        lattice = outcome.scenario.lattice
        # The run begins where the flight leads.
        moved = lattice.mean(x) - flight.start * lattice.mean(v)
        assert moved == pytest.approx(lattice.mean(lattice.positions), abs=1e-9)
        assert np.ptp(np.hypot(*(x - lattice.mean(x)).T)) == pytest.approx(
            np.ptp(np.hypot(*(lattice.positions - lattice.mean(lattice.positions)).T))
        )
        *_, (_, last, _) = flight.frames(np.array([0.0, flight.end]))
        assert last[:, 1].min() == pytest.approx(x[:, 1].min(), abs=0.02)


def test_velocities_of_the_user_s_own_have_no_flight():
    velocities = np.zeros((60, 2))
    velocities[:, 1] = -0.05
    velocities[0, 1] = -0.06
    scene = load_scene("exponential_wall", ["lattice.points=60"])
    outcome = api.run(scene, velocities=velocities, lattices=1)
    flight = Flight.of(outcome, 0.33)
    assert (flight.start, flight.end) == (0.0, outcome.series["t"][-1])


def test_labels_replace_titles_one_for_each_run(run, tmp_path):
    assert [title[0] for title in titles([run, run], ["a", "b"])] == ["a", "b"]
    with pytest.raises(InputError, match="1 labels for 2 runs: give one for each run"):
        film(tmp_path / "film.mp4", [run, run], video(), QUIET, Span(), ["a"])


@needs_vulkan
def test_a_gif_is_small_unless_its_size_is_given(run, tmp_path):
    size = {}
    for name, keys in (
        ("default", {"size": "auto", "fps": "auto"}),
        ("fine", {"size": 480, "fps": 15, "draw": "field"}),
        ("given", {"size": 600, "fps": 10, "draw": "field"}),
    ):
        path = tmp_path / f"{name}.gif"
        film(path, [run], video(seconds=0.6, **keys), QUIET)
        with Image.open(path) as gif:
            size[name] = gif.size[1], gif.n_frames
            gif.seek(gif.n_frames - 1)
    assert size["default"][0] == size["fine"][0] == 480
    assert size["given"][0] == 600
    assert size["default"][1] > 1.3 * size["given"][1]


@needs_vulkan
def test_few_words_are_title_read_out_and_scale(run, tmp_path):
    shown = {}
    for words in ("all", "few"):
        path = tmp_path / f"{words}.png"
        film(path, [run], video(words=words, size=480), QUIET)
        shown[words] = np.asarray(Image.open(path)).astype(int)
    ground = 255 * np.array(THEMES["light"].ground)
    ink = {name: np.abs(one - ground).max(axis=2) > 60 for name, one in shown.items()}
    assert ink["all"][36:120, :70].any()
    assert not ink["few"][36:120, :70].any()
    assert (shown["all"][:34, :200] == shown["few"][:34, :200]).all()


@needs_vulkan
def test_labels_in_strange_letters_are_named_and_broken_ones_refused(
    run, tmp_path, caplog, monkeypatch
):
    from matplotlib import font_manager

    monkeypatch.setattr(font_manager, "findSystemFonts", list)
    labels = ["\u76e4 1", "b"]
    film(tmp_path / "both.png", [run, run], video(), QUIET, Span(), labels)
    assert "no font of this machine has the letters \u76e4" in caplog.text
    for label in ("\udcff", 3, ""):
        with pytest.raises(InputError, match="must be text that can be printed"):
            film(tmp_path / "no.png", [run, run], video(), QUIET, Span(), ["a", label])
