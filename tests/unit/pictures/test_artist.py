"""The process that finishes films: what it sees, its errors and its end."""

import gc
import math
import os
import resource
import signal
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from taichi_disk.base.errors import SimulationError
from taichi_disk.base.processes.early import draw_early, picture_of
from taichi_disk.base.processes.pool import Pool
from taichi_disk.base.signals import deferred_interrupts
from taichi_disk.pictures.render import artist as module
from taichi_disk.pictures.render.artist import Artist, shared_array

# methods of an object that are functions of libraries, which another process finds
WORKER = SimpleNamespace(
    open=print,
    close=gc.collect,
    sleep=time.sleep,
    abort=os.abort,
    root=math.sqrt,
    change=os.chdir,
    make=os.mkdir,
)


@pytest.fixture
def artist():
    pool = Pool(1)
    yield Artist(pool)
    pool.kill()


def test_another_process_sees_what_is_written_into_an_array_that_it_has(artist):
    array = shared_array((3, 4))
    for value in (1, 200):
        array[1] = value
        assert (artist.begin(np.array, array)() == array).all()
    assert array.sum() == 800


@pytest.mark.skipif(sys.platform != "linux", reason="memory without a name")
@pytest.mark.parametrize("is_refused", [True, False])
def test_without_shared_memory_a_thread_does_what_the_process_would(
    artist, monkeypatch, is_refused, tmp_path
):
    monkeypatch.setattr(module, "_shares_memory", True)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    if is_refused:
        monkeypatch.delattr(os, "memfd_create")
    else:
        resource.setrlimit(resource.RLIMIT_FSIZE, (10**6, limits[1]))
    try:
        assert shared_array((2000, 1000)).shape == (2000, 1000)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    monkeypatch.chdir(tmp_path)
    with artist.employ(WORKER, "begun") as call:
        call("make", "a")
        call("change", "a")  # of this process
    assert os.getcwd() == str(tmp_path / "a")


def test_a_picture_that_was_drawn_early_is_used_once(artist):
    artist.begin(draw_early, math.sqrt, 4.0)
    artist.begin(draw_early, math.sqrt, -4.0)  # its error hides nothing
    roots = [artist.begin(picture_of, math.sqrt, 9.0)() for _ in range(2)]
    assert roots == [2.0, 3.0]
    Artist().begin(draw_early, math.sqrt, 4.0)
    assert picture_of(math.sqrt, 9.0) == 3.0


@pytest.mark.parametrize("has_process", [True, False])
def test_calls_are_carried_out_in_their_order_and_one_that_fails_is_the_last(
    has_process, artist, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    if not has_process:
        artist = Artist()
    with artist.employ(WORKER, "begun") as call:
        call("change", str(tmp_path))
        for name in "abc":
            call("make", name)
            call("change", name)
    assert (tmp_path / "a" / "b" / "c").is_dir()
    assert (os.getcwd() == str(tmp_path)) == has_process
    with (
        pytest.raises(ValueError, match="math domain error"),
        artist.employ(WORKER) as call,
    ):
        call("root", -1.0)
        for name in range(100):
            call("sleep", 0.01)
            call("make", str(tmp_path / f"{name}"))
    assert len([*tmp_path.iterdir()]) < 20
    # what comes next is done here
    assert artist.begin(os.getpid)() == os.getpid()


def test_a_process_that_ends_is_named_in_a_sentence(artist):
    sentence = r"the process that encodes the film was ended .*\(SIGABRT\)"
    with pytest.raises(SimulationError, match=sentence), artist.employ(WORKER) as call:
        call("abort")


def test_an_interrupt_ends_a_process_that_does_not_answer(artist):
    process = artist.begin(os.getpid)()
    began = time.monotonic()
    with (
        pytest.raises(KeyboardInterrupt),
        deferred_interrupts(),
        artist.employ(WORKER) as call,
    ):
        call("sleep", 60.0)
        threading.Timer(0.1, signal.raise_signal, [signal.SIGINT]).start()
    assert time.monotonic() - began < 20.0
    with pytest.raises(ProcessLookupError):
        os.kill(process, 0)
