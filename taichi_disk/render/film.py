"""The film of runs: when to look, what to write beside it, which value is full colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import closing
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np

from taichi_disk.computation.contact import greatest_compression
from taichi_disk.computation.outcome import Outcome
from taichi_disk.computation.scenario import Scenario
from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import InputError
from taichi_disk.output.files import atomic_write, check_pictures, origin
from taichi_disk.progress import Progress
from taichi_disk.render import require_film
from taichi_disk.render.geometry import View, edge_height
from taichi_disk.render.legend import Legend
from taichi_disk.render.painter import Painter
from taichi_disk.render.palette import THEMES, round_near
from taichi_disk.render.pictures import Pictures, side_panel
from taichi_disk.render.video import video as encoded
from taichi_disk.signals import raise_if_interrupted

Run = tuple[Scenario, Outcome]
Cue = tuple[float, str | None]  # t [R/c] and the last line, None for the result

FORMATS = (".mp4", ".webm", ".gif", ".png", "")
_PAUSE, _END = 0.06, 0.10  # parts of a film that stand still at the greatest compression, and at the end
_LOOKS = 12  # times before the greatest compression from which the scale of colours is taken
_LONGEST = 4.0  # arrows of the full force that an arrow may be as long as: it ends in the picture
_BESIDE = 0.05  # what is seen at the least on either side of the disk, whose flight may take it out of the view [R]
_HIGHEST = 4.0  # where a disk is still seen that flies on while the one beside it is not yet done [R]
_BELOW = 0.16  # what is seen of the rigid wall below its edge [R]
_GREATEST = "greatest compression"
_PANEL = 360  # pixels of a picture from which curves beside it have room for their words


def check_target(path: Path) -> None:
    """Raise InputError unless the name of `path` says a format, or the folder there holds nothing but pictures."""
    if path.suffix not in FORMATS:
        raise InputError(
            f"cannot film into {path}: end the name with .mp4, .webm or .gif for a film, with .png for one picture, "
            "or with nothing for a folder of numbered pictures"
        )
    if not path.suffix:
        if Path.cwd().is_relative_to(path.resolve()):
            raise InputError(f"cannot film into {path}: pictures would replace the folder you are in; name another")
        check_pictures(path)


def film(path: Path, runs: Sequence[Run], video: VideoSection, progress: Progress) -> None:
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
    if len({(scenario.time_label, *scenario.labels) for scenario, _ in runs}) > 1:
        raise InputError("these runs cannot be compared: they have no time, or no result, in common")
    require_film()
    told = origin(*(replace(scenario.scene, video=video) for scenario, _ in runs))
    if path.suffix == ".png":
        cues: list[Cue] = [(greatest_compression(runs[0][1].columns), _GREATEST)]
        video = replace(video, supersample=2.0)
    else:
        cues = _cues(runs, video)
    progress("render", 0, len(cues))

    def write(new: Path) -> None:
        with (
            closing(_pictures(runs, video, cues)) as pictures,
            encoded(new, path.suffix, pictures.width, video.size, video.fps, told) as append,
        ):
            times = np.array(list(dict.fromkeys(t for t, _ in cues)))
            moments = zip(*(outcome.frames(times) for _, outcome in runs), strict=True)
            words = zip(*(_lines(*run, cues) for run in runs), strict=True)
            shown = None
            for k, ((t, _), lines) in enumerate(zip(cues, words, strict=True)):
                raise_if_interrupted()
                if t != shown:
                    picture, shown = pictures.draw(next(moments)), t
                append(partial(pictures.finish, picture, lines, t))
                progress("render", k + 1, len(cues))

    atomic_write(path, write)


# ---- when to look, and what to write


def _cues(runs: Sequence[Run], video: VideoSection) -> list[Cue]:
    """The pictures of a film, those of the run that lasts longest. Equal times in succession are one picture."""
    count = max(3, round(video.fps * video.seconds))
    pause, end = round(_PAUSE * count), max(round(_END * count), 1)
    scenario, outcome = max(runs, key=lambda run: float(run[1].columns["t"][-1]))
    columns = outcome.columns
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


def _lines(scenario: Scenario, outcome: Outcome, cues: Sequence[Cue]) -> Iterator[tuple[str, ...]]:
    """The lines for each moment; after the end the observables are those of the end."""
    columns, times, peak = outcome.columns, [t for t, _ in cues], greatest_compression(outcome.columns)
    rows = {name: np.interp(times, columns["t"], values) for name, values in columns.items()} | {"t": times}
    for k, (t, note) in enumerate(cues):
        last = f"*{scenario.marks(columns)[0]}" if note is None else note
        if note == _GREATEST and abs(t - peak) > 0.01 * peak:
            last = ""  # it is that of the run beside
        yield *scenario.caption({name: float(values[k]) for name, values in rows.items()}), last


# ---- how to draw


def _pictures(runs: Sequence[Run], video: VideoSection, cues: Sequence[Cue]) -> Pictures:
    still = cues[0][0] if len(cues) == 1 else None
    painters, views = zip(*(_painter(*run, video, still, cues[-1][0]) for run in runs), strict=True)
    limit, full_force = max(one.limit for one in painters), max(one.full_force for one in painters)
    ends = [line for run in runs for line in _lines(*run, (cues[0], (cues[-1][0], None)))]
    samples = [*(line for lines in ends for line in lines), *dict.fromkeys(note or "" for _, note in cues)]
    legends = []
    for painter, (scenario, _) in zip(painters, runs, strict=True):
        painter.limit, painter.full_force = limit, full_force
        legends.append(Legend(painter, video.size, video.size, scenario.title(), samples, len(ends[0])))
    (xmin, _, ymin, _), (_, xmax, _, ymax) = np.min(views, axis=0), np.max(views, axis=0)
    panel = None
    if video.panel and video.size >= _PANEL:
        panel = side_panel(runs, video.size, THEMES[video.theme])
    return Pictures(legends, video.size, (xmin, xmax, ymin, ymax), video.supersample, panel)


def _painter(
    scenario: Scenario, outcome: Outcome, video: VideoSection, still: float | None, end: float
) -> tuple[Painter, View]:
    """Colours, arrows, the wall's edge and the view fit the greatest compression and, of a film, moments before it.

    The view holds the `end` of a film, too, up to which a disk flies on, or the moment of a `still` picture [R/c].
    """
    painter = Painter(scenario.lattice, scenario.model.springs, scenario.model.wall)
    painter.colour, painter.draw, painter.theme, painter.limit = video.colour, video.draw, video.theme, 0.0
    painter.spoke, painter.magnify = scenario.spoke, video.magnify
    columns, (xmin, xmax, ymin, ymax) = outcome.columns, scenario.view
    peak = greatest_compression(columns)
    if still is None:
        looks = [t for t in scenario.frame_times(columns, 2 * _LOOKS).tolist() if t < peak][-_LOOKS:]
        positions = [painter.placed(outcome.positions)]
        if end > columns["t"][-1]:
            positions += (painter.placed(x) for _, x, _ in outcome.frames(np.array([end])) if x[:, 1].max() < _HIGHEST)
    else:
        looks, positions = [still], []
    times = sorted({*looks, peak})
    for t, (_, x, v) in zip(times, outcome.frames(np.array(times)), strict=True):
        positions.append(painter.placed(x))
        if t <= peak:
            painter.limit, greatest = max(painter.limit, painter.scale(painter.values(x, v))), x
    _, forces = painter.wall.contact_forces(painter.lattice, greatest)
    largest = float(np.hypot(*forces.T).max(initial=0.0))
    full = max(largest, outcome.largest_push / _LONGEST)
    painter.full_force = round_near(full) if full else 0.0
    painter.edge = edge_height(painter.wall, largest)
    if not len(scenario.lattice.wall_surface):  # of a rigid wall no more is seen than its uppermost part
        ymin = painter.edge - _BELOW
    disk = np.concatenate([x[: scenario.lattice.disk_points] for x in positions])
    (left, _), (right, top) = disk.min(axis=0), disk.max(axis=0)
    return painter, (min(xmin, left - _BESIDE), max(xmax, right + _BESIDE), ymin, max(ymax, top))
