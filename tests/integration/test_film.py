"""Films: the right content, whole or not at all, the same bytes, and explanations."""

import hashlib
import os
import re
import resource
import shutil
import subprocess
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple

import imageio.v3 as iio
import numpy as np
import pytest
from PIL import Image
from programs import durations_of, film_problem, packed, printed_by, python

from taichi_disk import load_scene
from taichi_disk.base import engine, runtime
from taichi_disk.base.errors import InputError, SimulationError, TaichiDiskError
from taichi_disk.base.processes.early import draw_early
from taichi_disk.base.progress import silent
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.mechanics.fields import Triangles, at_points
from taichi_disk.pictures.panel import draw_panel
from taichi_disk.pictures.plot import draw_plot, plot_run
from taichi_disk.pictures.render import finisher, shaders
from taichi_disk.pictures.render.artist import Artist, drawing_process
from taichi_disk.pictures.render.film import draw_film, storyboard
from taichi_disk.pictures.render.letters import Letters
from taichi_disk.pictures.render.moments import (
    Caption,
    Span,
    captions,
    ringing,
    time_of,
    titles,
)
from taichi_disk.pictures.render.palette import THEMES
from taichi_disk.pictures.render.panel import panel_scene
from taichi_disk.pictures.web.film import write_page
from taichi_disk.runs import api

needs_vulkan = pytest.mark.skipif(
    film_problem() is not None, reason=str(film_problem())
)
LONG = [pytest.param(form, marks=pytest.mark.validate) for form in (".webm", ".gif")]
COUNT = 10
SIZE = 240
PRESSED = ("lattice.points=60", "compression.method=newton")


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
    outcome = compute(load_scene("exponential_wall", settings).scenario())
    # The states are stored, so that tests may restart Taichi; beyond the end, because
    # films show the flight after it.
    times = np.linspace(0.0, 2.0 * outcome.series["t"][-1], 400)
    states = list(outcome.replay(times))

    def stored(wanted):
        return (states[int(np.abs(times - t).argmin())] for t in wanted)

    return replace(outcome, replay=stored, frames=stored)


def computed(kind, *settings, **options):
    """Return the run of a shipped scene with some settings."""
    return api.run(load_scene(kind, settings), lattices=1, **options)


def video_of(keys):
    """Return a section video with these `keys`."""
    keys = {
        "size": SIZE,
        "fps": 10,
        "seconds": 1,
        "panel": "false",
        "magnify": 1,
    } | keys
    settings = [f"video.{key}={value}" for key, value in keys.items()]
    return load_scene("exponential_wall", settings).video


def film(path, runs, *more, progress=silent, artist=None, **keys):
    """Film runs into `path`; `keys` of the section video, `more`: span and labels."""
    draw_film(path, runs, video_of(keys), progress, artist or Artist(), *more)
    return path


class Words(NamedTuple):
    """The words of a picture: `note` begins with * if it is a result."""

    t: float
    first: str
    note: str
    pace: list[str]


def words_of(path, run, *more, **keys):
    """Return the words of all pictures of a film, as its page has them."""
    write_page(path.with_suffix(".html"), [run], video_of(keys), silent, *more)
    content, _ = packed(path.with_suffix(".html"))
    words = []
    for cue, lines in zip(content["cues"], content["runs"][0]["captions"], strict=True):
        first, *others, note, pace, _ = lines
        results = [one for one in others if one.startswith("*")]
        told = [*results, note][0]
        words.append(Words(content["times"][cue], first, told, pace.split("    ")))
    return words


def picture_in(path):
    return np.asarray(Image.open(path).convert("RGB")).astype(float)


def pictures_in(folder):
    return np.array([picture_in(path) for path in sorted(folder.iterdir())])


def ground_of(theme):
    return 255 * np.array(THEMES[theme].ground)


