"""Pictures and films of the disk: drawn on a GGUI canvas, completed with text and
curves, and encoded."""

from __future__ import annotations

from taichi_disk.errors import NoPictures
from taichi_disk.machine import driver_problem
from taichi_disk.render.artist import Artist


def film_problem(artist: Artist | None = None) -> str | None:
    """Return why this machine cannot make films, with what helps, or None. Needs no
    `ti.init`. `artist`: may have tried the drivers in its process."""
    from taichi_disk.engine import internals, ti

    artist = artist or Artist()
    state = artist.driver_state()
    if not state and not internals.has_vulkan(ti):
        state = "cannot be used by Taichi"
    if not state:
        return None
    return driver_problem(state)


def require_film(artist: Artist | None = None) -> None:
    """Raise NoPictures unless this machine can make films; `artist` as above."""
    problem = film_problem(artist)
    if problem:
        raise NoPictures(problem)
