"""Films: what comes out of the MP4 is what went in, whole or not at all, and the same bytes each time."""

from __future__ import annotations

import hashlib
import os
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
import taichi as ti

from taichi_disk.errors import InputError, SimulationError, TaichiDiskError
from taichi_disk.lattice import disk_lattice
from taichi_disk.render.colours import GROUND
from taichi_disk.render.film import film_problem, record_film
from taichi_disk.render.layout import Layout
from taichi_disk.render.picture import Frame, Subject

needs_vulkan = pytest.mark.skipif(film_problem() is not None, reason=str(film_problem()))
COUNT, SIZE, FPS = 12, 240, 25


@pytest.fixture(scope="module", autouse=True)
def taichi() -> None:
    ti.init(ti.cpu, default_fp=ti.f64, fast_math=False, log_level=ti.ERROR)


def subject() -> Subject:
    return Subject(disk_lattice(150, 0), False, ("A test", "N = 150"), 0.02, (-1.2, 1.2, -0.2, 2.2))


def frames(what: Subject, count: int = COUNT, bad: int | None = None) -> Iterator[list[Frame]]:
    for k in range(count):
        centre = np.array([0.15 * np.sin(k), 1.0 + 0.15 * np.cos(0.7 * k)])
        positions = what.lattice.positions + centre
        if k == bad:
            positions[3] = np.nan
        yield [Frame(0.1 * k, positions, (f"t = {0.1 * k:.2f} R/c",))]


@needs_vulkan
def test_the_film_has_the_frames_size_and_rate_asked_for_and_the_disk_where_it_was(tmp_path: Path) -> None:
    what, path, told = subject(), tmp_path / "film.mp4", []
    progress = lambda done, total: told.append((done, total))  # noqa: E731
    record_film(path, [what], frames(what), size=SIZE, fps=FPS, total=COUNT, progress=progress)
    assert told == [(k, COUNT) for k in range(1, COUNT + 1)]
    assert list(tmp_path.iterdir()) == [path]
    film = iio.imread(path)
    assert film.shape == (COUNT, SIZE, SIZE, 3)
    assert iio.immeta(path)["fps"] == FPS
    camera = Layout(what, SIZE, 1).camera
    stage = slice(camera.top, camera.top + camera.height)
    for picture, (frame,) in zip(film, frames(what), strict=True):
        amount = np.abs(picture[stage] - 255 * np.array(GROUND)).sum(axis=-1)
        rows, columns = np.nonzero(amount > 40)
        seen = np.array([columns.min() + columns.max() + 1, rows.min() + rows.max() + 1]) / 2 + [
            0,
            camera.top,
        ]
        there = camera.to_pixels(frame.positions)
        assert np.abs(seen - (there.min(axis=0) + there.max(axis=0)) / 2).max() < 2


@needs_vulkan
def test_colours_survive_the_encoding(tmp_path: Path) -> None:
    what, path = subject(), tmp_path / "film.mp4"
    rest, up = what.lattice.positions, np.array([0.0, 1.0])
    squeezed = [[Frame(0.0, (1.0 + strain) * rest + up, ())] for strain in (0.02, -0.02, 0.0)]
    record_film(path, [what], squeezed, size=SIZE, total=3)
    camera = Layout(what, SIZE, 0).camera
    red, blue, grey = iio.imread(path)[:, camera.top : camera.top + camera.height].astype(int).mean(axis=(1, 2))
    ground = 255 * np.array(GROUND)
    # What springs take from the ground: red ones leave the red, blue ones the blue, grey ones neither.
    assert (ground - red)[0] < 0.75 * (ground - red)[2]
    assert (ground - blue)[2] < 0.75 * (ground - blue)[0]
    assert np.ptp(ground - grey) < 3


SCRIPT = """
import sys
sys.path[:0] = {paths!r}
import taichi as ti
ti.init(ti.cpu, default_fp=ti.f64, fast_math=False, cpu_max_num_threads=int(sys.argv[2]), log_level=ti.ERROR)
from pathlib import Path
from test_film import frames, subject
from taichi_disk.render.film import record_film
what = subject()
record_film(Path(sys.argv[1]), [what], frames(what), size=240, total=12)
"""


@needs_vulkan
def test_two_processes_with_1_and_2_threads_make_the_same_bytes(tmp_path: Path) -> None:
    script = tmp_path / "make.py"
    script.write_text(SCRIPT.format(paths=[str(Path(__file__).parent), str(Path(__file__).parents[1])]))
    films = [tmp_path / "one.mp4", tmp_path / "two.mp4"]
    for threads, film in enumerate(films, start=1):
        subprocess.run([sys.executable, script, film, str(threads)], check=True, cwd=tmp_path)
    pictures = [hashlib.sha256(iio.imread(film).tobytes()).hexdigest() for film in films]
    assert pictures[0] == pictures[1]
    assert films[0].read_bytes() == films[1].read_bytes()