def digests(folder):
    files = [path for path in folder.rglob("*") if path.is_file()]
    return {path: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@needs_vulkan
@pytest.mark.parametrize("suffix", [".mp4", "", *LONG])
def test_a_film_has_the_pictures_asked_for_and_the_same_bytes_and_is_whole_or_as_before(
    run, artist, tmp_path, suffix
):
    path = tmp_path / f"film{suffix}"
    calls = []
    film(path, [run], progress=lambda *what: calls.append(what))
    assert calls == [("render", done, COUNT) for done in range(COUNT + 1)]
    assert list(tmp_path.iterdir()) == [path]
    first = digests(tmp_path)

    def impatient(stage, done, total):
        if done == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        film(path, [run], progress=impatient, theme="dark")
    assert digests(tmp_path) == first
    # replaces the existing film, after a failure with an open window
    film(path, [run], artist=artist)
    assert digests(tmp_path) == first
    if suffix:
        pictures = np.array([frame[..., :3] for frame in iio.imiter(path)])
    else:
        pictures = pictures_in(path)
    if suffix == ".gif":  # repeated pictures become one picture that lasts longer
        assert sum(durations_of(path)) == 100 * COUNT
    else:
        assert len(pictures) == COUNT
        assert not suffix or iio.immeta(path, plugin="pyav")["fps"] == 10
    assert pictures.shape[1:] == (SIZE, SIZE, 3)
    assert np.abs(pictures[:, 2, 2] - ground_of("light")).max() < 6


@needs_vulkan
def test_a_gif_is_small_unless_asked_and_as_fast_as_browsers_show(run, tmp_path):
    size = {}
    counts = {}
    for name, keys in (
        ("default", {"size": "auto", "fps": "auto", "seconds": 0.4}),
        ("given", {"size": 128, "seconds": 0.4}),
        ("fast", {"size": 64, "fps": 120, "seconds": 0.4}),
    ):
        path = film(tmp_path / f"{name}.gif", [run], **keys)
        size[name] = Image.open(path).size[1]
        counts[name] = len(durations_of(path))
        assert sum(durations_of(path)) == pytest.approx(400, abs=10)
    assert size == {"default": 480, "given": 128, "fast": 64}
    assert counts["default"] > 1.3 * counts["given"]
    assert min(durations_of(path)) == 20


ENCODE = """
import sys, numpy as np
from pathlib import Path
from taichi_disk.pictures.render.video import video
path, (rows, columns) = Path(sys.argv[1]), np.mgrid[:240, :240]
with video(path, path.suffix, (240, 240), 10, "") as append:
    for k in range(10):
        phase = 0.002 * (rows - 4 * k) ** 2 + 0.01 * columns * np.cos(k)
        grey = 128 + 100 * np.sin(phase)
        append(np.stack([grey.astype(np.uint8)] * 4, axis=2), True)
"""


@pytest.mark.validate
@pytest.mark.parametrize("suffix", [".mp4", ".webm", ".gif"])
def test_the_bytes_of_a_film_do_not_depend_on_what_lay_in_memory(tmp_path, suffix):
    # glibc fills freed memory with this number, and new memory with its complement
    for fill in ("0", "170"):
        path = tmp_path / f"{fill}{suffix}"
        printed_by("-c", ENCODE, path, env=os.environ | {"MALLOC_PERTURB_": fill})
    assert len(set(digests(tmp_path).values())) == 1


@needs_vulkan
def test_the_disk_in_the_film_moves_as_its_centre_of_mass_does(run, tmp_path):
    # without words and scales: everything above the wall is the disk
    look = {"draw": "field", "colour": "strain", "theme": "dark"}
    film(tmp_path / "film", [run], size=238, supersample=2, **look)
    words = words_of(tmp_path / "film", run)
    times = np.array([one.t for one in words])
    series = run.series
    assert len(times) == COUNT
    assert (np.diff(times) >= 0.0).all()
    # It flies before t = 0 and after the end, as high at both ends.
    last = series["t"][-1]
    assert times[0] < -1.0
    assert words[0].first == "before t = 0"
    assert times[-1] > last + 1.0
    middles = []
    areas = []
    for picture in pictures_in(tmp_path / "film"):
        is_ground = np.abs(picture - ground_of("dark")).sum(axis=-1) < 160
        above = np.flatnonzero(is_ground[:, 0])[:-1]  # the wall's haze ends there
        columns = np.flatnonzero(~is_ground[above].all(axis=0))
        disk = ~is_ground[above][:, columns]
        tops = disk.argmax(axis=0)
        bottoms = len(disk) - disk[::-1].argmax(axis=0)
        heights = bottoms - tops
        areas.append(heights.sum())
        middles.append((heights * (tops + bottoms) / 2.0).sum() / areas[-1])
    scale = np.sqrt(areas[0] / np.pi)  # pixels per R, of the disk that is still round
    centre = np.interp(times, series["t"], series["com_y"])
    centre += np.minimum(times, 0.0) * series["com_vy"][0]
    centre += np.maximum(times - last, 0.0) * series["com_vy"][-1]
    assert np.ptp(middles + scale * centre) < 0.95
    assert np.ptp(middles) > 20.0
    assert abs(middles[0] - middles[-1]) < 0.95


def test_a_film_holds_at_the_greatest_compression_and_ends_with_e(run, tmp_path):
    result = f"*e = {run.scenario.result(run.series)['restitution']:.3f}"
    words = words_of(tmp_path / "film", run, seconds=4)
    end = run.contact.end
    assert [one.note for one in words[-7:]] == 7 * [result]
    for one in words:
        assert (one.note == result) == (one.t >= end - 1e-4)
    held = [one.first for one in words if one.note == "greatest compression"]
    peak = run.series["t"][run.series["elastic"].argmax()]
    assert len(held) >= 2
    assert set(held) == {f"t = {peak:.2f} R/c"}
    moving = list({one.t: one.pace for one in words if one.pace != [""]}.items())
    pace = np.array([float(lines[0].split()[3]) for _, lines in moving])
    # The paces add up to the simulated time; the contact is in slow motion.
    span = words[-1].t - words[0].t
    assert (pace[:-1] / 10).sum() == pytest.approx(span, rel=0.04)
    is_slow = [len(lines) > 1 for _, lines in moving]
    middle = len(moving) // 2
    assert is_slow[middle]
    assert not is_slow[2]
    assert not is_slow[-2]
    assert 0.5 < np.mean(is_slow) < 0.95
    factor = re.fullmatch("slowed ([0-9]+) times", moving[middle][1][1])
    assert float(factor[1]) == pytest.approx(pace.max() / pace.min(), rel=0.2)
    assert pace.max() > 4.0 * pace.min()


def test_a_page_with_few_states_says_its_own_pace(run, tmp_path, monkeypatch):
    monkeypatch.setattr("taichi_disk.pictures.web.film._STATES", 1)
    words = words_of(tmp_path / "film", run, seconds=8)
    assert len(words) == 40  # in the place of 80
    moving = list({one.t: one.pace for one in words if one.pace != [""]}.values())
    pace = np.array([float(lines[0].split()[3]) for lines in moving])
    assert pace[:-1].sum() / 5 == pytest.approx(words[-1].t - words[0].t, rel=0.04)


@pytest.mark.parametrize("eta_star", [0, 0.1])
def test_ringing_is_shown_half_as_strong_as_the_compression(eta_star, monkeypatch):
    scene = load_scene("exponential_wall", ["lattice.points=150"])
    run = api.run(scene.with_(velocity=0.05, eta_star=eta_star), lattices=1)
    lattice = run.lattice
    triangles = Triangles(lattice)

    def shear(t):
        (state,) = run.frames([t])
        values = at_points("shear", triangles, run.scenario.model.springs, *state[1:])
        return np.percentile(values, 98)

    end = run.contact.end
    later = max(shear(t) for t in np.linspace(end + 0.5, end + 6.0, 12))
    factor = ringing(run)
    assert 0.3 < factor * later / shear(run.contact.greatest) < 1.0
    monkeypatch.setattr("taichi_disk.pictures.render.moments.FAINT", factor)
    assert ringing(run) == factor > 1.0  # up to FAINT, included


def test_a_ringing_grows_after_the_contact_and_the_picture_says_so(run):
    end = run.contact.end
    shots = [Caption(t) for t in (0.0, end - 0.1, *np.linspace(end, end + 2.0, 9))]
    found = captions(run, shots, stronger=4.0, ease=6.0)
    factors = [one.ringing for one in found]
    assert factors[:2] == [1.0, 1.0]
    assert (np.diff(factors[1:8]) > 0.0).all()
    assert factors[7:] == pytest.approx([4.0] * 4)
    said = ["shown 4 times stronger" in one.remarks for one in found]
    assert said == [False] * 2 + [True] * 9
    assert all(not one.remarks for one in captions(run, shots))


def test_no_ringing_is_shown_where_there_is_none():
    walled = ("absorbing_wall", "lattice.points=60", "wall.points=60", "wall.width=3")
    for kind, *settings in (("compression", *PRESSED), walled):
        scenario = load_scene(kind, settings).scenario()
        assert ringing(SimpleNamespace(scenario=scenario)) == 1.0
    damped = ("lattice.points=60", "material.eta_star=10")
    assert ringing(computed("exponential_wall", *damped)) == 1.0


@pytest.mark.parametrize("at", ["greatest", "contact", "end", 1.5])
def test_a_picture_is_of_the_moment_asked_for(run, at):
    notes = {"greatest": "greatest compression", "contact": "first contact"}
    series = run.series
    force = series["wall_force"]
    moments = {
        "greatest": series["t"][series["elastic"].argmax()],
        "contact": series["t"][np.argmax(force > 0.01 * force.max())],
        "end": series["t"][-1],
    }
    _, _, [(words,)] = storyboard([run], video_of({}), Span(at=at), 1, 10.0)
    assert words.t == pytest.approx(moments.get(at, at), abs=0.1)
    assert words.note == notes.get(at, "")
    assert bool(words.result) == (at == "end")


def test_runs_side_by_side_are_named_by_what_sets_them_apart():
    def named(*changes):
        runs = []
        for change in changes:
            scene = load_scene("exponential_wall", ["lattice.points=20", *change])
            runs.append(SimpleNamespace(scenario=scene.scenario()))
        return [title[0] for title in titles(runs, ())]

    damped = [["material.eta_star=0"], ["material.eta_star=100"]]
    assert named(*damped) == ["η* = 0", "η* = 100"]
    found = named(["wall.a=50", "impact.velocity=0.1"], [])
    assert found == ["v = 0.1 c    a = 50/R", "v = 0.02 c    a = 300/R"]
    assert named([], []) == ["Impact on a rigid wall"] * 2  # nothing does


@needs_vulkan
def test_a_part_of_a_film_begins_and_ends_where_asked_at_its_pace(run, tmp_path):
    part = Span(start="contact", end="greatest")
    words = words_of(tmp_path / "part", run, part, seconds=2)
    start = time_of("contact", run)
    assert words[0].t == pytest.approx(start, abs=0.006)
    assert words[-1].t == pytest.approx(run.contact.greatest, abs=0.006)
    assert len(words) == 20
    with pytest.raises(InputError, match="a film must end after it begins"):
        film(tmp_path / "film.mp4", [run], Span(start="end", end="contact"))


def test_a_comparison_without_flight_ends_with_the_longest_run(run):
    shorter = replace(run, series={name: y[:-40] for name, y in run.series.items()})
    for runs in ([run, shorter], [shorter, run]):
        _, _, words = storyboard(runs, video_of({"flight": 0}), Span(), 20, 10.0)
        assert {one[-1].t for one in words} == {run.series["t"][-1]}
        assert all(one[-2].result for one in words)  # is held


@pytest.mark.parametrize(
    "span", [Span(at="later"), Span(at=-1.0), Span(at=1e9), Span(at=float("nan"))]
)
def test_an_unknown_moment_is_refused_with_the_list_of_known_ones(run, tmp_path, span):
    known = r"write greatest, contact, end, or a time within the run, 0 to \d"
    with pytest.raises(InputError, match=known):
        film(tmp_path / "picture.png", [run], span)


def test_a_compression_begins_with_no_minus_and_the_whole_disk_on_a_soft_wall():
    scenario = load_scene("compression", ["lattice.points=60"]).scenario()
    row = {"t": 0.0, "com_y": scenario.unloaded + 1e-9, "lowest_y": 0.0}
    assert scenario.caption(row)[-1] == "ξ = 0.0000 R"
    soft = load_scene("compression", [*PRESSED, "wall.a=10"]).scenario()
    assert soft.lattice.positions[:, 1].max() <= soft.view[3]


# ---- failures


@needs_vulkan
@pytest.mark.parametrize(
    ("suffix", "room"),
    [
        (".mp4", 0),
        (".mp4", 3000),
        (".mp4", 3001),  # of a second process
        (".gif", 3000),
        ("", 3000),
        pytest.param(".webm", 3000, marks=pytest.mark.validate),
    ],
)
def test_a_full_file_system_leaves_no_film(run, tmp_path, monkeypatch, suffix, room):
    # of this process, which later tests need
    monkeypatch.setattr("taichi_disk.pictures.render.artist._shares_memory", True)
    # A limit on file sizes gives the system errors of a full disk.
    _, most = resource.getrlimit(resource.RLIMIT_FSIZE)
    path = tmp_path / f"film{suffix}"
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, most))
    try:
        with (
            drawing_process(room == 3001) as artist,
            pytest.raises(SimulationError, match=f"cannot write {path}: File too lar"),
        ):
            film(path, [run], seconds=0.3, artist=artist)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    assert not list(tmp_path.iterdir())


