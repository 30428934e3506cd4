"""The processes of a sweep: what they import, what comes back, and how they end."""

import os
import signal
import sys
import tempfile
import threading
import time
import warnings
from concurrent.futures import BrokenExecutor
from importlib.util import find_spec

import pytest
from bodies import words

import taichi_disk
from taichi_disk.base import signals
from taichi_disk.base.processes.pool import Pool, awaited


@pytest.fixture
def pool():
    pool = Pool(1)
    yield pool
    pool.kill()


# Modules that a Python process imports at its start, or that its first call imports.
NAMES = words("""
    copy io os pickle queue random re selectors signal socket struct subprocess
    tempfile threading types warnings numpy yaml taichi taichi_disk
""")


@pytest.mark.parametrize("is_on_path", [False, True])
def test_no_file_of_the_working_folder_is_imported(is_on_path, tmp_path, monkeypatch):
    for name in NAMES:
        (tmp_path / f"{name}.py").write_text("open('imported', 'w')\nraise SystemExit")
    (tmp_path / "mine.py").touch()
    monkeypatch.chdir(tmp_path)
    if is_on_path:  # as `python -m` has it; a package may be found only there
        monkeypatch.setattr(sys, "path", ["", str(tmp_path), *sys.path])
    pool = Pool(2)
    found = {name: pool.submit(find_spec, name).result() for name in NAMES}
    mine = pool.submit(find_spec, "mine").result()
    pool.shutdown()
    assert not (tmp_path / "imported").exists()
    assert not [name for name in NAMES if str(tmp_path) in str(found[name].origin)]
    assert found["taichi_disk"].origin == taichi_disk.__file__
    assert (mine is not None) == is_on_path


@pytest.mark.skipif(sys.platform != "linux", reason="other systems set no limit")
def test_a_process_with_a_limit_cannot_fill_the_memory():
    with Pool(1, memory=2_000_000_000) as pool:
        assert len(pool.submit(bytes, 1000).result()) == 1000
        with pytest.raises(MemoryError):
            pool.submit(bytes, 3_000_000_000).result()


def test_values_and_errors_come_back_whatever_a_call_prints(pool):
    prints = [pool.submit(print, "x" * 100_000), pool.submit(os.write, 1, b"\x80\x04")]
    assert [future.result() for future in prints] == [None, 2]
    with pytest.raises(ValueError, match="invalid literal"):
        pool.submit(int, "x").result()
    cannot_be_pickled = "class E(Exception): pass\nraise E('a reason')"
    with pytest.raises(RuntimeError, match="a reason"):
        pool.submit(exec, cannot_be_pickled).result()
    assert pool.submit(len, b"x" * 1_000_000).result() == 1_000_000


def test_a_dead_process_breaks_the_pool(pool):
    with pytest.raises(BrokenExecutor):
        pool.submit(os._exit, 1).result()
    with pytest.raises(BrokenExecutor):
        pool.submit(os.getpid).result()


def test_processes_compute_at_the_same_time_and_are_killed_at_work():
    pool = Pool(2)
    sleeping = pool.submit(time.sleep, 60.0)
    number = pool.submit(os.getpid).result()
    assert number != os.getpid()
    began = time.monotonic()
    pool.kill()
    assert time.monotonic() - began < 30.0
    assert sleeping.exception() is not None
    with pytest.raises(ProcessLookupError):
        os.kill(number, 0)


def test_signals_are_served_while_another_thread_waits(monkeypatch):
    ended = threading.Event()
    assert awaited(ended.is_set) is False
    with pytest.raises(TimeoutError):
        awaited(ended.wait, 0.01)
    monkeypatch.setattr(signals, "_pending", [signal.SIGTERM])
    with pytest.raises(KeyboardInterrupt):
        awaited(ended.wait)
    ended.set()


def test_without_a_writable_home_processes_share_one(tmp_path, monkeypatch, notices):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setenv("HOME", "/proc/nobody")
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    monkeypatch.delenv("TI_OFFLINE_CACHE_FILE_PATH", raising=False)
    pool = Pool(2)
    homes = {pool.submit(os.getenv, "HOME").result() for _ in range(2)}
    # warnings of libraries are no errors in a process
    assert pool.submit(warnings.warn, "for developers").result() is None
    pool.shutdown()
    assert homes == {os.environ["HOME"]}
    assert str(tmp_path) in os.environ["HOME"]
    assert len(notices.messages) == 1
