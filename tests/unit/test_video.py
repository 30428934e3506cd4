"""A film has the length that was asked for, in every program that plays it."""

from __future__ import annotations

import numpy as np
import pytest
from PIL import Image

from taichi_disk.render.video import video


@pytest.mark.parametrize("count", [1, 2, 61, 62, 63, 100])
@pytest.mark.parametrize("fps", [10, 30, 50, 51, 60, 100, 120])
def test_a_gif_shows_no_picture_for_less_than_browsers_do_and_keeps_its_length(
    tmp_path, fps, count
):
    # Browsers show a picture of 10 ms for 100 ms. All pictures differ from their
    # neighbours, because equal ones become one.
    stripes = np.repeat(np.eye(4, dtype=np.uint8)[:, None, :3] * 255, 8, axis=1)
    path = tmp_path / "film.gif"
    with video(path, ".gif", (8, 4), fps, "") as append:
        for k in range(count):
            picture = np.roll(stripes, k, axis=0)
            append(lambda picture=picture: picture)
    durations = []
    with Image.open(path) as gif:
        for k in range(gif.n_frames):
            gif.seek(k)
            durations.append(gif.info["duration"])
    assert sum(durations) == pytest.approx(1e3 * count / fps, abs=5.1)
    assert len(durations) == 1 or min(durations) >= 20
    if fps <= 50:
        assert len(durations) == count
    else:
        # no fewer pictures than 25 in a second
        assert max(durations) <= 60
