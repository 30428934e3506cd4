"""The film of runs: when to look, what to write beside it, which value is full colour."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from taichi_disk import runtime
from taichi_disk.config.sections import VideoSection
from taichi_disk.errors import InputError
from taichi_disk.output.files import atomic_write, check_pictures, prepare_output
from taichi_disk.progress import Progress
from taichi_disk.render import require_film
from taichi_disk.render.palette import THEMES
from taichi_disk.scenes import Scene, load_scene
from taichi_disk.simulation.outcome import Outcome, compute
from taichi_disk.simulation.scenario import Scenario
from taichi_disk.simulation.simulation import KernelCache

if TYPE_CHECKING:
    from taichi_disk.render.painter import Painter
    from taichi_disk.render.pictures import Pictures

Run = tuple[Scenario, Outcome]
Frame = tuple[float, str | None]  # t [R/c] and the last line, None for the result

FORMATS = (".mp4", ".webm", ".gif", ".png", "")
_HELD, _LAST = 0.06, 0.10  # shares of a film that stand still at the greatest compression, and at the end
_LOOKS = 12  # times before the greatest compression from which the scale of colours is taken
_BELOW = 0.16  # what is seen of the rigid wall below its edge [R]
_GREATEST = "greatest compression"


def check_target(path: Path) -> None:
    """Raise InputError unless the name of `path` says a format, or the folder there holds nothing but pictures."""
    if path.suffix not in FORMATS:
        raise InputError(
            f"cannot film into {path}: end the name with .mp4, .webm or .gif for a film, with .png for one picture, "
            "or with nothing for a folder of numbered pictures"
        )
    if not path.suffix:
        check_pictures(path)


def film(path: Path, runs: Sequence[Run], video: VideoSection, progress: Progress) -> None:
    """Film `runs` side by side into `path`, at the same times and in the same colours.

    The film stands still for a moment at the greatest compression, and at the end, where it tells the result.
    `ti.init` must have been called.

    Args:
        path: .mp4, .webm or .gif; .png for one picture, of the greatest compression; without a suffix a folder of
            pictures, 00001.png and so on. It appears once it is complete, and replaces what is there.

    Raises InputError for a suffix or a folder that cannot be, SimulationError if a value is not finite or the file
    cannot be written, TaichiDiskError if no film can be made on this machine.
    """
    require_film()
    check_target(path)
    if path.suffix == ".png":
        _still(path, runs, video)
        return
    from taichi_disk.render.video import Video

    frames = _frames(runs, video)
    progress.start("render", len(frames))

    def write(new: Path) -> None:
        with (
            _pictures(runs, video, frames, video.supersample) as pictures,
            Video(new, path.suffix, pictures.width, video.size, video.fps) as out,
        ):
            times = np.array(list(dict.fromkeys(t for t, _ in frames)))
            moments = zip(*(outcome.replay(times) for _, outcome in runs), strict=True)
            shown = None
            for k, frame in enumerate(frames):
                if frame[0] != shown:
                    picture, shown = pictures.draw(next(moments)), frame[0]
                out.write(partial(pictures.finish, picture, [_lines(*run, frame) for run in runs], frame[0]))
                progress.update(k + 1)

    atomic_write(path, write)


def _still(path: Path, runs: Sequence[Run], video: VideoSection) -> None:
    import imageio.v3 as iio

    frames = [(_peak(outcome), _GREATEST) for _, outcome in runs]
    states = [next(outcome.replay(np.array([t]))) for (_, outcome), (t, _) in zip(runs, frames, strict=True)]
    with _pictures(runs, video, frames, supersample=2.0, looks=0) as pictures:
        lines = [_lines(*run, frame) for run, frame in zip(runs, frames, strict=True)]
        picture = pictures.finish(pictures.draw(states), lines, frames[0][0])
    atomic_write(path, lambda new: iio.imwrite(new, picture, optimize=True))


# ---- when to look, and what to write


def _frames(runs: Sequence[Run], video: VideoSection) -> list[Frame]:
    """The pictures of a film, those of the run that lasts longest. Equal times in succession are one picture."""
    count = max(3, round(video.fps * video.seconds))
    held, last = round(_HELD * count), max(round(_LAST * count), 1)
    scenario, outcome = max(runs, key=lambda run: float(run[1].columns["t"][-1]))
    times, peak = scenario.frame_times(outcome.columns, count - held - last), _peak(outcome)
    greatest = int(np.abs(times - peak).argmin())
    if scenario.static or greatest == len(times) - 1:
        held, last, greatest = 0, held + last, len(times) - 1
    elif greatest > 0:
        times[greatest] = peak
    paces = [f"1 s shows {float(f'{pace:.2g}'):g} R/c" for pace in video.fps * np.diff(times)]
    paces = [""] * len(times) if scenario.static else [*paces, *paces[-1:]]
    frames: list[Frame] = [(float(t), pace) for t, pace in zip(times, paces, strict=True)]
    still, end = (frames[greatest][0], _GREATEST), (frames[-1][0], None)
    return frames[: greatest + 1] + held * [still] + frames[greatest + 1 :] + last * [end]


def _peak(outcome: Outcome) -> float:
    """When the elastic energy is largest [R/c]."""
    return float(outcome.columns["t"][int(outcome.columns["elastic"].argmax())])


def _lines(scenario: Scenario, outcome: Outcome, frame: Frame) -> tuple[str, ...]:
    """The lines for a moment; after the end the observables are those of the end."""
    (t, note), columns = frame, outcome.columns
    row = {name: float(np.interp(t, columns["t"], values)) for name, values in columns.items()}
    return (*scenario.caption(row | {"t": t}), f"*{scenario.marks(columns)[0]}" if note is None else note)


# ---- how to draw


def _pictures(
    runs: Sequence[Run], video: VideoSection, frames: Sequence[Frame], supersample: float, looks: int = _LOOKS
) -> Pictures:
    from taichi_disk.render.legend import Legend
    from taichi_disk.render.pictures import Pictures

    painters = [_painter(*run, video, looks) for run in runs]
    limit, full_force = max(one.limit for one in painters), max(one.full_force for one in painters)
    ends = [_lines(*run, frame) for run in runs for frame in (frames[0], (frames[-1][0], None))]
    samples = [*(line for lines in ends for line in lines), *dict.fromkeys(note or "" for _, note in frames)]
    legends, views = [], []
    for painter, (scenario, _) in zip(painters, runs, strict=True):
        painter.limit, painter.full_force = limit, full_force
        legends.append(Legend(painter, video.size, video.size, scenario.title(), samples, len(ends[0])))
        xmin, xmax, ymin, ymax = scenario.view
        rigid = painter.wall is not None and not len(painter.lattice.wall_surface)
        # Of a rigid wall no more is seen than its uppermost part.
        views.append((xmin, xmax, painter.edge - _BELOW if rigid else ymin, ymax))
    (xmin, _, ymin, _), (_, xmax, _, ymax) = np.min(views, axis=0), np.max(views, axis=0)
    panel = None
    if video.panel:
        from taichi_disk.render.panel import side_panel

        panel = side_panel(runs, video.size, THEMES[video.theme])
    return Pictures(legends, video.size, (xmin, xmax, ymin, ymax), supersample, panel)


def _painter(scenario: Scenario, outcome: Outcome, video: VideoSection, looks: int) -> Painter:
    """Colours, arrows and the wall's edge fit the greatest compression, and so many moments before it."""
    from taichi_disk.render.painter import Painter
    from taichi_disk.render.pictures import require_finite
    from taichi_disk.render.scales import round_near
    from taichi_disk.render.shapes import edge_height

    painter = Painter(scenario.lattice, scenario.model.springs, scenario.model.wall)
    painter.colour, painter.draw, painter.theme, painter.limit = video.colour, video.draw, video.theme, 0.0
    times, peak = scenario.frame_times(outcome.columns, 2 * looks), _peak(outcome)
    for t, x, v in outcome.replay(np.append(times[times < peak][-looks:], peak)):
        require_finite(t, x, v)
        painter.limit = max(painter.limit, painter.scale(painter.values(x, v)))
    if painter.wall is not None:
        _, forces = painter.wall.contact_forces(painter.lattice, x)
        largest = float(np.hypot(*forces.T).max(initial=0.0))
        painter.full_force = round_near(largest) if largest else 0.0
        painter.edge = edge_height(painter.wall, largest)
    return painter