@needs_vulkan
@pytest.mark.parametrize(
    ("given", "error", "says"),
    [
        ({"bad": 5}, SimulationError, "t = 0.5 R/c"),
        ({"count": COUNT - 1}, SimulationError, "was to have 12 frames and got 11"),
        ({"count": 0}, SimulationError, "no frames"),
    ],
)
def test_a_film_that_fails_leaves_nothing(tmp_path: Path, given: dict, error: type, says: str) -> None:
    what = subject()
    with pytest.raises(error, match=says):
        record_film(tmp_path / "film.mp4", [what], frames(what, **given), size=SIZE, total=COUNT)
    assert not list(tmp_path.iterdir())


@needs_vulkan
def test_an_interrupted_film_leaves_the_old_one_as_it_was(tmp_path: Path) -> None:
    what, path = subject(), tmp_path / "film.mp4"
    path.write_bytes(b"old")

    def interrupted() -> Iterator[list[Frame]]:
        yield from frames(what, 3)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        record_film(path, [what], interrupted(), size=SIZE, total=COUNT)
    assert list(tmp_path.iterdir()) == [path] and path.read_bytes() == b"old"
    # A window was open when it happened: the next one must still work.
    record_film(path, [what], frames(what), size=SIZE, total=COUNT)
    assert len(iio.imread(path)) == COUNT


@needs_vulkan
@pytest.mark.parametrize("reads", ["0", "400000", "1000000000"])
def test_an_ffmpeg_that_fails_is_noticed_and_quoted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, reads: str
) -> None:
    import imageio_ffmpeg

    # Like a full disk: some of the input is read (in the last case all of it), then comes an exit status of 1.
    false_ffmpeg = tmp_path / "ffmpeg"
    false_ffmpeg.write_text(f"#!/bin/sh\nhead -c {reads} > /dev/null\necho 'No space left on device' >&2\nexit 1\n")
    false_ffmpeg.chmod(false_ffmpeg.stat().st_mode | stat.S_IXUSR)
    monkeypatch.setattr(imageio_ffmpeg, "get_ffmpeg_exe", lambda: str(false_ffmpeg))
    what, out = subject(), tmp_path / "out"
    out.mkdir()
    with pytest.raises(SimulationError, match="No space left on device"):
        record_film(out / "film.mp4", [what], frames(what), size=SIZE, total=COUNT)
    assert not list(out.iterdir())


@needs_vulkan
def test_a_vulkan_that_does_not_work_is_reported(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(*_: object, **__: object) -> None:
        raise RuntimeError("device lost")

    monkeypatch.setattr(ti.ui, "Window", broken)
    with pytest.raises(TaichiDiskError, match=r"no film: Vulkan cannot draw .* device lost"):
        record_film(tmp_path / "film.mp4", [subject()], frames(subject()), size=SIZE, total=COUNT)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("size", [721, 0, -720, 62])
def test_odd_and_tiny_sizes_are_refused_before_a_frame_is_computed(tmp_path: Path, size: int) -> None:
    what, asked = subject(), frames(subject())
    with pytest.raises(InputError, match="even and at least 64"):
        record_film(tmp_path / "film.mp4", [what], asked, size=size, total=COUNT)
    assert next(asked)[0].t == 0.0


NO_VULKAN = """
import sys
sys.path[:0] = {paths!r}
from taichi_disk.errors import TaichiDiskError
from taichi_disk.render.film import film_problem, record_film
print(film_problem())
import taichi as ti
ti.init(ti.cpu, default_fp=ti.f64, log_level=ti.ERROR)
from pathlib import Path
from test_film import frames, subject
try:
    record_film(Path("film.mp4"), [subject()], frames(subject()), total=12)
except TaichiDiskError as error:
    print(error.exit_status, error)
"""


def test_without_vulkan_the_message_names_the_remedy(tmp_path: Path) -> None:
    script = tmp_path / "make.py"
    script.write_text(NO_VULKAN.format(paths=[str(Path(__file__).parent), str(Path(__file__).parents[1])]))
    nowhere = os.environ | {"VK_ICD_FILENAMES": "/nonexistent", "VK_DRIVER_FILES": "/nonexistent"}
    done = subprocess.run([sys.executable, script], cwd=tmp_path, env=nowhere, capture_output=True, text=True)
    problem, failure = [line for line in done.stdout.splitlines() if not line.startswith("[Taichi]")]
    for line in (problem, failure):
        assert "no Vulkan driver" in line
        assert "apt-get update && apt-get install -y --no-install-recommends libx11-6 mesa-vulkan-drivers" in line
    assert failure.startswith("1 no film: ")
    assert list(tmp_path.iterdir()) == [script]
