"""Make films and still pictures of runs: choose view and scales, and write the file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import NOTICES, InputError
from taichi_disk.output.files import (
    atomic_write,
    check_pictures,
    holds_working_directory,
    origin,
)
from taichi_disk.output.panel import PanelScene
from taichi_disk.progress import Progress
from taichi_disk.render import require_film
from taichi_disk.render.artist import Artist
from taichi_disk.render.letters import Letters, lacking
from taichi_disk.render.moments import (
    EASE,
    WHOLE,
    Caption,
    Run,
    Span,
    captions,
    check_runs,
    cues,
    ringing,
    still_cue,
    titles,
)
from taichi_disk.render.painter import Painter
from taichi_disk.render.panel import panel_scene
from taichi_disk.render.pictures import Disk, Pictures, disk_width
from taichi_disk.render.recording import Flight, Recording, Scales
from taichi_disk.render.video import GIF_FPS
from taichi_disk.render.words import Title, fitting_letters
from taichi_disk.signals import raise_if_interrupted

FORMATS = (".mp4", ".webm", ".gif", ".html", ".png", "")
# Curves have room for their labels beside a picture of this height, if it is so many
# times higher than the letters of their titles.
_MIN_PANEL_SIZE = 360
_MIN_PANEL_LINES = 20
# The springs of larger lattices are left out of a GIF, where they take two thirds of
# the bytes and are less than 10 pixels apart.
_GIF_POINTS = 800
_LABEL_SIZE = 1.5  # size of a comparison's differing keys, relative to the title


def check_target(path: Path) -> None:
    """Raise InputError unless the suffix of `path` is a format, or `path` is a folder
    of pictures or does not exist."""
    if path.suffix not in FORMATS:
        raise InputError(
            f"cannot film into {path}: end the name with .mp4, .webm or .gif for a"
            " film, .html for an interactive film, .png for one picture, or nothing"
            " for a folder of numbered pictures"
        )
    if not path.suffix:
        if holds_working_directory(path):
            raise InputError(
                f"cannot film into {path}: pictures would replace the current folder;"
                " name another"
            )
        check_pictures(path)


def draw_film(
    path: Path,
    runs: Sequence[Run],
    video: VideoSection,
    progress: Progress,
    span: Span = WHOLE,
    labels: Sequence[str] = (),
    artist: Artist | None = None,
) -> None:
    """Film `runs` side by side into `path`, at equal times and with one scale of
    colours.

    The film begins and ends in flight, pauses at the greatest compression, and shows
    the result at the end. `ti.init` must have been called.

    Args:
        path: .mp4, .webm or .gif; .png for one picture; without a suffix a folder of
            pictures 00001.png, 00002.png, … The file appears when it is complete, and
            replaces an older one.
        span: filmed part of the runs.
        labels: titles of compared runs; by default the keys that differ.
        artist: finishes the pictures and encodes them.

    Raises InputError for an invalid suffix, folder or span, or for runs that cannot be
    compared; TaichiDiskError if this machine cannot make films; SimulationError if the
    file cannot be written.
    """
    check_target(path)
    check_runs(runs, labels)
    require_film(artist)
    size, fps = video.size_and_rate(path.suffix[1:])
    metadata = film_origin(runs, video)
    if path.suffix == ".gif":
        fps = min(fps, GIF_FPS)
        finest = max(run.scenario.lattice.disk_points for run in runs)
        if video.draw == "both" and finest > _GIF_POINTS:
            video = replace(video, draw="field")
    flights = [Flight.of(run, video.flight) for run in runs]
    stronger = [ringing_factor(run, video) for run in runs]
    if path.suffix == ".png":
        shots = [still_cue(runs[0], span)]
        video = replace(video, supersample=2.0)
    else:
        frames = round(fps * video.seconds)
        rings = max(stronger) > 1.0
        shots = cues(runs, common_span(flights), frames, fps, span, rings)
    words = [
        captions(run, shots, factor, EASE * fps)
        for run, factor in zip(runs, stronger, strict=True)
    ]
    letters = fitting_letters(
        Letters(size, video.text, video.theme, video.words == "few"),
        words,
        disk_width(size, len(runs)),
    )
    names = titles(runs, labels)
    _note_lacking_letters(names)
    panel = None
    has_room = size >= max(_MIN_PANEL_SIZE, _MIN_PANEL_LINES * letters.text.size)
    if video.panel and len(runs) == 1 and has_room:
        panel = panel_scene(runs[0], letters, video.theme)
    progress("render", 0, len(shots))
    artist = artist or Artist()

    def write(new: Path) -> None:
        times = [cue.t for cue in shots]
        recordings = [
            Recording(one, times, [video.colour], factor)
            for one, factor in zip(flights, stronger, strict=True)
        ]
        pictures = _pictures(recordings, words, video, letters, names, panel)
        options = pictures.finisher, new, path.suffix, fps, metadata
        with closing(pictures), artist.employ(*options) as finish:
            for k, call in enumerate(_drawn(pictures, recordings, words)):
                finish(*call)
                progress("render", k + 1, len(shots))

    atomic_write(path, write)


def size_text(path: Path) -> str:
    """Return the size of a film or a folder of pictures in words."""
    files = [path, *path.glob("*")]
    size = sum(file.stat().st_size for file in files if file.is_file())
    return f"{size / 1e6:.2g} MB"


def _note_lacking_letters(names: Sequence[tuple[str, ...]]) -> None:
    letters = "".join(sorted({*lacking("".join(map("".join, names)))}))
    if letters:
        NOTICES.warning(
            f"no font of this machine has the letters {letters}, which are drawn as"
            " boxes: install a font that has them, or change the label"
        )


def common_span(flights: Sequence[Flight]) -> tuple[float, float]:
    """Return the first and last time of a film of several runs [R/c].

    No disk flies higher than in a film of its own, unless another run still goes on.
    """
    start = max(one.start for one in flights)
    last_run = max(float(one.run.series["t"][-1]) for one in flights)
    shortest_flight = min(one.end for one in flights)
    return start, max(shortest_flight, last_run)


def ringing_factor(run: Run, video: VideoSection) -> float:
    """Return how many times stronger a film shows the vibration after an impact."""
    if video.ringing == "none":
        return 1.0
    return ringing(run)


def film_origin(runs: Sequence[Run], video: VideoSection) -> str:
    return origin(*(replace(run.scenario.stored_scene, video=video) for run in runs))


def _pictures(
    recordings: Sequence[Recording],
    words: Sequence[Sequence[Caption]],
    video: VideoSection,
    letters: Letters,
    names: Sequence[tuple[str, ...]],
    panel: PanelScene | None,
) -> Pictures:
    scales = Scales.of(recordings, video.magnify)
    enlarged = 1.0
    if len(recordings) > 1:
        enlarged = _LABEL_SIZE
    disks = []
    for one, lines, each in zip(recordings, names, words, strict=True):
        painter = painter_of(one, video, scales)
        title = Title(lines[0], enlarged=enlarged)
        if not letters.are_few:
            parameters = "    ".join(lines[1:]).split("    ")
            title = Title(lines[0], parameters, painter.remarks, enlarged)
        disks.append(Disk(painter, title, each, one.outer_positions(scales.magnify)))
    xmin, xmax, ymin, ymax = scales.view
    if disks[0].painter.has_elastic_wall:
        ymin *= 0.5  # the wall's upper half
    elif letters.footer:
        ymin = max(one.edge for one in recordings)  # the wall's body carries the scales
    view = xmin, xmax, ymin, ymax
    return Pictures(disks, letters, view, video.supersample, panel)


def painter_of(recording: Recording, video: VideoSection, scales: Scales) -> Painter:
    """Return the painter that draws the states of one run."""
    scenario = recording.run.scenario
    return Painter(
        lattice=scenario.lattice,
        springs=scenario.model.springs,
        wall=scenario.model.wall,
        colour=video.colour,
        draw=video.draw,
        theme=video.theme,
        limit=scales.limits[video.colour],
        full_force=scales.full_force,
        full_speed=recording.full_speed,
        edge=recording.edge,
        spoke=scenario.spoke,
        magnify=scales.magnify,
    )


def _drawn(
    pictures: Pictures,
    recordings: Sequence[Recording],
    words: Sequence[Sequence[Caption]],
) -> Iterator[tuple[Any, ...]]:
    """Draw one picture after the other, and yield the calls of a `Finisher` that append
    it: the name of its method, and the arguments."""
    states = zip(*(one.states() for one in recordings), strict=True)
    before: Sequence[Caption] = ()
    for now in zip(*words, strict=True):
        raise_if_interrupted()
        if not before or now[0].t != before[0].t:
            state = next(states)
        if now == before:
            yield ("repeat",)
        else:
            yield "write", pictures.draw(state, now), pictures.lines(now), now[0].t
        before = now
