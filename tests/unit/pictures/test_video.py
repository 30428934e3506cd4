"""A film has the length that was asked for, in every program that plays it."""

import av
import numpy as np
import pytest
from PIL import Image
from programs import durations_of

from taichi_disk.pictures.render.video import video


@pytest.mark.parametrize("count", [1, 2, 61, 62, 63, 100])
@pytest.mark.parametrize("fps", [10, 30, 49, 50])
def test_a_gif_shows_pictures_as_browsers_do_and_keeps_its_length(tmp_path, fps, count):
    # Browsers show a picture of 10 ms for 100 ms. Equal neighbours become one picture.
    stripes = np.repeat(np.eye(4, dtype=np.uint8)[:, None, :3] * 255, 8, axis=1)
    path = tmp_path / "film.gif"
    with video(path, ".gif", (8, 4), fps, "") as append:
        for k in range(count):
            picture = np.roll(stripes, k, axis=0)
            append(picture, True)
    durations = durations_of(path)
    assert sum(durations) == pytest.approx(1e3 * count / fps, abs=5.1)
    assert min(durations) >= 20
    assert len(durations) == count


def test_large_areas_of_a_gif_have_their_exact_colours(tmp_path):
    # a ground and a wall beside a disk with all colours
    ground = [250, 250, 248]
    wall = [196, 194, 186]
    picture = np.full((64, 64, 4), [*ground, 255], dtype=np.uint8)
    picture[44:] = [*wall, 255]
    picture[:32, :32, :3] = np.random.default_rng(0).integers(0, 255, (32, 32, 3))
    path = tmp_path / "film.gif"
    with video(path, ".gif", (64, 64), 10, "") as append:
        append(picture, True)
    with Image.open(path) as gif:
        pixels = np.asarray(gif.convert("RGB"))
    assert (pixels[:40, 40:] == ground).all()
    assert (pixels[44:] == wall).all()


def test_colours_that_appear_late_in_a_gif_are_in_its_palette(tmp_path):
    pictures = []
    for k in range(10):
        picture = np.full((32, 32, 4), 255, dtype=np.uint8)
        picture[4:28, 4:28, :3] = [24 * k, 255 - 24 * k, 40]
        pictures.append(picture)
    path = tmp_path / "film.gif"
    with video(path, ".gif", (32, 32), 10, "") as append:
        for picture in pictures:
            append(picture, True)
    with Image.open(path) as gif:
        for k, picture in enumerate(pictures):
            gif.seek(k)
            shown = np.asarray(gif.convert("RGB"))[16, 16].astype(int)
            assert np.abs(shown - picture[16, 16, :3]).max() <= 8


def test_an_mp4_begins_with_its_index_and_has_key_pictures_and_colours_of_hd(tmp_path):
    path = tmp_path / "film.mp4"
    rows, columns = np.mgrid[:48, :64]
    drawn = []
    with video(path, ".mp4", (64, 48), 10, "a scene") as append:
        for k in range(25):
            layers = (3 * rows + columns + 2 * k, 255 - 4 * columns, 5 * rows, rows)
            drawn.append(np.stack(layers, axis=2).astype(np.uint8))
            append(drawn[k], True)
    data = path.read_bytes()
    assert data.index(b"moov") < data.index(b"mdat")  # browsers play while they load
    assert b" threads=1 " in data  # other numbers give other bytes
    with av.open(str(path)) as film:
        stream = film.streams.video[0]
        pictures = list(film.decode(stream))
        colours = stream.codec_context
        tags = (colours.colorspace, colours.color_primaries, colours.color_trc)
        assert tags == (1, 1, 1)  # BT.709 in H.273
        assert colours.color_range == 1
        assert film.metadata["comment"] == "a scene"
        assert colours.has_b_frames is False
    assert [one.time for one in pictures] == pytest.approx(np.arange(25) / 10.0)
    # steps back are quick
    assert [k for k, one in enumerate(pictures) if one.key_frame] == [0, 10, 20]
    for k in (0, 24):
        shown = pictures[k].to_ndarray(format="rgb24")[8:40, 8:56]
        off = shown.astype(float) - drawn[k][8:40, 8:56, :3]
        assert np.abs(off.mean(axis=(0, 1))).max() < 2.5
        assert np.abs(off).mean() < 4.0
