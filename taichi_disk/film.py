"""The film of an outcome: when to look, what to write beside it, which strain is full colour."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from taichi_disk.outcome import Outcome
from taichi_disk.progress import Progress
from taichi_disk.render.film import record_film
from taichi_disk.render.picture import Frame, Subject
from taichi_disk.scene import VideoSection
from taichi_disk.scenes.setup import Setup

FULL_COLOUR = 95.0  # percentile of |strain| at the moment of the largest elastic energy


def film(path: Path, setup: Setup, outcome: Outcome, video: VideoSection, progress: Progress) -> None:
    """Film `outcome` into `path`. Raises TaichiDiskError if no film can be made here."""
    columns = outcome.columns
    count = max(2, round(video.fps * video.seconds))
    times = setup.frame_times(columns, count)
    peak = columns["t"][int(columns["elastic"].argmax())]
    _, tightest = next(iter(outcome.snapshots(np.array([peak]))))
    subject = Subject(
        lattice=setup.lattice,
        rigid_wall=setup.physics.wall == "rigid",
        title=setup.title(),
        strain_limit=_strain_limit(setup, tightest),
        view=setup.view,
    )

    def frames() -> Iterator[Frame]:
        for t, positions in outcome.snapshots(times):
            row = {name: float(np.interp(t, columns["t"], values)) for name, values in columns.items()}
            yield Frame(t, positions, setup.caption(row))

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


def _strain_limit(setup: Setup, positions: NDArray[np.float64]) -> float:
    """End of the colour scale: a round number (1, 2 or 5 times a power of ten) near the largest strains."""
    i, j = setup.lattice.bonds.T
    length = np.hypot(*(positions[i] - positions[j]).T)
    strain = float(np.percentile(np.abs(length / setup.lattice.rest_lengths - 1.0), FULL_COLOUR))
    decade = 10.0 ** np.floor(np.log10(max(strain, 1e-12)))
    return float(decade * next(step for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= strain))
