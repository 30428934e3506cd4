"""The film to play with that a page saves."""

from __future__ import annotations

import asyncio
from pathlib import Path
from tempfile import TemporaryDirectory

from taichi_disk.base import runtime
from taichi_disk.base.processes.pool import Pool
from taichi_disk.base.progress import silent
from taichi_disk.experiments.computation.outcome import compute
from taichi_disk.experiments.scenes import Scene
from taichi_disk.experiments.scenes.setup import body_of
from taichi_disk.pictures.web.film import write_page


async def make_film(scene: Scene) -> str:
    """Return a film to play with, an HTML page, of `scene` from its start, as `run`
    computes it.

    Another process makes the film, so that the sandbox goes on meanwhile. Raises
    TaichiDiskError if the scene cannot be computed.
    """
    pool = Pool(1)
    try:
        page = await asyncio.wrap_future(pool.submit(_page, scene))
        # the process saves its compiled kernels
        await asyncio.to_thread(pool.shutdown)
        return page
    finally:
        pool.kill()


def _page(scene: Scene) -> str:
    runtime.start()
    outcome = compute(scene.scenario(body_of(scene)), estimate=False)
    with TemporaryDirectory() as folder:
        path = Path(folder, "disk.html")
        write_page(path, [outcome], scene.video, silent)
        return path.read_text(encoding="utf-8")