@needs_vulkan
@pytest.mark.usefixtures("one_artist")
def test_curves_are_begun_before_what_they_need_last(run, tmp_path, monkeypatch):
    events = []
    begin = Artist.begin

    def note(artist, draw, *arguments):
        events.append(arguments[0] if draw is draw_early else draw)
        return begin(artist, draw, *arguments)

    monkeypatch.setattr(Artist, "begin", note)
    keys = ["lattice.points=20", "video.size=360", "video.seconds=0.2"]
    scene = load_scene("exponential_wall", keys)
    options = {"lattices": 2, "progress": lambda stage, *_: events.append(stage)}
    api.run(scene, tmp_path / "o", **options)
    order = ["simulate", "estimate", draw_plot, "lattices", plot_run]
    order += [draw_panel, "render"]
    assert list(dict.fromkeys(events)) == order
    drawn = draw_panel(panel_scene(run, Letters(360, 1.0, "light")))
    monkeypatch.setattr(
        finisher, "picture_of", lambda draw, _: {draw_panel: drawn}[draw]
    )
    monkeypatch.setattr(finisher, "draw_curves", lambda _, *what: events.append(what))
    film(tmp_path / "film.mp4", [run], size=360, seconds=0.2, panel="true")
    assert events[-1][0] is drawn


