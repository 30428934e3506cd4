"""Make films and still pictures of runs: choose view and scales, and write the file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.driver import State
from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import InputError
from taichi_disk.lattice import Array
from taichi_disk.output.files import (
    atomic_write,
    check_pictures,
    holds_working_directory,
    origin,
)
from taichi_disk.progress import Progress
from taichi_disk.render import require_film
from taichi_disk.render.geometry import View, edge_height, flattening, magnification
from taichi_disk.render.legend import Legend
from taichi_disk.render.moments import (
    WHOLE,
    Cue,
    Run,
    Span,
    check_runs,
    cues,
    lines,
    scale_times,
    still_cue,
    titles,
)
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, round_near
from taichi_disk.render.pictures import Pictures, side_panel
from taichi_disk.render.video import video as encoded
from taichi_disk.signals import raise_if_interrupted

FORMATS = (".mp4", ".webm", ".gif", ".html", ".png", "")
# longest arrow over the arrow of `full_force`, so that arrows stay in the picture
_MAX_ARROW = 4.0
# smallest distance of the disk to the left and right edge of the picture [R]
_SIDE_MARGIN = 0.05
# greatest visible height of a disk that flies on until all compared runs have ended [R]
_MAX_HEIGHT = 4.0
_WALL_DEPTH = 0.16  # visible part of the rigid wall below its edge [R]
_LABEL_SIZE = 1.5  # size of a comparison's differing keys, relative to the title
# most memory for positions between the choice of the scales and the pictures
MAX_BYTES = 5e8
_MAX_NAME = 16  # most letters in the name of a curve
# smallest picture beside which curves have room for their labels [px]
_MIN_PANEL_SIZE = 360


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


def film(
    path: Path,
    runs: Sequence[Run],
    video: VideoSection,
    progress: Progress,
    span: Span = WHOLE,
) -> None:
    """Film `runs` side by side into `path`, at equal times and with one scale of
    colours.

    The film pauses at the greatest compression, and at the end, where it shows the
    result. `ti.init` must have been called.

    Args:
        path: .mp4, .webm or .gif; .png for one picture; without a suffix a folder of
            pictures 00001.png, 00002.png, … The file appears when it is complete, and
            replaces an older one.
        span: filmed part of the runs.

    Raises InputError for an invalid suffix, folder or span, or for runs that cannot be
    compared; SimulationError if the file cannot be written; TaichiDiskError if this
    machine cannot make films.
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
            encoded(
                new, path.suffix, (pictures.width, video.size), video.fps, carried
            ) as append,
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
    return origin(*(replace(run.scenario.scene, video=video) for run in runs))


# ---- scales and views


def _pictures(
    states: Sequence[States], video: VideoSection, shots: Sequence[Cue]
) -> Pictures:
    magnify = magnification(video.magnify, max(one.flattest for one in states))
    for one in states:
        one.painter.magnify = magnify
    runs, painters, views = zip(
        *((one.run, one.painter, one.view) for one in states), strict=True
    )
    limit, full_force = (
        max(one.limit for one in painters),
        max(one.full_force for one in painters),
    )
    ends = [
        each for run in runs for each in lines(run, (shots[0], (shots[-1][0], None)))
    ]
    samples = [
        *(line for each in ends for line in each),
        *dict.fromkeys(note or "" for _, note in shots),
    ]
    legends, enlarged = [], _LABEL_SIZE if len(runs) > 1 else 1.0
    for painter, title in zip(painters, titles(runs), strict=True):
        painter.limit, painter.full_force = limit, full_force
        legends.append(
            Legend(painter, video.size, title, samples, len(ends[0]), enlarged)
        )
    (xmin, _, ymin, _), (_, xmax, _, ymax) = (
        np.min(views, axis=0),
        np.max(views, axis=0),
    )
    panel = None
    if video.panel and video.size >= _MIN_PANEL_SIZE:
        panel = side_panel(runs, _names(titles(runs)), video.size, THEMES[video.theme])
    return Pictures(
        legends, video.size, (xmin, xmax, ymin, ymax), video.supersample, panel
    )


