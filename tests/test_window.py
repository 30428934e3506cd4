"""The real window, opened on a virtual screen, used with mouse and keys, and looked at."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from PIL import Image

from taichi_disk.cli import main
from taichi_disk.render.colours import GROUND
from taichi_disk.render.film import film_problem
from taichi_disk.runner import run
from taichi_disk.scene_file import load_scene


def test_without_a_display_one_message_names_the_remedy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for display in ("", ":4711"):
        monkeypatch.setenv("DISPLAY", display)
        assert main(["view"]) == 1
        assert "xvfb-run" in capsys.readouterr().err


TOOLS = [tool for tool in ("Xvfb", "xdotool", "import") if not shutil.which(tool)]
MISSING = f"not installed: {', '.join(TOOLS)} (apt-get install xvfb xdotool imagemagick)" if TOOLS else film_problem()
ETA_SLIDER = (8, 53)  # left end and height of its middle in the window [px]


class Hand:
    """Keys and mouse on a window `number` of an X display."""

    def __init__(self, environment: dict[str, str]) -> None:
        self._environment = environment

    def __call__(self, *words: object) -> str:
        command = ["xdotool", *map(str, words)]
        return subprocess.run(command, env=self._environment, capture_output=True, text=True, check=True).stdout

    def key(self, name: str) -> None:
        # GGUI looks at the keys once per picture.
        self("keydown", name)
        time.sleep(0.25)
        self("keyup", name)
        time.sleep(0.3)

    def screenshot(self, path: Path) -> np.ndarray:
        subprocess.run(["import", "-window", "root", path], env=self._environment, check=True)
        return np.asarray(Image.open(path).convert("RGB")).astype(int)


@pytest.fixture
def display() -> Iterator[dict[str, str]]:
    if MISSING:
        if os.environ.get("CI"):
            pytest.fail(f"the window cannot be tested: {MISSING}")
        pytest.skip(f"the window is not tested: {MISSING}")
    read, write = os.pipe()
    command = ["Xvfb", "-displayfd", str(write), "-screen", "0", "1400x1000x24", "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as answer:
        number = answer.readline().strip()
    yield {**os.environ, "DISPLAY": f":{number}", "PYTHONPATH": str(Path(__file__).parents[1])}
    server.terminate()
    server.wait()


def ask_to_close(display: str, window: int) -> None:
    """What a window manager sends when the cross in a window's corner is pressed."""

    class Message(ctypes.Structure):
        _fields_ = (
            ("type", ctypes.c_int),
            ("serial", ctypes.c_ulong),
            ("sent", ctypes.c_int),
            ("display", ctypes.c_void_p),
            ("window", ctypes.c_ulong),
            ("kind", ctypes.c_ulong),
            ("format", ctypes.c_int),
            ("data", ctypes.c_long * 5),
            ("rest_of_an_event", ctypes.c_long * 16),
        )

    x11 = ctypes.CDLL("libX11.so.6")
    x11.XOpenDisplay.restype = ctypes.c_void_p
    x11.XInternAtom.restype = ctypes.c_ulong
    there = ctypes.c_void_p(x11.XOpenDisplay(display.encode()))
    kind, close = (x11.XInternAtom(there, name, 0) for name in (b"WM_PROTOCOLS", b"WM_DELETE_WINDOW"))
    client_message = 33
    message = Message(type=client_message, window=window, kind=kind, format=32)
    message.data[0] = close
    x11.XSendEvent(there, ctypes.c_ulong(window), 0, ctypes.c_long(0), ctypes.byref(message))
    x11.XCloseDisplay(there)


def wait_for(path: Path) -> Path:
    for _ in range(300):
        if path.exists():
            return path
        time.sleep(0.1)
    raise AssertionError(f"{path.name} does not come")


def box_of_the_disk(picture: np.ndarray, bottom: float) -> np.ndarray:
    """Left, right, top, bottom of what is drawn above the row `bottom` [px]."""
    amount = np.abs(picture[: int(bottom)].astype(int) - 255 * np.array(GROUND)).sum(axis=-1)
    rows, columns = np.nonzero(amount > 60)
    return np.array([columns.min(), columns.max() + 1, rows.min(), rows.max() + 1])


@pytest.mark.validate
def test_an_open_window_can_be_watched(display: dict[str, str], tmp_path: Path) -> None:
    watch = "from taichi_disk.benchmark.window import watch; "
    watch += "one = watch('exponential_wall', ['lattice.points=120'], 0.5, 2.0); "
    watch += "print(sum(one.seconds), len(one.seconds), one.steps, one.pace)"
    done = subprocess.run([sys.executable, "-c", watch], env=display, cwd=tmp_path, capture_output=True, text=True)
    seconds, pictures, steps, pace = map(float, done.stdout.split())
    assert 1.5 < seconds < 4.0 and pictures > 5 and steps > 10 and 0.1 < pace < 1.2
    assert not list(tmp_path.rglob("imgui.ini"))


