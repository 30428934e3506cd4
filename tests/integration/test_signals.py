"""Whenever Ctrl-C or SIGTERM comes, the exit status is 130, all files complete."""

import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from programs import python, summary_in

from taichi_disk.base import engine, signals
from taichi_disk.base.signals import (
    ENDINGS,
    INTERRUPTED,
    REPEAT_TIME,
    deferred_interrupts,
    ignored_by_children,
    raise_if_interrupted,
)

RUN = ["-m", "taichi_disk", "run", "exponential_wall", "--set=video.seconds=8"]
COMMAND = [sys.executable, *RUN]
FIRST_PICTURE = """
import builtins, signal
from taichi_disk.base.engine import ti
from taichi_disk import load_scene, run

first = ti.ui.Window.get_image_buffer_as_numpy
imported = builtins.__import__

def drawn(window):
    def interrupted(*what):
        # an exception within this import, NumPy's own, would abort the process
        signal.raise_signal(signal.SIGINT)
        return imported(*what)
    builtins.__import__ = interrupted
    try:
        return first(window)
    finally:
        builtins.__import__ = imported

ti.ui.Window.get_image_buffer_as_numpy = drawn
small = ["lattice.points=20", "video.seconds=0.1", "video.size=64"]
result = run(load_scene("exponential_wall", small))
try:
    result.film("film.mp4")
except KeyboardInterrupt:
    raise SystemExit(7)
"""
FROM_PYTHON = """
from taichi_disk import run
from taichi_disk.base.engine import ti
slow = {"lattice": {"points": 300}, "impact": {"velocity": 1e-4}}
scene = {"scene": "exponential_wall"} | slow
print("ready", flush=True)
try:
    while True:
        run(scene)
        ti.reset()  # kernels are compiled, or looked for, again
except KeyboardInterrupt:
    raise SystemExit(7)
"""
IMPORTING = """
import builtins, signal, sys
from taichi_disk.__main__ import process

def interrupted(name, *more, imported=builtins.__import__, **options):
    if name == module:
        builtins.__import__ = imported
        signal.raise_signal(signal.SIGINT)
    return imported(name, *more, **options)

module = sys.argv.pop(1)
builtins.__import__ = interrupted
process()
"""
LISTENING = """
import time
from taichi_disk.base import signals
signals.REPEAT_TIME = 0.3
signals.listen()
print("ready", flush=True)
time.sleep(30.0)
"""


@pytest.fixture(autouse=True)
def _heard_signals():
    """Restore the usual handling of Ctrl-C and of a lost connection, also for children:
    the shell ignores the one for background jobs, `nohup` the other."""
    before = {
        signal.SIGINT: signal.signal(signal.SIGINT, signal.default_int_handler),
        signal.SIGHUP: signal.signal(signal.SIGHUP, signal.SIG_DFL),
    }
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def into(out):
    return [*COMMAND, "--out", str(out)]


def ready(code, *before):
    """Start Python with a script that says when it is ready."""
    command = [*before, sys.executable, "-c", code]
    child = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "ready\n"
    return child


@pytest.fixture(scope="module")
def run_time(tmp_path_factory):
    """Return how long COMMAND takes [s]."""
    began = time.monotonic()
    out = tmp_path_factory.mktemp("whole") / "o"
    subprocess.run(into(out), check=True, capture_output=True)
    return time.monotonic() - began