@needs_vulkan
def test_a_vulkan_that_does_not_work_is_reported(run, tmp_path, monkeypatch):
    def broken(*_, **__):
        raise RuntimeError("device lost")

    monkeypatch.setattr("taichi_disk.pictures.render.offscreen.Window", broken)
    with pytest.raises(TaichiDiskError, match=r"Vulkan cannot draw .* device lost"):
        film(tmp_path / "film.mp4", [run])
    assert not list(tmp_path.iterdir())


def test_without_vulkan_the_message_names_the_remedy(tmp_path):
    variables = ("VK_ICD_FILENAMES", "VK_DRIVER_FILES")
    nowhere = os.environ | dict.fromkeys(variables, "/nonexistent")
    nowhere["PYTHONPATH"] = str(Path(__file__).parents[2])
    code = (
        "from taichi_disk.pictures.render.artist import Artist; Artist().require_film()"
    )
    done = python("-c", code, cwd=tmp_path, env=nowhere)
    assert "NoPictures: " in done.stderr
    assert "no Vulkan driver" in done.stderr or "cannot be loaded" in done.stderr
    assert "without VK_ICD_FILENAMES=/nonexistent" in done.stderr
    install = "apt-get install -y --no-install-recommends libx11-6 mesa-vulkan-drivers"
    assert f"apt-get update && {install}" in done.stderr


