"""The film of an outcome: when to look, what to write beside it, which strain is full colour."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_disk.outcome import Outcome
from taichi_disk.output import atomic_write
from taichi_disk.progress import Progress
from taichi_disk.render.film import record_film, require_film
from taichi_disk.render.picture import Frame, Subject
from taichi_disk.scene import VideoSection
from taichi_disk.scenes.setup import Setup

FULL_COLOUR = 95.0  # percentile of |strain| at the moment of the largest elastic energy


def film(
    path: Path,
    setup: Setup,
    outcome: Outcome,
    video: VideoSection,
    progress: Progress,
    *,
    times: NDArray[np.float64] | None = None,
    limit: float | None = None,
) -> None:
    """Film `outcome` into `path`, in the format that its suffix names. Raises TaichiDiskError if that cannot be.

    `times` [R/c] and `limit`, the strain of full colour: by default what suits this outcome best.
    """
    count = frame_count(video)
    times = setup.frame_times(outcome.columns, count) if times is None else times
    subject = subject_of(setup, strain_limit(setup, outcome) if limit is None else limit)

    def frames() -> Iterator[Frame]:
        for t, positions in outcome.snapshots(times):
            yield frame_at(setup, outcome, t, positions)

    progress.start("render", count)
    record_film(
        path,
        subject,
        frames(),
        size=video.size,
        fps=video.fps,
        total=count,
        progress=lambda done, _total: progress.update(done),
    )


def still(path: Path, setup: Setup, outcome: Outcome, size: int) -> None:
    """A PNG of the moment of the largest elastic energy. `record_film` says what may be raised."""
    from PIL import Image

    from taichi_disk.render.still import Stills

    t, positions = _tightest(outcome)
    frame = frame_at(setup, outcome, t, positions)
    require_film(size)
    with Stills(subject_of(setup, strain_limit(setup, outcome)), size, len(frame.text)) as stills:
        picture = stills.draw(frame)[..., :3].copy()
    atomic_write(path, lambda beside: Image.fromarray(picture).save(beside, optimize=True))


def frame_count(video: VideoSection) -> int:
    return max(2, round(video.fps * video.seconds))


def subject_of(setup: Setup, limit: float) -> Subject:
    rigid = setup.physics.wall == "rigid"
    return Subject(setup.lattice, rigid, title=setup.title(), strain_limit=limit, view=setup.view)


def frame_at(setup: Setup, outcome: Outcome, t: float, positions: NDArray[np.float64]) -> Frame:
    """The frame at `t`; after the end the observables are those of the end."""
    columns = outcome.columns
    row = {name: float(np.interp(t, columns["t"], values)) for name, values in columns.items()}
    return Frame(t, positions, setup.caption(row | {"t": t}))


def _tightest(outcome: Outcome) -> tuple[float, NDArray[np.float64]]:
    peak = outcome.columns["t"][int(outcome.columns["elastic"].argmax())]
    return next(iter(outcome.snapshots(np.array([peak]))))


def strain_limit(setup: Setup, outcome: Outcome) -> float:
    """End of the colour scale: a round number (1, 2 or 5 times a power of ten) near the largest strains."""
    _, positions = _tightest(outcome)
    i, j = setup.lattice.bonds.T
    length = np.hypot(*(positions[i] - positions[j]).T)
    strain = float(np.percentile(np.abs(length / setup.lattice.rest_lengths - 1.0), FULL_COLOUR))
    decade = 10.0 ** np.floor(np.log10(max(strain, 1e-12)))
    return float(decade * next(step for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= strain))
