"""The door of films: a page that plays one, or pictures of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from taichi_disk.base.progress import Progress
from taichi_disk.experiments.config.sections import VideoSection
from taichi_disk.pictures.render.artist import Artist
from taichi_disk.pictures.render.moments import WHOLE, Runs, Span


def film(
    path: Path,
    runs: Runs,
    video: VideoSection,
    progress: Progress,
    artist: Artist,
    span: Span = WHOLE,
    labels: Sequence[str] = (),
) -> None:
    """Film `runs` side by side into `path`. Arguments and errors are those of
    `render.film.draw_film`; for .html a page is written, which needs no Vulkan."""
    if path.suffix == ".html":
        from taichi_disk.pictures.web.film import write_page

        write_page(path, runs, video, progress, span, labels)
    else:
        from taichi_disk.pictures.render.film import draw_film

        draw_film(path, runs, video, progress, artist, span, labels)
