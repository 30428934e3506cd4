"""Encode MP4 (H.264) and WebM (VP9) with PyAV, GIF and PNG with Pillow."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from taichi_disk.pictures.panel import Picture

Size = tuple[int, int]  # width and height, even numbers [px]
Append = Callable[[Picture, bool], object]

_CODECS = {".mp4": "libx264", ".webm": "libvpx-vp9"}
_OPTIONS = {
    # "veryfast" with B pictures takes 1.5 times as long for 0.4 of the bytes. The
    # macroblock tree of x264 reads uninitialised memory (found by valgrind), so bytes
    # would differ from run to run; without it and without a search for changes of the
    # scene there is nothing to look ahead for. The deblocking filter takes 15 % of the
    # time of a step back in browsers, and the films have no visible blocks.
    ".mp4": {
        "preset": "superfast",
        "crf": "25",
        "bf": "0",
        "mbtree": "0",
        "rc-lookahead": "0",
        "sc_threshold": "0",
        "weightp": "0",
        "x264-params": "no-deblock=1",
    },
    ".webm": {"crf": "32", "b": "0", "deadline": "realtime", "cpu-used": "6"},
}
_KEY_INTERVAL = 1.0  # time from one key picture to the next, for steps back [s]
# primaries, transfer and matrix in H.273; without tags players guess the colours
_BT709 = 1
GIF_FPS = 50  # browsers show each picture of faster films for 100 ms
_GIF_SAMPLES = 12  # approximate number of pictures that determine the palette
_GIF_EXACT = 16  # number of frequent colours that are kept exactly


def video(
    path: Path, form: str, size: Size, fps: int, origin: str
) -> AbstractContextManager[Append]:
    """Write a film as ".mp4", ".webm" or ".gif", one picture as ".png", or a folder of
    pictures as "".

    `origin`: text for the metadata of the file. Use as `with video(...) as append`.
    `append(picture, is_new)` appends an array (height, width, 4), and does not keep it;
    an old picture is the one before. Equal pictures give equal bytes. Raises OSError,
    at a later picture or at the end, if the file cannot be written.
    """
    encoder = {"": _folder, ".png": _still, ".gif": _gif}.get(form, _stream)
    return encoder(path, size, fps, origin)


@contextmanager
def _stream(path: Path, size: Size, fps: int, origin: str) -> Iterator[Append]:
    import av

    form = path.suffix
    width, height = size
    options = {"fflags": "+bitexact"}
    if form == ".mp4":
        options["movflags"] = "+faststart"
    # a Python file raises errors such as a full disk; FFmpeg does not
    with open(path, "w+b") as file:
        container = av.open(file, "w", format=form[1:], options=options)
        container.metadata["comment"] = origin
        stream: Any = container.add_stream(
            _CODECS[form], rate=fps, options=_OPTIONS[form]
        )
        stream.width = width
        stream.height = height
        stream.pix_fmt = "yuv420p"
        context = stream.codec_context
        # The number of threads changes the bytes, so it must not depend on the machine.
        # One thread is fastest, because the drawing keeps another core busy.
        context.thread_count = 1 + min(width, height) // 1080
        context.gop_size = max(round(_KEY_INTERVAL * fps), 1)
        context.flags |= av.codec.context.Flags.bitexact
        context.color_range = 1
        context.colorspace = _BT709
        context.color_primaries = context.color_trc = _BT709
        # Reuse one converter: creating it takes twice as long as converting a picture.
        converter: Any = av.video.reformatter.VideoReformatter()
        number = count()
        frame: Any = None

        def append(picture: Picture, is_new: bool) -> None:
            nonlocal frame
            if is_new:
                frame = converter.reformat(
                    av.VideoFrame.from_numpy_buffer(picture, format="rgba"),
                    format="yuv420p",
                    dst_colorspace="ITU709",
                    dst_color_range="MPEG",
                    interpolation="POINT",
                )
            frame.pts = next(number)
            frame.time_base = Fraction(1, fps)
            container.mux(stream.encode(frame))

        yield append
        container.mux(stream.encode(None))
        container.close()


@contextmanager
def _gif(path: Path, size: Size, fps: int, origin: str) -> Iterator[Append]:
    """Encode with one palette for all pictures, so that still parts do not flicker.

    The pictures are kept compressed in memory until the palette is known.
    """
    from PIL import Image

    packed: list[bytes] = []

    def append(picture: Picture, is_new: bool) -> None:
        packed.append(zlib.compress(picture[..., :3].tobytes(), 1))

    def unpacked(step: int = 1) -> Iterator[Any]:
        for data in packed[::step]:
            yield Image.frombytes("RGB", size, zlib.decompress(data))

    yield append
    palette = _palette(unpacked(1 + len(packed) // _GIF_SAMPLES))
    first, *others = (
        one.quantize(palette=palette, dither=Image.Dither.NONE) for one in unpacked()
    )
    # GIF durations are multiples of 10 ms
    starts = np.rint(100.0 / fps * np.arange(len(packed) + 1))
    first.save(
        path,
        save_all=True,
        append_images=others,
        duration=[int(one) for one in 10.0 * np.diff(starts)],
        loop=0,
        comment=origin,
    )


def _palette(samples: Iterator[Any]) -> Any:
    """Return an image whose palette suits all `samples`, which are images, too."""
    from PIL import Image

    sampled = Image.fromarray(np.concatenate([np.asarray(one) for one in samples]))
    palette = sampled.quantize(256 - _GIF_EXACT, Image.Quantize.MAXCOVERAGE)
    # The colours of the largest areas, such as background and wall, are exact, because
    # a tinge would be seen.
    counts = sorted(sampled.getcolors(sampled.width * sampled.height) or [])
    exact = np.array([colour for _, colour in counts[-_GIF_EXACT:]])
    palette.putpalette([*(palette.getpalette() or []), *exact.ravel().tolist()])
    return palette


@contextmanager
def _still(path: Path, size: Size, fps: int, origin: str) -> Iterator[Append]:
    yield lambda picture, is_new: _save(picture, path, origin, optimize=True)


@contextmanager
def _folder(path: Path, size: Size, fps: int, origin: str) -> Iterator[Append]:
    path.mkdir()
    number = count(1)
    yield lambda picture, is_new: _save(
        picture, path / f"{next(number):05d}.png", origin, compress_level=6
    )


def _save(picture: Picture, path: Path, origin: str, **options: Any) -> None:
    from PIL import Image
    from PIL.PngImagePlugin import PngInfo

    info = PngInfo()
    info.add_itxt("Description", origin)
    Image.fromarray(picture[..., :3]).save(path, pnginfo=info, **options)
