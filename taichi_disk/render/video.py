"""Encode MP4 (H.264) and WebM (VP9) with PyAV, GIF and PNG with Pillow, in a thread of its own."""

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
    # Against "veryfast" with crf 22 the film takes four fifths of the time and half more bytes; enlarged, pictures look
    # the same. The macroblock tree of x264 reads memory that nothing was written to (valgrind shows it): with it bytes
    # depend on chance.
    ".mp4": {"preset": "superfast", "crf": "24", "coder": "0", "bf": "0", "partitions": "none", "mbtree": "0"},
    ".webm": {"crf": "32", "b": "0", "deadline": "realtime", "cpu-used": "6"},
}
_BT709 = 1  # of primaries, transfer and matrix in H.273; players guess at colours that carry no tags
_GIF_SAMPLES = 12  # pictures, about, from which the palette is chosen


@contextmanager
def video(
    path: Path, form: str, width: int, height: int, fps: int, origin: str = ""
) -> Iterator[Callable[[Callable[[], Picture] | None], None]]:
    """Make a film in a format: ".mp4", ".webm", ".gif", ".png" for one picture, or "" for a folder of them.

    The same pictures give the same bytes. Raises OSError, at the next picture or at the end, if it cannot be written.

    Args:
        width, height: in pixels, even.
        origin: text that the files carry.

    Yields `write(picture)`: it appends what `picture()` returns (height, width, 3), called in the encoder's thread.
    """
    encode = {"": _encode_pngs, ".png": _encode_pngs, ".gif": _encode_gif}.get(form, _encode_stream)
    pictures: Queue[Callable[[], Picture] | None] = Queue(maxsize=2)
    # Drawing keeps Python's lock for milliseconds at a time; the encoder should not wait 5 ms more for its turn.
    switch_interval = sys.getswitchinterval()
    sys.setswitchinterval(5e-4)
    with ThreadPoolExecutor(1) as thread:
        incoming = (picture() for picture in iter(pictures.get, None))
        encoded = thread.submit(encode, path, form, (width, height), fps, origin, incoming)

        def write(picture: Callable[[], Picture] | None) -> None:
            while not encoded.done():  # an encoder that has failed makes no room
                with suppress(Full):
                    return pictures.put(picture, timeout=0.1)
            encoded.result()

        try:
            yield write
            write(None)
        except BaseException:
            with suppress(Exception):
                write(_give_up)
            raise
        finally:
            sys.setswitchinterval(switch_interval)
        encoded.result()


def _give_up() -> Picture:
    raise SimulationError("the film was given up")


def _encode_stream(path: Path, form: str, size: Size, fps: int, origin: str, pictures: Iterator[Picture]) -> None:
    """One stream of H.264 or VP9."""
    import av

    width, height = size
    options = {"fflags": "+bitexact"} | ({"movflags": "+faststart"} if form == ".mp4" else {})
    with open(path, "w+b") as file:  # of Python's, whose errors reach us: a full disk is one
        container = av.open(file, "w", format=form[1:], options=options)
        container.metadata["comment"] = origin
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


def _encode_gif(path: Path, form: str, size: Size, fps: int, origin: str, pictures: Iterator[Picture]) -> None:
    """One palette for all pictures, so that still parts do not flicker: they wait, packed, until it is known."""
    from PIL import Image

    packed = [zlib.compress(picture.tobytes(), 1) for picture in pictures]

    def unpacked(step: int = 1) -> Iterator[Any]:
        return (Image.frombytes("RGB", size, zlib.decompress(one)) for one in packed[::step])

    sampled = np.concatenate([np.asarray(one) for one in unpacked(1 + len(packed) // _GIF_SAMPLES)])
    palette = Image.fromarray(sampled).quantize(256, Image.Quantize.MAXCOVERAGE)
    first, *others = (one.quantize(palette=palette, dither=Image.Dither.NONE) for one in unpacked())
    ends = np.rint(100.0 * np.arange(len(packed) + 1) / fps)  # a GIF counts in hundredths of a second
    durations = [int(one) for one in 10.0 * np.diff(ends)]
    with open(path, "w+b") as file:
        first.save(file, "GIF", save_all=True, append_images=others, duration=durations, loop=0, comment=origin)


def _encode_pngs(path: Path, form: str, size: Size, fps: int, origin: str, pictures: Iterator[Picture]) -> None:
    """The only picture, or a folder of pictures: 00001.png and so on."""
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
