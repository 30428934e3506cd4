"""The film of outcomes: when to look, what to write beside them, which value is full colour."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, repeat
from pathlib import Path

import numpy as np

from taichi_disk.contact import contact_forces
from taichi_disk.outcome import Outcome, Snapshot
from taichi_disk.output import atomic_write
from taichi_disk.progress import Progress
from taichi_disk.render.colouring import QUANTITIES, round_up, spring_values
from taichi_disk.render.film import record_film, require_film
from taichi_disk.render.panel import Panel
from taichi_disk.render.picture import Frame, Subject
from taichi_disk.scene import Colouring, VideoSection
from taichi_disk.scenes.setup import Setup

FULL_COLOUR = 95.0  # percentile of |strain| or |force|, at the moment when it is largest, that has the full colour

Run = tuple[Setup, Outcome]


def film(path: Path, runs: Sequence[Run], video: VideoSection, progress: Progress) -> None:
    """Film `runs` side by side into `path`, at the same times and in the same colours.

    `record_film` says what `path` may be and what may be raised.
    """
    count = max(2, round(video.fps * video.seconds))
    setup, outcome = max(runs, key=lambda run: float(run[1].columns["t"][-1]))
    times = setup.frame_times(outcome.columns, count)
    subjects = _subjects(runs, [_tightest(outcome) for _, outcome in runs], video)

    moving = bool(outcome.columns["kinetic"].any())
    paces = [f"1 s shows {float(f'{pace:.2g}'):g} R/c" for pace in video.fps * np.diff(times)] if moving else [""]

    def frames() -> Iterator[list[Frame]]:
        moments = zip(*(run[1].snapshots(times) for run in runs), strict=True)
        for moment, pace in zip(moments, chain(paces, repeat(paces[-1])), strict=False):
            yield [_frame(*one, pace) for one in zip(runs, subjects, moment, strict=True)]

    progress.start("render", count)
    record_film(
        path,
        subjects,
        frames(),
        size=video.size,
        fps=video.fps,
        supersample=video.supersample,
        panel=_panel(runs, video),
        total=count,
        progress=lambda done, _total: progress.update(done),
    )


def still(path: Path, runs: Sequence[Run], video: VideoSection) -> None:
    """A PNG of the moment of the largest elastic energy. `record_film` says what may be raised."""
    from PIL import Image

    from taichi_disk.render.still import Stills

    require_film(video.size)
    tightest = [_tightest(outcome) for _, outcome in runs]
    subjects = _subjects(runs, tightest, video)
    frames = [_frame(*one) for one in zip(runs, subjects, tightest, strict=True)]
    lines = max(len(frame.text) for frame in frames)
    with Stills(subjects, video.size, lines, video.supersample, _panel(runs, video)) as stills:
        picture = stills.draw(frames)[..., :3].copy()
    atomic_write(path, lambda beside: Image.fromarray(picture).save(beside, optimize=True))


def _panel(runs: Sequence[Run], video: VideoSection) -> Panel | None:
    if not video.panel:
        return None
    from taichi_disk.side_panel import side_panel  # matplotlib takes its time

    return side_panel(runs, video.size)


def _subjects(runs: Sequence[Run], tightest: Sequence[Snapshot], video: VideoSection) -> list[Subject]:
    limit = max(_limit(*run, state, video.colour) for run, state in zip(runs, tightest, strict=True))
    force = max(_force(setup, state) for (setup, _), state in zip(runs, tightest, strict=True))
    views = np.array([setup.view for setup, _ in runs])
    least, most = views.min(axis=0), views.max(axis=0)
    view = float(least[0]), float(most[1]), float(least[2]), float(most[3])
    same = limit, view, video.colour, video.draw, force
    return [Subject(setup.lattice, setup.physics.wall == "rigid", setup.title(), *same) for setup, _ in runs]


def _frame(run: Run, subject: Subject, state: Snapshot, pace: str = "") -> Frame:
    """The frame of a state; after the end the observables are those of the end. `pace`: how fast time passes."""
    (setup, outcome), (t, x, v) = run, state
    columns = outcome.columns
    row = {name: float(np.interp(t, columns["t"], values)) for name, values in columns.items()}
    values = None  # the strain, which the painter works out itself
    if subject.colouring != "strain":
        values = spring_values(setup.lattice, setup.physics, x, v, subject.colouring) / subject.limit
    points, forces = contact_forces(setup.lattice, setup.physics, x)
    caption = (*setup.caption(row | {"t": t}), *([pace] if pace else []))
    return Frame(t, x, caption, values, (points, forces / subject.full_force))


def _tightest(outcome: Outcome) -> Snapshot:
    peak = outcome.columns["t"][int(outcome.columns["elastic"].argmax())]
    return next(iter(outcome.snapshots(np.array([peak]))))


def _limit(setup: Setup, outcome: Outcome, tightest: Snapshot, colouring: Colouring) -> float:
    """End of the scale of colours: a round number near the largest values at start, tightest moment and end."""
    states = [
        (setup.lattice.positions, setup.velocities),
        tightest[1:],
        (outcome.positions, outcome.velocities),
    ]
    values = [np.abs(spring_values(setup.lattice, setup.physics, *state, colouring)) for state in states]
    if QUANTITIES[colouring].signed:
        return round_up(max(float(np.percentile(one, FULL_COLOUR)) for one in values))
    # What moves does so as a whole: most of the disk then has the full colour, a wall at rest has none.
    disk = (setup.lattice.bonds < setup.lattice.disk_points).all(axis=1)
    return round_up(max(float(np.median(one[disk])) for one in values))


def _force(setup: Setup, tightest: Snapshot) -> float:
    """A round number near the largest force of the wall on a point at the tightest moment [M c^2/R]."""
    _, forces = contact_forces(setup.lattice, setup.physics, tightest[1])
    return round_up(float(np.hypot(*forces.T).max(initial=0.0)))