# ---- runs that were made before


def film_again(folders: list[Path], out: Path | None, options: dict[str, Any], progress: Progress) -> Path:
    """Film the run in each folder, side by side, computed anew from its scene.yaml; returns where the film is.

    Args:
        out: see `film`. By default in the first folder.
        options: keys of a scene's `video` section, in place of what the scene says.

    Raises InputError for what is not a run or not a format, and what `film` does.
    """
    if out is not None and "format" in options:
        raise InputError("--out and --format: the name after --out says the format already")
    scenes = [_scene_of(folder, options) for folder in folders]
    kinds = [_kind(scene) for scene in scenes]
    if len(set(kinds)) > 1:
        raise InputError(f"cannot compare {' with '.join(kinds)}: they have no time in common")
    video = scenes[0].video
    if out is None:
        name = "comparison" if len(folders) > 1 else "render"
        out = folders[0] / (name if video.format == "png" else f"{name}.{video.format}")
    check_target(out)
    require_film()
    prepare_output(out.parent)
    runtime.start()
    kernels, runs = KernelCache(), []
    for scene in scenes:
        scenario = scene.scenario()
        # The run was made: what it took, also a step by force, is taken again.
        runs.append((scenario, compute(scenario, scene.time, progress, kernels, force=True, estimate=False)))
    film(out, runs, video, progress)
    return out


def _kind(scene: Scene) -> str:
    compression = getattr(scene, "compression", None)
    return f"a {compression.method} compression" if compression else "an impact"


def _scene_of(folder: Path, options: dict[str, Any]) -> Scene:
    path = folder / "scene.yaml"
    if not path.is_file():
        raise InputError(f"{folder}: no run is here (no scene.yaml); make one with `taichi-disk run --out {folder}`")
    return load_scene(path, [f"video.{name}={value}" for name, value in options.items()])
