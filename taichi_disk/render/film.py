"""Make films and still pictures of runs: choose view and scales, and write the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from taichi_disk.computation.driver import State
from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import InputError
from taichi_disk.output.artist import Artist
from taichi_disk.output.files import (
    atomic_write,
    check_pictures,
    holds_working_directory,
    origin,
)
from taichi_disk.progress import Progress
from taichi_disk.render import require_film
from taichi_disk.render.legend import Legend, Letters, footer
from taichi_disk.render.moments import (
    WHOLE,
    Caption,
    Cue,
    Run,
    Span,
    captions,
    check_runs,
    cues,
    still_cue,
    titles,
)
from taichi_disk.render.painter import Painter
from taichi_disk.render.panel import Panel, begin_panel
from taichi_disk.render.pictures import Pictures, arranged
from taichi_disk.render.recording import CommonScales, Flight, Recording
from taichi_disk.render.scales import Scales
from taichi_disk.render.video import GIF_FPS
from taichi_disk.render.video import video as encoded
from taichi_disk.signals import raise_if_interrupted

FORMATS = (".mp4", ".webm", ".gif", ".html", ".png", "")
_LABEL_SIZE = 1.5  # size of a comparison's differing keys, relative to the title
# smallest picture beside which curves have room for their labels [px]
_MIN_PANEL_SIZE = 360
_PANEL_WIDTH = 7 / 9  # over the height: with one disk, a film is 16 : 9
_DISK_WIDTH = 8 / 9  # of one of several disks: two are 16 : 9, three 16 : 6
_PANEL_LETTER = 20.0  # in a picture of 720 pixels [px]


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


def prepare_film(
    path: Path,
    runs: Sequence[Run],
    video: VideoSection,
    progress: Progress,
    span: Span = WHOLE,
    labels: Sequence[str] = (),
    artist: Artist | None = None,
) -> Callable[[], None]:
    """Prepare to film `runs` side by side into `path`, at equal times and with one
    scale of colours, and return the function that does it.

    The film begins and ends in flight, pauses at the greatest compression, and shows
    the result at the end. `ti.init` must have been called.

    Args:
        path: .mp4, .webm or .gif; .png for one picture; without a suffix a folder of
            pictures 00001.png, 00002.png, … The file appears when it is complete, and
            replaces an older one.
        span: filmed part of the runs.
        labels: titles of compared runs; by default the keys that differ.
        artist: draws the curves.

    Raises InputError for an invalid suffix, folder or span, or for runs that cannot be
    compared; TaichiDiskError if this machine cannot make films. The returned function
    raises SimulationError if the file cannot be written.
    """
    check_target(path)
    check_runs(runs, labels)
    require_film()
    carried = film_origin(runs, video)
    flights = [Flight.of(run, video.flight) for run in runs]
    if path.suffix == ".gif":
        video = replace(video, fps=min(video.fps, GIF_FPS))
    if path.suffix == ".png":
        shots = [still_cue(runs[0], span)]
        video = replace(video, supersample=2.0)
    else:
        frames = round(video.fps * video.seconds)
        shots = cues(runs, common_span(flights), frames, video.fps, span)
    panel = None
    if video.panel and video.size >= _MIN_PANEL_SIZE and len(runs) == 1:
        size = 2 * round(video.size * _PANEL_WIDTH / 2), video.size
        letter = Letters(video.size / 720, video.text).size(_PANEL_LETTER)
        panel = begin_panel(artist or Artist(), runs[0], size, letter, video.theme)
    progress("render", 0, len(shots))

    def write(new: Path) -> None:
        times = [cue.t for cue in shots]
        states = [Recording(one, times, [video.colour]) for one in flights]
        pictures = _pictures(states, video, shots, titles(runs, labels), panel)
        size = pictures.width, video.size
        with (
            closing(pictures),
            encoded(new, path.suffix, size, video.fps, carried) as append,
        ):
            _film(states, shots, pictures, append, progress)

    return partial(atomic_write, path, write)


def common_span(flights: Sequence[Flight]) -> tuple[float, float]:
    """Return the first and last time of a film of several runs [R/c].

    No disk flies higher than in a film of its own, unless another run still goes on.
    """
    start = max(one.start for one in flights)
    last_run = max(float(one.run.series["t"][-1]) for one in flights)
    shortest_flight = min(one.end for one in flights)
    return start, max(shortest_flight, last_run)


def film_origin(runs: Sequence[Run], video: VideoSection) -> str:
    return origin(*(replace(run.scenario.stored_scene, video=video) for run in runs))


def _film(
    states: Sequence[Recording],
    shots: Sequence[Cue],
    pictures: Pictures,
    append: Callable[[Callable[[], Any]], None],
    progress: Progress,
) -> None:
    moments: Iterator[tuple[State, ...]]
    moments = zip(*(one.moments() for one in states), strict=True)
    words = zip(*(captions(one.run, shots) for one in states), strict=True)
    drawn: float | None = None
    finished: tuple[float, tuple[Caption, ...]] | None = None
    for k, (cue, each) in enumerate(zip(shots, words, strict=True)):
        raise_if_interrupted()
        if cue.t != drawn:
            images = pictures.draw(next(moments))
            drawn = cue.t
        finish: Callable[[], Any] = pictures.again
        if (cue.t, each) != finished:
            finish = partial(pictures.finish, images, each, cue.t)
            finished = cue.t, each
        append(finish)
        progress("render", k + 1, len(shots))


# ---- scales and views


def _pictures(
    states: Sequence[Recording],
    video: VideoSection,
    shots: Sequence[Cue],
    names: Sequence[tuple[str, ...]],
    panel: Panel | None,
) -> Pictures:
    letters = Letters(video.size / 720, video.text)
    common = CommonScales.of(states, video.magnify)
    width = video.size
    enlarged = 1.0
    if len(states) > 1:
        width = 2 * round(video.size * _DISK_WIDTH / 2)
        enlarged = _LABEL_SIZE
    size = width, video.size
    legends = []
    for one, title in zip(states, names, strict=True):
        samples = _samples(list(captions(one.run, shots)))
        painter = painter_of(one, video, common)
        legends.append(Legend(painter, size, letters, title, samples, enlarged))
    view = common.view
    foot = footer(letters, video.size)
    if foot and not legends[0].painter.has_elastic_wall:
        # the wall's body carries the scales
        view = (*view[:2], max(one.edge for one in states), view[3])
    outer = [one.outer_positions(common.magnify) for one in states]
    camera = arranged(legends, size, letters, view, outer)
    paces = {cue.pace for cue in shots}
    below = len(states) * width, foot
    scales = Scales(legends[0].painter, below, letters, camera.scale, paces)
    return Pictures(legends, scales, camera, view, video.supersample, panel)


def painter_of(states: Recording, video: VideoSection, common: CommonScales) -> Painter:
    """Return the painter that draws the states of one run."""
    scenario = states.run.scenario
    return Painter(
        lattice=scenario.lattice,
        springs=scenario.model.springs,
        wall=scenario.model.wall,
        colour=video.colour,
        draw=video.draw,
        theme=video.theme,
        limit=common.limits[video.colour],
        full_force=common.full_force,
        full_speed=states.full_speed,
        edge=states.edge,
        spoke=scenario.spoke,
        magnify=common.magnify,
    )


def _samples(words: Sequence[Caption]) -> list[Caption]:
    """Return the first and the last caption, and one of each kind."""
    kinds = {(one.note, one.result): one for one in words}
    return [words[0], words[len(words) // 2], words[-1], *kinds.values()]