def test_the_window_opens_obeys_and_shows_the_disk_where_it_is(display: dict[str, str], tmp_path: Path) -> None:
    hand, out = Hand(display), tmp_path / "out"
    command = [sys.executable, "-m", "taichi_disk", "view", "--out", str(out)]
    for override in ("lattice.points=300", "impact.velocity=0.05", "material.eta_star=1"):
        command += ["--set", override]
    program = subprocess.Popen(command, env=display, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    try:
        window = hand("search", "--sync", "--name", "taichi-disk view").split()[-1]
        # The first picture that is written says that keys are heard.
        for _ in range(40):
            hand.key("p")
            if (out / "view-1.png").exists():
                break
        hand.key("Right")  # a little faster
        left, row = ETA_SLIDER
        hand("mousemove", "--window", window, left + 60, row, "mousedown", 1)
        time.sleep(0.3)
        hand("mousemove", "--window", window, left + 140, row)
        time.sleep(0.5)
        hand("mouseup", 1)
        time.sleep(0.3)
        hand.key("r")
        time.sleep(1.0)
        hand.key("space")
        known = len(list(out.glob("*.png")))
        hand.key("p")
        shot = wait_for(out / f"view-{known + 1}.png")
        hand.key("w")
        saved = wait_for(out / "view-1.yaml")
        screen = hand.screenshot(tmp_path / "screen.png")

        # The slider: its middle is log10 eta* = 1, its ends are -1 and 3.
        scene = load_scene(saved)
        assert 1.2 < np.log10(scene.material.eta_star) < 2.1

        # The disk is where the state says it is, in the picture and on the screen.
        with Image.open(shot) as image:
            facts, picture = image.text, np.asarray(image)  # type: ignore[attr-defined]
        assert facts["changed by hand"] == "False"
        words = facts["pixels"].replace(",", "").split()
        centre, scale = np.array([float(words[4]), float(words[5])]), float(words[6])
        lowest = centre[1] + (float(facts["com_y"]) - float(facts["lowest_y"])) * scale
        disk = box_of_the_disk(picture, lowest + 3)
        expected = [centre[0] - scale, centre[0] + scale, centre[1] - scale, lowest]
        # 0.02 R: the disk's deformation and its centre of mass beside its middle.
        assert np.abs(disk - expected).max() < 0.02 * scale + 3
        corner = dict(line.split("=") for line in hand("getwindowgeometry", "--shell", window).split())
        x, y = int(corner["X"]) + 330, int(corner["Y"])
        there = screen[y : y + picture.shape[0], x : x + picture.shape[1]]
        assert np.abs(box_of_the_disk(there, lowest + 3) - disk).max() <= 2

        # The slider's value reached the kernel: run's numbers at that viscosity are those of the window.
        run(scene, tmp_path / "run", video=False)
        table = np.genfromtxt(tmp_path / "run" / "timeseries.csv", delimiter=",", names=True)
        for name in ("com_vy", "dissipated"):
            value = np.interp(float(facts["t"]), table["t"], table[name])
            assert value == pytest.approx(float(facts[name]), abs=2e-3 * np.abs(table[name]).max())

        hand.key("space")
        hand.key("v")
        time.sleep(1.0)
        hand.key("h")
        hand.key("v")
        film = iio.imread(wait_for(out / "view-1.mp4"))
        assert len(film) >= 20 and film.shape[1:3] == (picture.shape[0], picture.shape[1])

        # Another scene is compiled and shown; a drag in flight turns the disk; a film goes on in a window of any size.
        hand.key("u")
        hand("windowsize", window, 700, 500)
        time.sleep(1.0)
        hand("mousemove", "--window", window, 500, 150, "mousedown", 1)
        time.sleep(0.3)
        hand("mousemove", "--window", window, 600, 100)
        time.sleep(0.3)
        hand("mouseup", 1)
        known = len(list(out.glob("*.png")))
        hand.key("p")
        with Image.open(wait_for(out / f"view-{known + 1}.png")) as image:
            facts = image.text  # type: ignore[attr-defined]
        assert facts["scene"].startswith("scene: absorbing_wall") and facts["changed by hand"] == "True"
        assert image.height == 500
        hand.key("v")
        time.sleep(1.0)
        ask_to_close(display["DISPLAY"], int(window))
        assert program.wait(20) == 0, program.stderr.read() if program.stderr else ""
        assert len(iio.imread(out / "view-2.mp4")) > 5
        assert not list(tmp_path.rglob("imgui.ini"))
    finally:
        if program.poll() is None:
            program.kill()
            program.wait()
