"""Make films and still pictures of runs: choose view and scales, and write the file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from contextlib import closing
from dataclasses import replace
from pathlib import Path

from taichi_disk.base.errors import NOTICES, InputError
from taichi_disk.base.files import atomic_write, check_pictures
from taichi_disk.base.processes.early import draw_early
from taichi_disk.base.progress import Progress
from taichi_disk.base.signals import raise_if_interrupted
from taichi_disk.experiments.computation.words import Lines
from taichi_disk.experiments.config.sections import VideoSection
from taichi_disk.experiments.scenes.scene import origin
from taichi_disk.pictures.panel import PanelScene, draw_panel
from taichi_disk.pictures.render.artist import Artist
from taichi_disk.pictures.render.letters import Letters, lacking
from taichi_disk.pictures.render.moments import (
    EASE,
    MOMENTS,
    WHOLE,
    Caption,
    Runs,
    Shots,
    Span,
    captions,
    cues,
    film_end,
    ringing,
    time_of,
    titles,
)
from taichi_disk.pictures.render.painter import Painter
from taichi_disk.pictures.render.panel import panel_scene
from taichi_disk.pictures.render.pictures import Disk, Pictures, disk_width
from taichi_disk.pictures.render.recording import Flight, Recording, Scales
from taichi_disk.pictures.render.video import GIF_FPS
from taichi_disk.pictures.render.words import Title, fitting_letters

FORMATS = (".mp4", ".webm", ".gif", ".html", ".png", "")
# Curves have room for their labels beside a picture of this height, if it is so many
# times higher than the letters of their titles.
_MIN_PANEL_SIZE = 360
_MIN_PANEL_LINES = 20
# The springs of larger lattices are left out of a GIF, where they take two thirds of
# the bytes and are less than 10 pixels apart.
_GIF_POINTS = 800
FEWEST_PICTURES = 3  # of a film
_LABEL_SIZE = 1.5  # size of a comparison's differing keys, relative to the title


def check_target(path: Path) -> None:
    """Raise InputError unless the suffix of `path` is a format, or `path` is a folder
    of pictures or does not exist; plot.png would replace the curves of a run."""
    if path.suffix not in FORMATS or path.name == "plot.png":
        raise InputError(
            f"cannot film into {path}: end the name with .mp4, .webm or .gif for a"
            " film, .html for an interactive film, .png for one picture, or nothing"
            " for a folder of numbered pictures; plot.png is the name of curves"
        )
    if not path.suffix:
        if Path.cwd().is_relative_to(os.path.realpath(path)):
            raise InputError(
                f"cannot film into {path}: pictures would replace the current folder;"
                " name another"
            )
        check_pictures(path)


def draw_film(
    path: Path,
    runs: Runs,
    video: VideoSection,
    progress: Progress,
    artist: Artist,
    span: Span = WHOLE,
    labels: Sequence[str] = (),
) -> None:
    """Film `runs` side by side into `path`, at equal times and with one scale of
    colours.

    The film begins and ends in flight, pauses at the greatest compression, and shows
    the result at the end. `ti.init` must have been called.

    Args:
        path: .mp4, .webm or .gif; .png for one picture; without a suffix a folder of
            pictures 00001.png, 00002.png, … The file appears when it is complete, and
            replaces an older one.
        artist: finishes the pictures and encodes them.
        span: filmed part of the runs.
        labels: titles of compared runs; by default the keys that differ.

    Raises InputError for an invalid suffix, folder or span, or for runs that cannot be
    compared; TaichiDiskError if this machine cannot make films; SimulationError if the
    file cannot be written.
    """
    check_target(path)
    names = titles(runs, labels)
    artist.require_film()
    size, fps = video.size_and_rate(path.suffix[1:])
    metadata = film_origin(runs, video)
    if path.suffix == ".gif":
        fps = min(fps, GIF_FPS)
        finest = max(run.scenario.lattice.disk_points for run in runs)
        if video.draw == "both" and finest > _GIF_POINTS:
            video = replace(video, draw="field")
    frames = max(round(fps * video.seconds), FEWEST_PICTURES)
    if path.suffix == ".png":
        frames = 1
        video = replace(video, supersample=2.0)
    flights, strengths, words = storyboard(runs, video, span, frames, fps)
    letters = fitting_letters(
        Letters(size, video.text, video.theme, video.words == "few"),
        words,
        disk_width(size, len(runs)),
    )
    _note_lacking_letters(names)
    panel = None
    has_room = size >= max(_MIN_PANEL_SIZE, _MIN_PANEL_LINES * letters.text.size)
    if video.panel and len(runs) == 1 and has_room:
        panel = panel_scene(runs[0], letters)
        artist.begin(draw_early, draw_panel, panel)  # while pictures are arranged
    progress("render", 0, len(words[0]))

    def write(new: Path) -> None:
        times = [caption.t for caption in words[0]]
        recordings = [
            Recording(one, times, [video.colour], strength)
            for one, strength in zip(flights, strengths, strict=True)
        ]
        pictures = _pictures(recordings, words, video, letters, names, panel)
        states = zip(*(one.states() for one in recordings), strict=True)
        options = pictures.finisher, new, path.suffix, fps, metadata
        before: Shots = ()
        with closing(pictures), artist.employ(*options) as finish:
            for k, now in enumerate(zip(*words, strict=True)):
                raise_if_interrupted()
                if not before or now[0].t != before[0].t:
                    state = next(states)
                if now == before:
                    finish("repeat")
                else:
                    drawn = pictures.draw(state, now)
                    finish("write", drawn, pictures.lines(now), now[0].t)
                before = now
                progress("render", k + 1, len(times))

    atomic_write(path, write)


def storyboard(
    runs: Runs, video: VideoSection, span: Span, frames: int, rate: float
) -> tuple[list[Flight], list[float], list[list[Caption]]]:
    """Return the flight of each run, how many times stronger its vibration is shown
    after the impact, and its pictures: one, or at least FEWEST_PICTURES `frames`, of
    which `rate` are shown in a second.

    Raises InputError for an invalid span.
    """
    flights = [Flight.of(run, video.flight) for run in runs]
    strengths = [ringing(run) for run in runs]
    if video.ringing == "none":
        strengths = [1.0 for _ in runs]
    if frames == 1:
        note = MOMENTS.get(str(span.at), "")
        shots = [Caption(time_of(span.at, runs[0]), note)]
    else:
        # No disk flies higher than in a film of its own, unless another run goes on.
        start = max(one.start for one in flights)
        last_run = max(map(film_end, runs))
        end = max(min(one.end for one in flights), last_run)
        shots = cues(runs, (start, end), frames, rate, span, max(strengths) > 1.0)
    words = [
        captions(run, shots, strength, EASE * rate)
        for run, strength in zip(runs, strengths, strict=True)
    ]
    return flights, strengths, words


def size_text(path: Path) -> str:
    """Return the size of a film or a folder of pictures in words."""
    files = [path, *path.glob("*")]
    size = sum(file.stat().st_size for file in files if file.is_file())
    return f"{size / 1e6:.2g} MB"


def _note_lacking_letters(names: Sequence[Lines]) -> None:
    letters = "".join(sorted({*lacking("".join(map("".join, names)))}))
    if letters:
        NOTICES.warning(
            f"no font of this machine has the letters {letters}, which are drawn as"
            " boxes: install a font that has them, or change the label"
        )


def film_origin(runs: Runs, video: VideoSection) -> str:
    return origin(*(replace(run.scenario.stored_scene, video=video) for run in runs))


def _pictures(
    recordings: Sequence[Recording],
    words: Sequence[Shots],
    video: VideoSection,
    letters: Letters,
    names: Sequence[Lines],
    panel: PanelScene | None,
) -> Pictures:
    scales = Scales.of(recordings, video.magnify)
    enlarged = 1.0
    if len(recordings) > 1:
        enlarged = _LABEL_SIZE
    disks = []
    for one, lines, each in zip(recordings, names, words, strict=True):
        scenario = one.run.scenario
        painter = Painter(
            lattice=scenario.lattice,
            springs=scenario.model.springs,
            wall=scenario.model.wall,
            colour=video.colour,
            draw=video.draw,
            theme=video.theme,
            limit=scales.limits[video.colour],
            full_force=scales.full_force,
            full_speed=one.full_speed,
            edge=one.edge,
            spoke=scenario.spoke,
            magnify=scales.magnify,
        )
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
