"""H.264 in MP4, through the ffmpeg that comes with imageio-ffmpeg and runs in a process of its own."""

from __future__ import annotations

from pathlib import Path
from types import TracebackType

import imageio_ffmpeg
import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

_PARAMETERS = (
    # Without the matrix and its tags players guess at the colours, and guess differently.
    *("-vf", "scale=out_color_matrix=bt709:out_range=tv"),
    *("-colorspace", "bt709", "-color_primaries", "bt709", "-color_trc", "bt709"),
    *("-preset", "veryfast", "-crf", "18"),
    # The encoder's output depends on the number of threads; bitexact leaves versions out of the file.
    *("-threads", "2", "-fflags", "+bitexact", "-flags:v", "+bitexact"),
    *("-movflags", "+faststart", "-f", "mp4"),
)


class Video:
    """Writes pictures to an MP4. A context manager: left in order, the file is complete and checked."""

    def __init__(self, path: Path, size: int, fps: int) -> None:
        self._path, self._count = path, 0
        self._writer = imageio_ffmpeg.write_frames(
            path,
            (size, size),
            fps=fps,
            codec="libx264",
            quality=None,
            macro_block_size=2,
            ffmpeg_log_level="error",
            output_params=list(_PARAMETERS),
        )
        self._writer.send(None)

    def write(self, picture: NDArray[np.uint8]) -> None:
        """Append a picture (size, size, 3); it may be overwritten on return."""
        try:
            self._writer.send(picture)
        except OSError as error:
            raise SimulationError(f"ffmpeg stopped while writing {self._path}: {error}") from error
        self._count += 1

    def __enter__(self) -> Video:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._writer.close()
        if kind is None:
            # The writer does not look at ffmpeg's exit status, and a full disk stops ffmpeg only at the end.
            try:
                written, _ = imageio_ffmpeg.count_frames_and_secs(self._path)
            except RuntimeError as failure:
                raise SimulationError(f"ffmpeg left no readable film in {self._path}: {failure}") from failure
            if written != self._count:
                raise SimulationError(f"ffmpeg wrote {written} of {self._count} frames to {self._path}")
