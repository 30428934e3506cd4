"""Signals: whenever Ctrl-C or SIGTERM comes, the exit status is 130 and what remains is whole."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from contextlib import suppress

import pytest

from taichi_disk.signals import heard, interrupts

COMMAND = [sys.executable, "-m", "taichi_disk", "run", "exponential_wall", "--set=video.seconds=20"]
# Source text is carried out wherever a module makes a dataclass: an interrupt that falls there has to end like others.
IN_SOURCE_TEXT = """
import signal
from taichi_disk.signals import interrupts
try:
    with interrupts():
        exec("signal.raise_signal(signal.SIGINT)")
except KeyboardInterrupt:
    raise SystemExit(130)
"""
IN_THE_FIRST_PICTURE = """
import builtins, signal
import taichi as ti
from taichi_disk import load_scene, run
from taichi_disk.signals import interrupts

def drawn(window, first=ti.ui.Window.get_image_buffer_as_numpy, imported=builtins.__import__):
    def interrupted(*what):
        signal.raise_signal(signal.SIGINT)
        return imported(*what)
    builtins.__import__ = interrupted
    try:
        return first(window)
    finally:
        builtins.__import__ = imported

ti.ui.Window.get_image_buffer_as_numpy = drawn
result = run(load_scene("exponential_wall", ["lattice.points=20", "video.seconds=0.1", "video.size=64"]))
try:
    with interrupts():
        result.film("film.mp4")
except KeyboardInterrupt:
    raise SystemExit(130)
"""


def seconds_of_a_run(tmp_path):
    began = time.monotonic()
    subprocess.run([*COMMAND, "--out", str(tmp_path / "whole")], check=True, capture_output=True)
    return time.monotonic() - began


def interrupted(out, after, number):
    process = subprocess.Popen([*COMMAND, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    time.sleep(after)
    process.send_signal(number)
    try:
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    if process.returncode == -number:  # before Python has come to our first line
        assert not out.exists()
        return
    assert process.returncode in (0, 130), err
    assert "Traceback" not in err
    assert not list(out.parent.glob(".*"))
    if out.exists():
        status = json.loads((out / "summary.json").read_text())["status"]
        assert status == ("done" if process.returncode == 0 else "interrupted")
        films = {path.name for path in out.iterdir() if path.suffix in (".mp4", ".partial")}
        assert films <= {"video.mp4"} and (status == "done" or not films)


def test_an_interrupt_is_raised_until_it_is_heard_though_a_library_swallows_it(monkeypatch):
    monkeypatch.setattr("taichi_disk.signals.AGAIN", 0.05)
    with interrupts():
        with pytest.raises(KeyboardInterrupt):
            with suppress(BaseException):  # as Taichi's decorator does
                signal.raise_signal(signal.SIGTERM)
            time.sleep(5.0)
        heard()
        time.sleep(0.2)


def test_an_error_that_comes_of_a_swallowed_interrupt_is_that_interrupt():
    with pytest.raises(KeyboardInterrupt), interrupts():
        with suppress(BaseException):
            signal.raise_signal(signal.SIGINT)
        raise ValueError  # Taichi takes a method for a function, and complains of `self`
    with pytest.raises(ValueError), interrupts():
        raise ValueError


@pytest.mark.filterwarnings("error")  # pytest's word for what Python prints of an exception that nobody can catch
def test_an_interrupt_where_nothing_can_be_raised_comes_again_without_a_word(monkeypatch):
    class Dying:
        def __del__(self):
            signal.raise_signal(signal.SIGTERM)

    monkeypatch.setattr("taichi_disk.signals.AGAIN", 0.05)
    with pytest.raises(KeyboardInterrupt), interrupts():
        Dying()
        time.sleep(5.0)


@pytest.mark.parametrize("text", [IN_SOURCE_TEXT, IN_THE_FIRST_PICTURE], ids=["source text", "first picture"])
def test_an_interrupt_within_a_library_leaves_the_exit_status_to_the_program(tmp_path, text):
    (tmp_path / "interrupted.py").write_text(text)
    assert subprocess.run([sys.executable, "-m", "interrupted"], cwd=tmp_path).returncode == 130


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.validate)])
def test_a_run_that_is_interrupted_leaves_a_summary_that_says_so(tmp_path, number):
    interrupted(tmp_path / "a" / "o", 2.0 + random.Random(int(number)).random(), number)


@pytest.mark.validate
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_at_any_moment_ends_with_130_and_leaves_nothing_half_written(tmp_path, number):
    whole, moments = seconds_of_a_run(tmp_path), random.Random(7 + int(number))
    for k in range(6):
        interrupted(tmp_path / str(k) / "o", moments.uniform(0.05, whole), number)


@pytest.mark.validate
def test_a_killed_run_is_cleared_by_the_next_and_never_harms_a_finished_one(tmp_path):
    whole, moments = seconds_of_a_run(tmp_path), random.Random(3)
    out, finished = tmp_path / "k" / "o", False
    for _ in range(5):
        process = subprocess.Popen([*COMMAND, "--out", str(out)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        time.sleep(moments.uniform(0.3, 1.1 * whole))
        process.kill()
        process.wait()
        done = (out / "summary.json").exists()
        assert done or not finished, "a finished run was lost"
        finished = finished or done
        if done:
            assert json.loads((out / "summary.json").read_text())["status"] == "done"
    subprocess.run([*COMMAND, "--out", str(out)], check=True, capture_output=True)
    assert {path.name for path in out.parent.iterdir()} <= {"o", ".o.lock"}
    assert not list(out.glob(".*"))
