"""The film: pictures streamed one by one to ffmpeg, so that memory does not grow with length."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from itertools import chain
from pathlib import Path

from taichi_disk.errors import InputError, SimulationError, TaichiDiskError
from taichi_disk.output import atomic_write, check_pictures
from taichi_disk.render.panel import Panel
from taichi_disk.render.picture import Frame, Subject

_MEND = "apt-get update && apt-get install -y --no-install-recommends libx11-6 mesa-vulkan-drivers"
_SMALLEST = 64  # pixels: nothing would be seen in less


def film_problem() -> str | None:
    """Why no film can be made on this machine and the command that mends it, or None. Needs no `ti.init`."""
    try:
        import taichi as ti
    except ImportError as error:
        return f"Taichi cannot be loaded ({error}); as root: {_MEND}"
    if not ti._lib.core.with_vulkan():
        return f"pictures are drawn with Vulkan, and there is no Vulkan driver here; as root: {_MEND}"
    try:
        import imageio_ffmpeg

        imageio_ffmpeg.get_ffmpeg_exe()
    except (ImportError, RuntimeError) as error:
        return f"no ffmpeg to write the film with ({error}); pip install --force-reinstall imageio-ffmpeg"
    return None


def require_film(size: int) -> None:
    """Raise InputError for a size that is odd or too small, TaichiDiskError if nothing can be drawn here."""
    if size % 2 or size < _SMALLEST:
        raise InputError(f"no film of {size} x {size} pixels: the size must be even and at least {_SMALLEST}")
    if problem := film_problem():
        raise TaichiDiskError(f"no film: {problem}")


def record_film(
    path: Path,
    subjects: Sequence[Subject],
    frames: Iterable[Sequence[Frame]],
    *,
    size: int = 720,
    fps: int = 30,
    supersample: float = 1.5,
    panel: Panel | None = None,
    total: int,
    progress: Callable[[int, int], None] | None = None,
) -> None:
    """Film `frames`, each with one frame of every subject, into `path`, which appears only once it is complete.

    `path`: .mp4, .webm or .gif; without a suffix a folder of pictures, 00001.png and so on.
    `ti.init` must have been called. `size`, `supersample`, `panel`: see `Stills`. `total`: how many frames there
    will be; `progress(done, total)` is called after each. Raises InputError for another size or a folder that
    holds something else, SimulationError if a position is not finite, the frames are fewer or more, or the file
    cannot be written, and TaichiDiskError if films cannot be made here at all (`film_problem`).
    """
    require_film(size)
    if not path.suffix:
        check_pictures(path)
    from taichi_disk.render.still import Stills
    from taichi_disk.render.video import Video

    stream = iter(frames)
    first = next(stream, None)
    if first is None:
        raise SimulationError("a film of no frames")
    lines = max(len(frame.text) for frame in first)

    def write(beside: Path) -> None:
        done, target = 0, beside
        if not path.suffix:
            beside.mkdir()
            # A per cent sign of the folder's own is no place for a number.
            target = Path(str(beside).replace("%", "%%"), "%05d.png")
        with (
            Stills(subjects, size, lines, supersample, panel) as stills,
            Video(target, stills.width, size, fps) as video,
        ):
            for moment in chain([first], stream):
                video.write(stills.draw(moment))
                done += 1
                if progress:
                    progress(done, total)
        if done != total:
            raise SimulationError(f"the film was to have {total} frames and got {done}")

    atomic_write(path, write)