def interrupted(out, after, number):
    """Send a signal to a run, and check what it leaves."""
    process = subprocess.Popen(
        into(out), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    time.sleep(after)
    process.send_signal(number)
    try:
        _, err = process.communicate(timeout=60)
    finally:
        process.kill()
    is_early = "Traceback" in err and "in process" not in err
    if process.returncode == -number or is_early:
        # The signal comes before Python has reached our first line.
        assert not out.exists()
        return
    assert process.returncode in (0, 130), err
    assert "Traceback" not in err
    assert not list(out.parent.glob(".*"))
    if out.exists():
        # It is done if only the film is missing.
        status = summary_in(out)["status"]
        films = [one.name for one in out.iterdir() if "video" in one.name]
        assert status in ("done", "interrupted")
        assert films in ([], ["video.mp4"])
        assert status == "done" or not films
        assert films or process.returncode


def test_ctrl_c_is_raised_at_a_check_or_at_the_end_and_a_second_one_at_once(
    monkeypatch,
):
    monkeypatch.setattr(signals, "REPEAT_TIME", 0.1)
    with pytest.raises(KeyboardInterrupt), deferred_interrupts():
        signal.raise_signal(signal.SIGINT)
        heard = True
    assert heard
    with deferred_interrupts():
        signal.raise_signal(signal.SIGINT)
        with ThreadPoolExecutor(1) as thread:
            thread.submit(raise_if_interrupted).result()  # only the main thread raises
        with pytest.raises(KeyboardInterrupt):
            raise_if_interrupted()
        raise_if_interrupted()  # once
        time.sleep(0.1)
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


@pytest.mark.validate
@pytest.mark.parametrize("after", [5.0, 12.0, 20.0])
def test_a_second_ctrl_c_ends_the_building_of_a_large_lattice_at_once(tmp_path, after):
    process = subprocess.Popen(
        [*into(tmp_path / "out"), "--set=lattice.points=1000000"]
    )
    time.sleep(after)
    process.send_signal(signal.SIGINT)
    time.sleep(2.0 * REPEAT_TIME)
    before = processor_time(process)
    process.send_signal(signal.SIGINT)
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    assert process.returncode == INTERRUPTED
    assert used.ru_utime + used.ru_stime - before < 2.0


def processor_time(process):
    """Return the processor time [s] that a process has used in all its threads."""
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    ticks = int(fields[11]) + int(fields[12])  # user, system
    return ticks / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize("number", ENDINGS)
def test_processes_of_a_sweep_ignore_signals_that_their_parent_receives(number):
    code = f"import os; os.kill(os.getpid(), {int(number)}); print('alive')"

    def start():
        with ignored_by_children():
            return python("-c", code)

    with ThreadPoolExecutor(1) as thread:
        for child in (start(), thread.submit(start).result()):
            assert (child.stdout, child.stderr) == ("alive\n", "")
    received = []
    before = signal.signal(number, lambda number, frame: received.append(number))
    try:
        with ignored_by_children():
            signal.raise_signal(number)
    finally:
        signal.signal(number, before)
    assert received == [number]


def test_a_second_signal_ends_a_command_at_once_but_two_together_are_one():
    child = ready(LISTENING)
    for number in (signal.SIGTERM, signal.SIGINT):
        child.send_signal(number)
        time.sleep(0.02)
    assert child.poll() is None
    time.sleep(0.5)
    child.send_signal(signal.SIGINT)
    assert child.wait(timeout=10) == INTERRUPTED


def test_the_end_of_the_processor_time_is_one_signal_however_often_it_comes():
    child = ready(LISTENING)
    for _ in range(2):
        child.send_signal(signal.SIGXCPU)
        time.sleep(0.35)
    assert child.poll() is None
    child.send_signal(signal.SIGHUP)
    assert child.wait(timeout=10) == INTERRUPTED


def test_a_command_started_by_nohup_goes_on_when_the_connection_is_lost():
    child = ready(LISTENING, "sh", "-c", 'trap "" HUP; exec "$@"', "-")
    for _ in range(2):
        child.send_signal(signal.SIGHUP)
        time.sleep(0.35)
    assert child.poll() is None
    child.kill()
    child.wait()


@pytest.mark.validate
def test_a_second_signal_ends_a_command_that_waits_for_its_scene(tmp_path):
    os.mkfifo(tmp_path / "scene")
    command = [sys.executable, "-m", "taichi_disk", "check", "scene"]
    waiting = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    with (tmp_path / "scene").open("w"):  # waits for the reader
        for _ in range(2):
            waiting.send_signal(signal.SIGTERM)
            time.sleep(2.0 * REPEAT_TIME)
        assert waiting.communicate(timeout=10) == (None, "")
        assert waiting.returncode == INTERRUPTED


@pytest.mark.validate
def test_an_interrupt_while_the_first_picture_is_read_is_like_any_other(tmp_path):
    assert python("-c", FIRST_PICTURE, cwd=tmp_path).returncode == 7


@pytest.mark.parametrize("module", ["argparse", engine.NAME])
def test_an_interrupt_during_imports_ends_with_130_and_no_traceback(tmp_path, module):
    words = [module, *RUN[2:], "--out", str(tmp_path / "o")]
    done = python("-c", IMPORTING, *words)
    assert done.returncode == INTERRUPTED
    assert done.stderr == "interrupted\n"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.validate
def test_ctrl_c_in_python_is_a_keyboard_interrupt_wherever_a_run_is():
    moments = random.Random(5)
    for _ in range(2):
        child = ready(FROM_PYTHON)
        time.sleep(moments.uniform(0.0, 2.0))
        child.send_signal(signal.SIGINT)
        try:
            assert child.wait(timeout=20) == 7
        finally:
            child.kill()


@pytest.mark.validate
@pytest.mark.parametrize("number", ENDINGS)
def test_an_interrupt_at_any_moment_ends_with_130_and_leaves_nothing_half_written(
    tmp_path, run_time, number
):
    moments = random.Random(7 + int(number))
    for k in range(4):
        interrupted(tmp_path / str(k) / "o", moments.uniform(0.05, run_time), number)
