"""Text files: encodings, devices, pipes, and files that are too large."""

import contextlib
import os
import threading

import pytest

from taichi_disk.base.errors import InputError
from taichi_disk.base.text_files import MAX_BYTES, read_text
from taichi_disk.experiments.scenes import load_any, load_scene

SCENE = "scene: exponential_wall\nimpact: {velocity: 0.03}  # η\n"
SWEEP = "scene: exponential_wall\nsweep: {seed: [0]}\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_a_scene_may_have_a_byte_order_mark(tmp_path, encoding):
    path = tmp_path / "scene.yaml"
    path.write_text(SCENE, encoding=encoding)
    assert read_text(path) == SCENE
    assert load_scene(path) == load_scene(SCENE)


def test_a_file_larger_than_the_limit_is_not_read(tmp_path):
    path = tmp_path / "scene.yaml"
    with path.open("wb") as file:
        file.truncate(3_000_000_000)  # a sparse file, which takes no room
    with pytest.raises(InputError, match=r"scene\.yaml: is larger than 10 MB"):
        load_scene(path)
    with path.open("wb") as file:
        file.write(b" " * MAX_BYTES)
    assert len(read_text(path)) == MAX_BYTES
    with pytest.raises(InputError, match="is larger than"):
        read_text(path, limit=MAX_BYTES - 1)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes")
def test_a_scene_may_come_from_a_pipe_but_no_other_file_may(tmp_path):
    with pytest.raises(InputError, match=r"^/dev/zero: is a device or a pipe"):
        load_scene("/dev/zero")
    path = tmp_path / "pipe"
    os.mkfifo(path)
    with pytest.raises(InputError, match="pipe: is a device or a pipe"):
        read_text(path)
    for text in (SCENE, SWEEP, "#" * (MAX_BYTES + 1)):
        writer = threading.Thread(target=write_ignoring_readers_end, args=(path, text))
        writer.start()
        if text in (SCENE, SWEEP):
            assert load_any(path) == load_any(text)
        else:
            with pytest.raises(InputError, match="is larger than"):
                load_any(path)
        writer.join()


def write_ignoring_readers_end(path, text):
    with contextlib.suppress(BrokenPipeError):
        path.write_text(text, encoding="utf-8")
