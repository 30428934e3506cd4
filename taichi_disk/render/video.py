"""MP4 (H.264), WebM (VP9), GIF and numbered PNGs, encoded by PyAV, Pillow and imageio in a thread of their own."""

from __future__ import annotations

import sys
import zlib
from collections.abc import Callable, Iterator
from fractions import Fraction
from pathlib import Path
from queue import Queue
from threading import Thread
from types import TracebackType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

Picture = NDArray[np.uint8]

_CODECS = {".mp4": "libx264", ".webm": "libvpx-vp9"}
_OPTIONS = {
    # Without B-frames and small partitions half the time, for a sixth more bytes at the same error. The macroblock
    # tree of x264 reads memory that nothing was written to (valgrind shows it): with it bytes depend on chance.
    ".mp4": {"preset": "veryfast", "crf": "22", "bf": "0", "partitions": "none", "mbtree": "0"},
    ".webm": {"crf": "32", "b": "0", "deadline": "realtime", "cpu-used": "6"},
}
_CONTAINER = {".mp4": {"movflags": "+faststart"}, ".webm": {}}
_BT709 = 1  # of primaries, transfer and matrix in H.273; players guess at colours that carry no tags
_GIF_SAMPLES = 12  # pictures, about, from which the palette is chosen


class Video:
    """A film in a format: ".mp4", ".webm", ".gif", or "" for a folder of PNGs.

    A context manager: left in order, the film is complete. Raises OSError if it cannot be written. The same pictures
    give the same bytes.
    """

    def __init__(self, path: Path, form: str, width: int, height: int, fps: int) -> None:
        """`width`, `height`: in pixels, even."""
        self._given = path, form, width, height, fps
        self._encode = {"": _encode_pngs, ".gif": _encode_gif}.get(form, _encode_stream)
        self._error: Exception | None = None
        self._pictures: Queue[Callable[[], Picture] | None] = Queue(maxsize=2)
        self._thread = Thread(target=self._work, daemon=True)
        # Drawing keeps Python's lock for milliseconds at a time; the encoder should not wait 5 ms more for its turn.
        self._switch_interval = sys.getswitchinterval()
        sys.setswitchinterval(5e-4)
        self._thread.start()

    def write(self, picture: Callable[[], Picture]) -> None:
        """Append what `picture` returns (height, width, 3); it is called in the encoder's thread."""
        self._check()
        self._pictures.put(picture)

    def _work(self) -> None:
        incoming = iter(self._pictures.get, None)
        try:
            self._encode(*self._given, (picture() for picture in incoming))
        except Exception as error:  # told by the next call of the other thread
            self._error = error
            for _ in incoming:
                pass

    def _check(self) -> None:
        if self._error is not None:
            raise self._error

    def __enter__(self) -> Video:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:
            self._pictures.put(_give_up)
        self._pictures.put(None)
        self._thread.join()
        sys.setswitchinterval(self._switch_interval)
        if kind is None:
            self._check()


def _give_up() -> Picture:
    raise SimulationError("the film was given up")


def _encode_stream(path: Path, form: str, width: int, height: int, fps: int, pictures: Iterator[Picture]) -> None:
    """One stream of H.264 or VP9."""
    import av

    options = _CONTAINER[form] | {"fflags": "+bitexact"}
    with open(path, "w+b") as file:  # of Python's, whose errors reach us: a full disk is one
        container = av.open(file, "w", format=form[1:], options=options)
        stream: Any = container.add_stream(_CODECS[form], rate=fps, options=_OPTIONS[form])
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        context = stream.codec_context
        # The number of threads is written into the file, so it may not depend on the machine. One is fastest
        # beside a drawing that keeps two cores busy, as long as it keeps up.
        context.thread_count = 1 + min(width, height) // 1080
        context.flags |= av.codec.context.Flags.bitexact
        context.color_range, context.colorspace = 1, _BT709
        context.color_primaries = context.color_trc = _BT709
        # One converter for all pictures: to make it takes twice as long as to use it.
        converter: Any = av.video.reformatter.VideoReformatter()
        for number, picture in enumerate(pictures):
            frame: Any = av.VideoFrame.from_numpy_buffer(np.ascontiguousarray(picture), format="rgb24")
            frame = converter.reformat(
                frame, format="yuv420p", dst_colorspace="ITU709", dst_color_range="MPEG", interpolation="POINT"
            )
            frame.pts, frame.time_base = number, Fraction(1, fps)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
        container.close()


def _encode_gif(path: Path, form: str, width: int, height: int, fps: int, pictures: Iterator[Picture]) -> None:
    """One palette for all pictures, so that still parts do not flicker: they wait, packed, until it is known."""
    from PIL import Image

    packed = [zlib.compress(picture.tobytes(), 1) for picture in pictures]

    def unpacked(step: int = 1) -> Iterator[Any]:
        return (Image.frombytes("RGB", (width, height), zlib.decompress(one)) for one in packed[::step])

    sampled = np.concatenate([np.asarray(one) for one in unpacked(1 + len(packed) // _GIF_SAMPLES)])
    palette = Image.fromarray(sampled).quantize(256, Image.Quantize.MAXCOVERAGE)
    first, *others = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in unpacked())
    ends = np.rint(100.0 * np.arange(len(packed) + 1) / fps)  # a GIF counts in hundredths of a second
    durations = [int(one) for one in 10.0 * np.diff(ends)]
    with open(path, "w+b") as file:
        first.save(file, "GIF", save_all=True, append_images=others, duration=durations, loop=0)


def _encode_pngs(path: Path, form: str, width: int, height: int, fps: int, pictures: Iterator[Picture]) -> None:
    """A folder of pictures, 00001.png and so on."""
    import imageio.v3 as iio

    path.mkdir()
    for number, picture in enumerate(pictures, 1):
        iio.imwrite(path / f"{number:05d}.png", picture, compress_level=6)
