"""Encode MP4 (H.264) and WebM (VP9) with PyAV, GIF and PNG with Pillow, in a separate thread."""

from __future__ import annotations

import sys
import zlib
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from queue import Full, Queue
from typing import Any

import numpy as np
from numpy.typing import NDArray

from taichi_disk.errors import SimulationError

Picture = NDArray[np.uint8]
Size = tuple[int, int]

_CODECS = {".mp4": "libx264", ".webm": "libvpx-vp9"}
_OPTIONS = {
    # "veryfast" at crf 22 takes 1.25 times as long for 0.67 of the bytes, without a visible difference. The macroblock
    # tree of x264 reads uninitialised memory (found by valgrind), so bytes would differ from run to run.
    ".mp4": {"preset": "superfast", "crf": "24", "coder": "0", "bf": "0", "partitions": "none", "mbtree": "0"},
    ".webm": {"crf": "32", "b": "0", "deadline": "realtime", "cpu-used": "6"},
}
_BT709 = 1  # primaries, transfer and matrix in H.273; without tags players guess the colours
_GIF_SAMPLES = 12  # approximate number of pictures that determine the palette


@contextmanager
def video(
    path: Path, form: str, width: int, height: int, fps: int, origin: str = ""
) -> Iterator[Callable[[Callable[[], Picture] | None], None]]:
    """Write a film as ".mp4", ".webm" or ".gif", one picture as ".png", or a folder of pictures as "".

    `width`, `height`: even numbers [px]; `origin`: text for the metadata of the file. Yields `write(picture)`, which
    appends the array (height, width, 3) that `picture()` returns in another thread. Equal pictures give equal bytes.
    Raises OSError, at the next picture or at the end, if the file cannot be written.
    """
    encode = {"": _encode_pngs, ".png": _encode_pngs, ".gif": _encode_gif}.get(form, _encode_stream)
    pictures: Queue[Callable[[], Picture] | None] = Queue(maxsize=2)
    # Drawing holds Python's lock for milliseconds at a time; by default the encoder would wait 5 ms longer.
    switch_interval = sys.getswitchinterval()
    sys.setswitchinterval(5e-4)
    with ThreadPoolExecutor(1) as thread:
        incoming = (picture() for picture in iter(pictures.get, None))
        encoded = thread.submit(encode, path, form, (width, height), fps, origin, incoming)

        def write(picture: Callable[[], Picture] | None) -> None:
            while not encoded.done():  # stop when the encoder has failed, because nothing empties the queue then
                with suppress(Full):
                    return pictures.put(picture, timeout=0.1)
            encoded.result()

        try:
            yield write
            write(None)
        except BaseException:
            with suppress(Exception):
                write(_cancel)
            raise
        finally:
            sys.setswitchinterval(switch_interval)
        encoded.result()


def _cancel() -> Picture:
    raise SimulationError("the film was cancelled")


def _encode_stream(path: Path, form: str, size: Size, fps: int, origin: str, pictures: Iterator[Picture]) -> None:
    import av

    width, height = size
    options = {"fflags": "+bitexact"} | ({"movflags": "+faststart"} if form == ".mp4" else {})
    with open(path, "w+b") as file:  # a Python file raises errors such as a full disk; FFmpeg does not
        container = av.open(file, "w", format=form[1:], options=options)
        container.metadata["comment"] = origin
        stream: Any = container.add_stream(_CODECS[form], rate=fps, options=_OPTIONS[form])
        stream.width, stream.height, stream.pix_fmt = width, height, "yuv420p"
        context = stream.codec_context
        # The number of threads changes the bytes, so it must not depend on the machine. One thread is fastest, as
        # long as it keeps up with the drawing, which keeps two cores busy.
        context.thread_count = 1 + min(width, height) // 1080
        context.flags |= av.codec.context.Flags.bitexact
        context.color_range, context.colorspace = 1, _BT709
        context.color_primaries = context.color_trc = _BT709
        # Reuse one converter: creating it takes twice as long as converting a picture.
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


def _encode_gif(path: Path, form: str, size: Size, fps: int, origin: str, pictures: Iterator[Picture]) -> None:
    """Encode with one palette for all pictures, so that still parts do not flicker; until then they are compressed."""
    from PIL import Image

    packed = [zlib.compress(picture.tobytes(), 1) for picture in pictures]

    def unpacked(step: int = 1) -> Iterator[Any]:
        return (Image.frombytes("RGB", size, zlib.decompress(one)) for one in packed[::step])

    sampled = np.concatenate([np.asarray(one) for one in unpacked(1 + len(packed) // _GIF_SAMPLES)])
    palette = Image.fromarray(sampled).quantize(256, Image.Quantize.MAXCOVERAGE)
    first, *others = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in unpacked())
    ends = np.rint(100.0 * np.arange(len(packed) + 1) / fps)  # GIF durations are multiples of 10 ms
    durations = [int(one) for one in 10.0 * np.diff(ends)]
    with open(path, "w+b") as file:
        first.save(file, "GIF", save_all=True, append_images=others, duration=durations, loop=0, comment=origin)


def _encode_pngs(path: Path, form: str, size: Size, fps: int, origin: str, pictures: Iterator[Picture]) -> None:
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_itxt("Description", origin)
    if form:
        Image.fromarray(next(pictures)).save(path, optimize=True, pnginfo=info)
        return
    path.mkdir()
    for number, picture in enumerate(pictures, 1):
        Image.fromarray(picture).save(path / f"{number:05d}.png", compress_level=6, pnginfo=info)