def _names(titles: Sequence[tuple[str, ...]]) -> list[str]:
    names = [title[0] for title in titles]
    fit = len(set(names)) == len(names) and max(map(len, names)) <= _MAX_NAME
    return names if fit else [f"{k}. from the left" for k in range(1, len(names) + 1)]


class States:
    """Moments of a run for its pictures, and the painter that draws them; both come
    from one replay.

    Scales of colours and arrows, the wall's edge and the view fit the greatest
    compression and, for films, moments before it. The view also contains the end of a
    film, when the disk has flown on.
    """

    def __init__(self, run: Run, video: VideoSection, shots: Sequence[Cue]) -> None:
        scenario, columns = run.scenario, run.columns
        self.run, self._times = run, np.unique([t for t, _ in shots])
        self.painter = Painter(
            scenario.lattice, scenario.model.springs, scenario.model.wall
        )
        self.painter.colour, self.painter.draw, self.painter.theme = (
            video.colour,
            video.draw,
            video.theme,
        )
        self.painter.spoke = scenario.spoke
        peak, is_film, sampled, positions = (
            greatest_compression(columns),
            len(shots) > 1,
            self._times,
            [],
        )
        flies_on = is_film and shots[-1][0] > columns["t"][-1]
        if is_film:
            sampled = np.array(scale_times(scenario, columns))
            positions = [run.positions]
        sampled = np.union1d(sampled, [peak, *self._times[-1:]] if flies_on else [peak])
        times = np.union1d(sampled, self._times)
        until_scale = times[times <= sampled[-1]]
        # The moments of millions of points do not fit into memory, so such a film is
        # replayed twice.
        self._is_twice = len(until_scale) * run.positions.nbytes > MAX_BYTES
        times, until_scale = (
            (sampled, sampled) if self._is_twice else (times, until_scale)
        )
        replay = run.frames(times)
        kept = [moment for _, moment in zip(until_scale, replay, strict=False)]
        self._replay = zip(times, chain(kept, replay), strict=True)
        scale_states = [
            (t, x, v)
            for t, (_, x, v) in zip(until_scale, kept, strict=True)
            if t in sampled
        ]
        positions += [
            x
            for t, x, _ in scale_states
            if t <= peak or not is_film or x[:, 1].max() < _MAX_HEIGHT
        ]
        self._view_positions = positions
        self._fit([(x, v) for t, x, v in scale_states if t <= peak])

    def _fit(self, states: Sequence[tuple[Array, Array]]) -> None:
        painter = self.painter
        painter.limit = max(painter.scale(painter.values(x, v)) for x, v in states)
        _, forces = painter.wall.contact_forces(painter.lattice, states[-1][0])
        largest = float(np.hypot(*forces.T).max(initial=0.0))
        full = max(largest, self.run.largest_force / _MAX_ARROW)
        painter.full_force = round_near(full) if full else 0.0
        painter.edge = edge_height(painter.wall, largest)
        self.flattest = flattening(painter.lattice, states[-1][0])

    @property
    def view(self) -> View:
        """Bounds [R] of the scene and of the disk as it is drawn."""
        painter, scenario = self.painter, self.run.scenario
        xmin, xmax, ymin, ymax = scenario.view
        # show only the uppermost part of a rigid wall
        if not len(scenario.lattice.wall_surface):
            ymin = painter.edge - _WALL_DEPTH
        disk = np.concatenate(
            [
                painter.placed(x)[: scenario.lattice.disk_points]
                for x in self._view_positions
            ]
        )
        (left, _), (right, top) = disk.min(axis=0), disk.max(axis=0)
        return (
            min(xmin, left - _SIDE_MARGIN),
            max(xmax, right + _SIDE_MARGIN),
            ymin,
            max(ymax, top),
        )

    def moments(self) -> Iterator[State]:
        if self._is_twice:
            return self.run.frames(self._times)
        return (moment for t, moment in self._replay if t in self._times)