@pytest.mark.parametrize(("spin", "eta_star"), [(0.3, 10), (0.5, 0)])
def test_a_spinning_disk_is_compressed_most_where_it_turns_back(spin, eta_star):
    changes = {"points": 60, "spin": spin, "eta_star": eta_star}
    scene = load_scene("exponential_wall").with_(**changes)
    run = api.run(scene, lattices=1)
    columns = run.series
    force = columns["wall_force"]
    # stretched by its spin before it touches the wall
    assert force[columns["elastic"].argmax()] < 1e-3 * force.max()
    speed = np.interp(run.contact.greatest, columns["t"], columns["com_vy"])
    assert abs(speed) < 0.1 * scene.impact.velocity


def test_a_loading_is_not_compared_with_a_relaxation_which_takes_time(tmp_path):
    runs = []
    for method in ("newton", "relaxation"):
        settings = ["lattice.points=20", f"compression.method={method}"]
        scenario = load_scene("compression", settings).scenario()
        runs.append(scenario.quasistatic(loads=2))
    differ = "differ in the meaning of time or in their results"
    with pytest.raises(InputError, match=differ):
        film(tmp_path / "film.mp4", runs)
    with pytest.raises(InputError, match=differ):
        write_page(tmp_path / "film.html", runs, video_of({}), silent)


