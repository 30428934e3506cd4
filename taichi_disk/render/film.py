"""The film of runs: when to look, what to write beside it, which value is full colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from taichi_disk.computation.driver import Moment
from taichi_disk.computation.outcome import Outcome, greatest_compression
from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import InputError
from taichi_disk.lattice import Array
from taichi_disk.output.files import atomic_write, check_pictures, holds_working_directory, origin
from taichi_disk.progress import Progress
from taichi_disk.render import require_film
from taichi_disk.render.geometry import View, edge_height
from taichi_disk.render.legend import Legend
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, round_near
from taichi_disk.render.pictures import Pictures, side_panel
from taichi_disk.render.video import video as encoded
from taichi_disk.signals import raise_if_interrupted

Cue = tuple[float, str | None]  # t [R/c] and the last line, None for the result

FORMATS = (".mp4", ".webm", ".gif", ".png", "")
_PAUSE, _END = 0.06, 0.10  # parts of a film that stand still at the greatest compression, and at the end
_LOOKS = 12  # times before the greatest compression from which the scale of colours is taken
_LONGEST = 4.0  # arrows of the full force that an arrow may be as long as: it ends in the picture
_BESIDE = 0.05  # what is seen at the least on either side of the disk, whose flight may take it out of the view [R]
_HIGHEST = 4.0  # where a disk is still seen that flies on while the one beside it is not yet done [R]
_BELOW = 0.16  # what is seen of the rigid wall below its edge [R]
_GREATEST = "greatest compression"
MOST_BYTES = 5e8  # of positions that are kept between the choice of the scales and the pictures
_PANEL = 360  # pixels of a picture from which curves beside it have room for their words


def check_target(path: Path) -> None:
    """Raise InputError unless the name of `path` says a format, or the folder there holds nothing but pictures."""
    if path.suffix not in FORMATS:
        raise InputError(
            f"cannot film into {path}: end the name with .mp4, .webm or .gif for a film, with .png for one picture, "
            "or with nothing for a folder of numbered pictures"
        )
    if not path.suffix:
        if holds_working_directory(path):
            raise InputError(f"cannot film into {path}: pictures would replace the folder you are in; name another")
        check_pictures(path)


def film(path: Path, runs: Sequence[Outcome], video: VideoSection, progress: Progress) -> None:
    """Film `runs` side by side into `path`, at the same times and in the same colours.

    The film stands still for a moment at the greatest compression, and at the end, where it tells the result.
    `ti.init` must have been called.

    Args:
        path: .mp4, .webm or .gif; .png for one picture, of the greatest compression; without a suffix a folder of
            pictures, 00001.png and so on. It appears once it is complete, and replaces what is there.

    Raises InputError for a suffix or a folder that cannot be, or runs that cannot be compared; SimulationError if the
    file cannot be written; TaichiDiskError if no film can be made on this machine.
    """
    check_target(path)
    if len({(run.scenario.time_label, *run.scenario.labels) for run in runs}) > 1:
        raise InputError("these runs cannot be compared: they have no time, or no result, in common")
    require_film()
    told = origin(*(replace(run.scenario.scene, video=video) for run in runs))
    if path.suffix == ".png":
        cues: list[Cue] = [(greatest_compression(runs[0].columns), _GREATEST)]
        video = replace(video, supersample=2.0)
    else:
        cues = _cues(runs, video)
    progress("render", 0, len(cues))

    def write(new: Path) -> None:
        shots = [_Shots(run, video, cues) for run in runs]
        with (
            closing(_pictures(shots, video, cues)) as pictures,
            encoded(new, path.suffix, pictures.width, video.size, video.fps, told) as append,
        ):
            moments = zip(*(one.moments() for one in shots), strict=True)
            words = zip(*(_lines(run, cues) for run in runs), strict=True)
            shown = None
            for k, ((t, _), lines) in enumerate(zip(cues, words, strict=True)):
                raise_if_interrupted()
                if t != shown:
                    picture, shown = pictures.draw(next(moments)), t
                append(partial(pictures.finish, picture, lines, t))
                progress("render", k + 1, len(cues))

    atomic_write(path, write)


# ---- when to look, and what to write


def _cues(runs: Sequence[Outcome], video: VideoSection) -> list[Cue]:
    """The pictures of a film, those of the run that lasts longest. Equal times in succession are one picture."""
    count = max(3, round(video.fps * video.seconds))
    pause, end = round(_PAUSE * count), max(round(_END * count), 1)
    longest = max(runs, key=lambda run: float(run.columns["t"][-1]))
    scenario, columns = longest.scenario, longest.columns
    times, peak = scenario.frame_times(columns, count - pause - end), greatest_compression(columns)
    greatest = int(np.abs(times - peak).argmin())
    if greatest == len(times) - 1:
        pause, end, greatest = 0, pause + end, len(times) - 1
    elif greatest > 0:
        times[greatest] = peak
    paces = [scenario.pace.format(float(f"{pace:.2g}")) for pace in video.fps * np.diff(times)]
    cues: list[Cue] = list(zip(times.tolist(), [*paces, *paces[-1:]], strict=True))
    still, result = (cues[greatest][0], _GREATEST), (cues[-1][0], None)
    return cues[: greatest + 1] + pause * [still] + cues[greatest + 1 :] + end * [result]


def _lines(run: Outcome, cues: Sequence[Cue]) -> Iterator[tuple[str, ...]]:
    """The lines for each moment; after the end the observables are those of the end."""
    scenario, columns, times = run.scenario, run.columns, [t for t, _ in cues]
    peak = greatest_compression(columns)
    rows = {name: np.interp(times, columns["t"], values) for name, values in columns.items()} | {"t": times}
    for k, (t, note) in enumerate(cues):
        last = f"*{scenario.marks(columns)[0]}" if note is None else note
        if note == _GREATEST and abs(t - peak) > 0.01 * peak:
            last = ""  # it is that of the run beside
        yield *scenario.caption({name: float(values[k]) for name, values in rows.items()}), last


# ---- how to draw


def _pictures(shots: Sequence[_Shots], video: VideoSection, cues: Sequence[Cue]) -> Pictures:
    runs, painters = [one.run for one in shots], [one.painter for one in shots]
    limit, full_force = max(one.limit for one in painters), max(one.full_force for one in painters)
    ends = [line for run in runs for line in _lines(run, (cues[0], (cues[-1][0], None)))]
    samples = [*(line for lines in ends for line in lines), *dict.fromkeys(note or "" for _, note in cues)]
    legends = []
    for painter, run in zip(painters, runs, strict=True):
        painter.limit, painter.full_force = limit, full_force
        legends.append(Legend(painter, video.size, video.size, run.scenario.title(), samples, len(ends[0])))
    views = [one.view for one in shots]
    (xmin, _, ymin, _), (_, xmax, _, ymax) = np.min(views, axis=0), np.max(views, axis=0)
    panel = None
    if video.panel and video.size >= _PANEL:
        panel = side_panel(runs, video.size, THEMES[video.theme])
    return Pictures(legends, video.size, (xmin, xmax, ymin, ymax), video.supersample, panel)


class _Shots:
    """The moments of a run that its pictures show, and how to draw them: both from one replay.

    Colours, arrows, the wall's edge and the view fit the greatest compression and, of a film, moments before it. The
    view holds the end of a film, too, up to which a disk flies on.
    """

    def __init__(self, run: Outcome, video: VideoSection, cues: Sequence[Cue]) -> None:
        scenario, columns = run.scenario, run.columns
        self.run, self._times = run, np.unique([t for t, _ in cues])
        self.painter = Painter(scenario.lattice, scenario.model.springs, scenario.model.wall)
        self.painter.colour, self.painter.draw, self.painter.theme = video.colour, video.draw, video.theme
        self.painter.spoke, self.painter.magnify = scenario.spoke, video.magnify
        peak, is_film, looks, positions = greatest_compression(columns), len(cues) > 1, self._times, []
        flies_on = is_film and cues[-1][0] > columns["t"][-1]
        if is_film:
            looks = scenario.frame_times(columns, 2 * _LOOKS)
            looks = looks[looks < peak][-_LOOKS:]
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
        self._fit([(x, v) for t, x, v in at_looks if t <= peak], [self.painter.placed(x) for x in positions])

    def _fit(self, states: Sequence[tuple[Array, Array]], positions: Sequence[Array]) -> None:
        """Choose the scales after `states`, the last one the most compressed, and the view after `positions`."""
        painter, scenario = self.painter, self.run.scenario
        painter.limit = max(painter.scale(painter.values(x, v)) for x, v in states)
        _, forces = painter.wall.contact_forces(painter.lattice, states[-1][0])
        largest = float(np.hypot(*forces.T).max(initial=0.0))
        full = max(largest, self.run.largest_push / _LONGEST)
        painter.full_force = round_near(full) if full else 0.0
        painter.edge = edge_height(painter.wall, largest)
        xmin, xmax, ymin, ymax = scenario.view
        if not len(scenario.lattice.wall_surface):  # of a rigid wall no more is seen than its uppermost part
            ymin = painter.edge - _BELOW
        disk = np.concatenate([x[: scenario.lattice.disk_points] for x in positions])
        (left, _), (right, top) = disk.min(axis=0), disk.max(axis=0)
        self.view: View = min(xmin, left - _BESIDE), max(xmax, right + _BESIDE), ymin, max(ymax, top)

    def moments(self) -> Iterator[Moment]:
        """The moments of the pictures, in their order."""
        if self._is_twice:
            return self.run.frames(self._times)
        return (moment for t, moment in self._replay if t in self._times)
