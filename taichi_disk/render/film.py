"""The film: pictures streamed one by one to ffmpeg, so that memory does not grow with length."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from itertools import chain
from pathlib import Path

from taichi_disk.errors import InputError, SimulationError, TaichiDiskError
from taichi_disk.render.picture import Frame, Subject
from taichi_disk.render.video import Video

_MEND = "apt-get update && apt-get install -y --no-install-recommends libx11-6 mesa-vulkan-drivers"


def film_problem() -> str | None:
    """Why no film can be made on this machine and the command that mends it, or None. Needs no `ti.init`."""
    try:
        import taichi as ti
    except ImportError as error:
        return f"Taichi cannot be loaded ({error}); as root: {_MEND}"
    if not ti._lib.core.with_vulkan():
        return f"pictures are drawn with Vulkan and there is no Vulkan driver here; as root: {_MEND}"
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        return f"no ffmpeg to write the film with ({error}); pip install --force-reinstall imageio-ffmpeg"
    return None


def record_film(
    path: Path,
    subject: Subject,
    frames: Iterable[Frame],
    *,
    size: int = 720,
    fps: int = 30,
    total: int,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Film `frames` as H.264 into `path`, which appears only once it is complete.

    `ti.init` must have been called. `size`: width and height in pixels, even. `total`: how many frames there
    will be; `progress(done, total)` is called after each. Raises InputError for another size, SimulationError
    if a position is not finite, the frames are fewer or more, or ffmpeg fails, and TaichiDiskError if films
    cannot be made here at all (`film_problem`).
    """
    if size % 2 or size < 64:
        raise InputError(f"a film of {size} x {size} pixels: choose an even size of at least 64")
    if problem := film_problem():
        raise TaichiDiskError(f"no film: {problem}")
    from taichi_disk.render.still import Stills

    stream = iter(frames)
    first = next(stream, None)
    if first is None:
        raise SimulationError("a film of no frames")
    # The suffix stays, and the folder too: ffmpeg goes by the one, an atomic renaming needs the other.
    partial = path.with_name(f".{path.stem}.{os.getpid()}.partial{path.suffix}")
    done = 0
    try:
        with Stills(subject, size, len(first.text)) as stills, Video(partial, size, fps) as video:
            for frame in chain([first], stream):
                video.write(stills.draw(frame))
                done += 1
                if progress:
                    progress(done, total)
        if done != total:
            raise SimulationError(f"the film was to have {total} frames and got {done}")
        os.replace(partial, path)
    finally:
        partial.unlink(missing_ok=True)