# ---- soft springs


@needs_vulkan
def test_an_engine_with_other_shaders_draws_hard_springs(run, tmp_path, monkeypatch):
    film(tmp_path / "soft.png", [run])
    monkeypatch.setattr(engine, "versions", lambda: {"taichi": "1.7.5"})
    film(tmp_path / "hard.png", [run])
    soft, hard = (picture_in(tmp_path / name) for name in ("soft.png", "hard.png"))
    assert soft.shape == hard.shape
    assert not np.array_equal(soft, hard)
    assert np.abs(soft - hard).mean() < 2.0  # springs are as heavy


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


# ---- words


@needs_vulkan
def test_labels_replace_titles_one_for_each_run_and_letters_of_no_font_are_named(
    run, tmp_path, caplog, monkeypatch
):
    from matplotlib import font_manager

    runs = [run, run]
    assert [title[0] for title in titles(runs, ["a", "b"])] == ["a", "b"]
    with pytest.raises(InputError, match="1 labels for 2 runs: give one for each run"):
        film(tmp_path / "film.mp4", runs, Span(), ["a"])
    monkeypatch.setattr(font_manager, "findSystemFonts", list)
    film(tmp_path / "both.png", runs, Span(), ["\u76e4 1", "b"])
    assert "no font of this machine has the letters \u76e4" in caplog.text
    for label in ("\udcff", 3, ""):
        with pytest.raises(InputError, match="must be text that can be printed"):
            film(tmp_path / "no.png", runs, Span(), ["a", label])
