"""The film of runs, or one picture: which part of a scene is seen, which value is full colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.driver import Moment
from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import InputError
from taichi_disk.lattice import Array
from taichi_disk.output.files import atomic_write, check_pictures, holds_working_directory, origin
from taichi_disk.progress import Progress
from taichi_disk.render import require_film
from taichi_disk.render.geometry import View, edge_height, flattening, magnification
from taichi_disk.render.legend import Legend
from taichi_disk.render.moments import WHOLE, Cue, Run, Span, check_runs, cues, lines, scale_times, still_cue, titles
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, round_near
from taichi_disk.render.pictures import Pictures, side_panel
from taichi_disk.render.video import video as encoded
from taichi_disk.signals import raise_if_interrupted

FORMATS = (".mp4", ".webm", ".gif", ".html", ".png", "")
_LONGEST = 4.0  # arrows of the full force that an arrow may be as long as: it ends in the picture
_BESIDE = 0.05  # what is seen at the least on either side of the disk, whose flight may take it out of the view [R]
_HIGHEST = 4.0  # where a disk is still seen that flies on while the one beside it is not yet done [R]
_BELOW = 0.16  # what is seen of the rigid wall below its edge [R]
_LABEL = 1.5  # times as large as a title is what sets a run apart from those beside it
MOST_BYTES = 5e8  # of positions that are kept between the choice of the scales and the pictures
_LONGEST_NAME = 16  # letters
_PANEL = 360  # pixels of a picture from which curves beside it have room for their words


def check_target(path: Path) -> None:
    """Raise InputError unless the name of `path` says a format, or the folder there holds nothing but pictures."""
    if path.suffix not in FORMATS:
        raise InputError(
            f"cannot film into {path}: end the name with .mp4, .webm or .gif for a film, with .html for one to play "
            "with, with .png for one picture, or with nothing for a folder of numbered pictures"
        )
    if not path.suffix:
        if holds_working_directory(path):
            raise InputError(f"cannot film into {path}: pictures would replace the folder you are in; name another")
        check_pictures(path)


def film(path: Path, runs: Sequence[Run], video: VideoSection, progress: Progress, span: Span = WHOLE) -> None:
    """Film `runs` side by side into `path`, at the same times and in the same colours.

    The film stands still for a moment at the greatest compression, and at the end, where it tells the result.
    `ti.init` must have been called.

    Args:
        path: .mp4, .webm or .gif; .png for one picture; without a suffix a folder of pictures, 00001.png and so on. It
            appears once it is complete, and replaces what is there.
        span: which part of the runs.

    Raises InputError for a suffix, a folder or a span that cannot be, or runs that cannot be compared; SimulationError
    if the file cannot be written; TaichiDiskError if no film can be made on this machine.
    """
    check_target(path)
    check_runs(runs)
    require_film()
    carried = film_origin(runs, video)
    if path.suffix == ".png":
        shots, video = [still_cue(runs[0], span)], replace(video, supersample=2.0)
    else:
        shots = cues(runs, round(video.fps * video.seconds), video.fps, span)
    progress("render", 0, len(shots))

    def write(new: Path) -> None:
        states = [States(run, video, shots) for run in runs]
        with (
            closing(_pictures(states, video, shots)) as pictures,
            encoded(new, path.suffix, pictures.width, video.size, video.fps, carried) as append,
        ):
            moments = zip(*(one.moments() for one in states), strict=True)
            words = zip(*(lines(run, shots) for run in runs), strict=True)
            shown = None
            for k, ((t, _), each) in enumerate(zip(shots, words, strict=True)):
                raise_if_interrupted()
                if t != shown:
                    picture, shown = pictures.draw(next(moments)), t
                append(partial(pictures.finish, picture, each, t))
                progress("render", k + 1, len(shots))

    atomic_write(path, write)


def film_origin(runs: Sequence[Run], video: VideoSection) -> str:
    """Return what the file of a film carries: its scenes."""
    return origin(*(replace(run.scenario.scene, video=video) for run in runs))


# ---- how to draw


def _pictures(states: Sequence[States], video: VideoSection, shots: Sequence[Cue]) -> Pictures:
    magnify = magnification(video.magnify, max(one.flattest for one in states))
    for one in states:
        one.painter.magnify = magnify
    runs, painters, views = zip(*((one.run, one.painter, one.view) for one in states), strict=True)
    limit, full_force = max(one.limit for one in painters), max(one.full_force for one in painters)
    ends = [each for run in runs for each in lines(run, (shots[0], (shots[-1][0], None)))]
    samples = [*(line for each in ends for line in each), *dict.fromkeys(note or "" for _, note in shots)]
    legends, enlarged = [], _LABEL if len(runs) > 1 else 1.0
    for painter, title in zip(painters, titles(runs), strict=True):
        painter.limit, painter.full_force = limit, full_force
        legends.append(Legend(painter, video.size, title, samples, len(ends[0]), enlarged))
    (xmin, _, ymin, _), (_, xmax, _, ymax) = np.min(views, axis=0), np.max(views, axis=0)
    panel = None
    if video.panel and video.size >= _PANEL:
        panel = side_panel(runs, _names(titles(runs)), video.size, THEMES[video.theme])
    return Pictures(legends, video.size, (xmin, xmax, ymin, ymax), video.supersample, panel)


def _names(titles: Sequence[tuple[str, ...]]) -> list[str]:
    """Return what the curves of each run are called: its title, or its place where titles are long or the same."""
    names = [title[0] for title in titles]
    fit = len(set(names)) == len(names) and max(map(len, names)) <= _LONGEST_NAME
    return names if fit else [f"{k}. from the left" for k in range(1, len(names) + 1)]


class States:
    """The moments of a run that its pictures show, and how to draw them: both from one replay.

    Colours, arrows, the wall's edge and the view fit the greatest compression and, of a film, moments before it. The
    view holds the end of a film, too, up to which a disk flies on.
    """

    def __init__(self, run: Run, video: VideoSection, shots: Sequence[Cue]) -> None:
        scenario, columns = run.scenario, run.columns
        self.run, self._times = run, np.unique([t for t, _ in shots])
        self.painter = Painter(scenario.lattice, scenario.model.springs, scenario.model.wall)
        self.painter.colour, self.painter.draw, self.painter.theme = video.colour, video.draw, video.theme
        self.painter.spoke = scenario.spoke
        peak, is_film, looks, positions = greatest_compression(columns), len(shots) > 1, self._times, []
        flies_on = is_film and shots[-1][0] > columns["t"][-1]
        if is_film:
            looks = np.array(scale_times(scenario, columns))
            positions = [run.positions]
        looks = np.union1d(looks, [peak, *self._times[-1:]] if flies_on else [peak])
        times = np.union1d(looks, self._times)
        until_scale = times[times <= looks[-1]]
        # A film of millions of points is replayed twice: not all of these moments fit into memory.
        self._is_twice = len(until_scale) * run.positions.nbytes > MOST_BYTES
        times, until_scale = (looks, looks) if self._is_twice else (times, until_scale)
        replay = run.frames(times)
        kept = [moment for _, moment in zip(until_scale, replay, strict=False)]
        self._replay = zip(times, chain(kept, replay), strict=True)
        at_looks = [(t, x, v) for t, (_, x, v) in zip(until_scale, kept, strict=True) if t in looks]
        positions += [x for t, x, _ in at_looks if t <= peak or not is_film or x[:, 1].max() < _HIGHEST]
        self._seen = positions
        self._fit([(x, v) for t, x, v in at_looks if t <= peak])

    def _fit(self, states: Sequence[tuple[Array, Array]]) -> None:
        """Choose the scales after `states`, the last one the most compressed."""
        painter = self.painter
        painter.limit = max(painter.scale(painter.values(x, v)) for x, v in states)
        _, forces = painter.wall.contact_forces(painter.lattice, states[-1][0])
        largest = float(np.hypot(*forces.T).max(initial=0.0))
        full = max(largest, self.run.largest_force / _LONGEST)
        painter.full_force = round_near(full) if full else 0.0
        painter.edge = edge_height(painter.wall, largest)
        self.flattest = flattening(painter.lattice, states[-1][0])

    @property
    def view(self) -> View:
        """What holds the disk as it is drawn [R]."""
        painter, scenario = self.painter, self.run.scenario
        xmin, xmax, ymin, ymax = scenario.view
        if not len(scenario.lattice.wall_surface):  # of a rigid wall no more is seen than its uppermost part
            ymin = painter.edge - _BELOW
        disk = np.concatenate([painter.placed(x)[: scenario.lattice.disk_points] for x in self._seen])
        (left, _), (right, top) = disk.min(axis=0), disk.max(axis=0)
        return min(xmin, left - _BESIDE), max(xmax, right + _BESIDE), ymin, max(ymax, top)

    def moments(self) -> Iterator[Moment]:
        """The moments of the pictures, in their order."""
        if self._is_twice:
            return self.run.frames(self._times)
        return (moment for t, moment in self._replay if t in self._times)
