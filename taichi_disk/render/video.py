"""MP4 (H.264), WebM (VP9), GIF and numbered PNGs, by imageio-ffmpeg's own ffmpeg, in a process of its own.

imageio's own writer does not look at ffmpeg's exit status: a full disk would leave half a film unnoticed.
"""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path
from queue import Queue
from threading import Thread
from types import TracebackType

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

_EXACT = ("-fflags", "+bitexact", "-flags:v", "+bitexact")  # no version or random numbers in the file
_TAGS = (
    # Without the matrix and its tags players guess at the colours, and guess differently.
    *("-vf", "scale=out_color_matrix=bt709:out_range=tv", "-pix_fmt", "yuv420p"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
    *_EXACT,
)
_ENCODINGS = {
    ".mp4": (*_TAGS, "-c:v", "libx264", "-preset", "veryfast", "-crf", "20", "-movflags", "+faststart", "-f", "mp4"),
    ".webm": (*_TAGS, "-c:v", "libvpx-vp9", "-crf", "32", "-b:v", "0", "-deadline", "realtime", "-cpu-used", "6"),
    # One palette for all pictures, so that still parts do not flicker.
    ".gif": (
        "-vf",
        "split[a][b];[a]palettegen=max_colors=128[p];[b][p]paletteuse=dither=none:diff_mode=rectangle",
        "-f",
        "gif",
    ),
    ".png": ("-c:v", "png", "-pix_fmt", "rgb24", *_EXACT, "-f", "image2"),
}


class Video:
    """Writes pictures to a film, in the format that the suffix of `path` names: .mp4, .webm or .gif.

    `.png`: into a picture each; the path then holds a `%05d`, which is replaced by its number.
    A context manager: left in order, the film is complete.

    A thread feeds ffmpeg, so that drawing need not wait until a picture has gone through the pipe.
    `width`, `height`: in pixels, even. Raises SimulationError if ffmpeg fails.
    """

    def __init__(self, path: Path, width: int, height: int, fps: int) -> None:
        self._path = path
        raw = ("-f", "rawvideo", "-pix_fmt", "rgb0", "-s", f"{width}x{height}", "-r", str(fps), "-i", "-")
        # The number of threads is written into the file, so it may not depend on the machine. One is fastest
        # beside a drawing that keeps two cores busy, as long as it keeps up.
        threads = ("-threads", str(1 + min(width, height) // 1080))
        command = [
            imageio_ffmpeg.get_ffmpeg_exe(),
            "-v",
            "error",
            "-y",
            *raw,
            *_ENCODINGS[path.suffix],
            *threads,
            str(path),
        ]
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 (closed in __exit__)
        # In a session of its own, so that Ctrl-C reaches us and not ffmpeg.
        self._ffmpeg = subprocess.Popen(command, stdin=subprocess.PIPE, stderr=self._complaints, start_new_session=True)
        self._pictures: Queue[NDArray[np.uint8] | None] = Queue(maxsize=2)
        self._broken = False
        self._feeder = Thread(target=self._feed, daemon=True)
        self._feeder.start()

    def write(self, picture: NDArray[np.uint8]) -> None:
        """Append a picture (height, width, 4), the fourth byte unused; it may be overwritten on return."""
        if self._broken:
            raise self._failure()
        self._pictures.put(picture.copy())

    def _feed(self) -> None:
        assert self._ffmpeg.stdin is not None
        while (picture := self._pictures.get()) is not None:
            if not self._broken:
                try:
                    self._ffmpeg.stdin.write(picture.data)
                except OSError:
                    self._broken = True

    def _failure(self) -> SimulationError:
        self._ffmpeg.wait()
        self._complaints.seek(0)
        said = self._complaints.read().decode(errors="replace").strip()
        return SimulationError(f"ffmpeg could not write {self._path}: {said or 'it gave no reason'}")

    def __enter__(self) -> Video:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with self._complaints:
            try:
                if kind is not None:
                    self._ffmpeg.kill()
                self._pictures.put(None)
                self._feeder.join()
                self._ffmpeg.communicate()
            except BaseException:
                self._ffmpeg.kill()
                raise
            if kind is None and self._ffmpeg.returncode != 0:
                raise self._failure()
