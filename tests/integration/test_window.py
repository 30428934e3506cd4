"""The real window, opened on a virtual screen, used with mouse and keys, and looked at."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import imageio.v3 as iio
import numpy as np
import pytest
from PIL import Image, ImageDraw

from taichi_disk.cli import main
from taichi_disk.computation.outcome import compute
from taichi_disk.render import film_problem, legend
from taichi_disk.render.palette import THEMES
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.overlay import Overlay
from taichi_disk.window.scene_view import PANEL, SIZE

TOOLS = [tool for tool in ("Xvfb", "xdotool", "import") if not shutil.which(tool)]
MISSING = f"not installed: {', '.join(TOOLS)} (apt-get install xvfb xdotool imagemagick)" if TOOLS else film_problem()
ETA, DROP, DISK = (38, 60), (50, 236), (720, 200)  # the first slider and button, a place in the disk [px]
BESIDE = (1120, 330)
SETTINGS = ["lattice.points=300", "impact.velocity=0.05", "material.eta_star=1"]
GROUND = 255 * np.array(THEMES["light"].ground)


@pytest.mark.parametrize(("name", "told"), [("", "DISPLAY is not set"), (":4711", ":4711 does not answer")])
def test_without_a_display_one_message_names_the_remedy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], name: str, told: str
) -> None:
    monkeypatch.setenv("DISPLAY", name)
    monkeypatch.setitem(sys.modules, "rendercanvas", None)  # the extra is not installed
    assert main(["view"]) == 1
    said = capsys.readouterr().err
    assert told in said and "xvfb-run" in said and "taichi-disk[browser]" in said


@pytest.mark.parametrize("line", ["v_cm / v  ξ elastic", "run 1 2"])
def test_letters_are_boxes_that_cover_what_pillow_sets(line: str) -> None:
    sheet, (width, height) = Overlay((255, 255, 255)), (200, 40)
    expected = Image.new("RGB", (width, height), (255, 255, 255))
    for draw in (sheet, ImageDraw.Draw(expected)):
        legend.draw_line(draw, (10, 30), line, 13.0, (0, 0, 0))
    picture = np.ones((height, width))
    for corners in sheet.vertices(width, height).reshape(-1, 6, 12):
        columns, rows = np.rint(corners[:, 0] * width).astype(int), np.rint((1.0 - corners[:, 1]) * height).astype(int)
        picture[rows.min() : rows.max(), columns.min() : columns.max()] = corners[0, 8]
    off = np.abs(picture - np.asarray(expected)[..., 0] / 255.0)
    assert off.max() <= 0.26 and picture.min() == 0.0  # three shades


class Hand:
    """Keys and mouse on the window of a running program, and the files that it writes into `out`."""

    def __init__(self, environment: dict[str, str], out: Path) -> None:
        self._environment, self._out, self._pause = environment, out, 0.3
        self.window = self("search", "--sync", "--name", "taichi-disk view").split()[-1]
        self("windowfocus", self.window)
        for _ in range(60):  # the first picture that is written says that keys are heard
            self.key("p")
            if (out / "view-1.png").exists():
                break
        began = time.monotonic()
        self.picture()
        self._pause = 0.5 * (time.monotonic() - began)  # a slow machine draws few pictures

    def __call__(self, *words: object) -> str:
        command = ["xdotool", *map(str, words)]
        return subprocess.run(command, env=self._environment, capture_output=True, text=True, check=True).stdout

    def key(self, name: str, seconds: float = 0.0) -> None:
        # GGUI looks at the keys once per picture.
        self("keydown", name)
        time.sleep(seconds or self._pause)
        self("keyup", name)
        time.sleep(self._pause)

    def drag(self, start: tuple[int, int], end: tuple[int, int]) -> None:
        self("mousemove", "--window", self.window, *start, "mousedown", 1)
        time.sleep(self._pause)
        self("mousemove", "--window", self.window, *end)
        time.sleep(2 * self._pause)
        self("mouseup", 1)
        time.sleep(2 * self._pause)

    def screen(self, path: Path) -> np.ndarray:
        """(rows, columns, 3) of the window as it is seen."""
        subprocess.run(["import", "-window", self.window, path], env=self._environment, check=True)
        return np.asarray(Image.open(path).convert("RGB")).astype(int)

    def file(self, name: str) -> Path:
        for _ in range(300):
            if (self._out / name).exists():
                return self._out / name
            time.sleep(0.1)
        raise AssertionError(f"{name} does not come")

    def picture(
        self, until: Callable[[dict[str, float]], bool] = lambda numbers: True
    ) -> tuple[dict[str, str], dict[str, float], np.ndarray]:
        """A picture that the window writes, the words and the numbers that it carries; the first that are `until`."""
        for _ in range(60):
            number = len(list(self._out.glob("*.png"))) + 1
            self.key("p")
            with Image.open(self.file(f"view-{number}.png")) as image:
                words, shown = dict(image.text), np.asarray(image).astype(int)  # type: ignore[attr-defined]
            numbers = {name: float(words[name]) for name in words if name not in ("scene", "changed by hand")}
            if until(numbers):
                return words, numbers, shown
        raise AssertionError("it does not come to that")


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
    yield {**os.environ, "DISPLAY": f":{number}", "PYTHONPATH": str(Path(__file__).parents[2])}
    server.terminate()
    server.wait()


@pytest.mark.validate
def test_the_window_opens_obeys_and_shows_the_disk_where_it_is(
    display: dict[str, str], tmp_path: Path, kernels: KernelCache
) -> None:
    command = [sys.executable, "-m", "taichi_disk", "view", "--out", str(tmp_path / "out")]
    command += [word for setting in SETTINGS for word in ("--set", setting)]
    program = subprocess.Popen(command, env=display, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    try:
        hand = Hand(display, tmp_path / "out")
        words, numbers, _ = hand.picture()
        scene = load_scene("exponential_wall", SETTINGS)
        assert numbers["t"] == 0.0 and words["changed by hand"] == "False"  # it starts paused

        # The slider shows the viscosity itself and reaches the kernel; a drag turns the disk, and the scene with it.
        hand.drag((ETA[0] - 8, ETA[1]), ETA)
        hand.key("w")
        assert 5.0 < load_scene(hand.file("view-1.yaml")).material.eta_star < 40.0
        hand.drag(DISK, (DISK[0] + 100, DISK[1] + 50))
        hand.key("w")
        scene = load_scene(hand.file("view-2.yaml"))
        assert 0.1 < abs(scene.impact.turn) < 3.0  # type: ignore[union-attr]
        hand.drag(BESIDE, (BESIDE[0] + 60, BESIDE[1] + 120))  # from beside the disk it aims
        hand.key("w")
        scene = load_scene(hand.file("view-3.yaml"))
        assert scene.impact.angle == pytest.approx(np.arctan2(60, 120), abs=0.02)  # type: ignore[union-attr]

        # The impact, filmed and to its end.
        hand.screen(tmp_path / "start.png")
        hand.drag(DROP, DROP)
        hand.key("v")
        time.sleep(1.0)
        hand.key("v")
        film = iio.imread(hand.file("view-1.mp4"))
        assert len(film) >= 20 and film.shape[1:3] == (SIZE[1], SIZE[0] - PANEL)
        inked = np.abs(film[-1].astype(int) - GROUND).sum(axis=-1) > 100
        for part in (inked[10:74, :400], inked[10:74, 840:], inked[614:680, 330:660], inked[690:850, :900]):
            assert part.mean() > 0.005  # title, time, colour bar, graphs
        outcome = compute(scene.scenario(), scene.time, kernels=kernels)
        last = {name: values[-1] for name, values in outcome.columns.items()}
        _, numbers, _ = hand.picture(lambda numbers: numbers["t"] > last["t"] - 1e-9)
        assert [numbers[name] for name in ("com_vy", "wall")] == [last[name] for name in ("com_vy", "wall")]

        # Back in time, on a graph and by a held key.
        end = numbers["t"]
        hand.drag((PANEL + 100, 780), (PANEL + 180, 780))
        there = hand.picture()[1]["t"]
        assert 0.1 * end < there < 0.9 * end
        hand.key("Left", 1.0)
        _, numbers, _ = hand.picture()
        assert numbers["t"] < there - 3 * outcome.summary["dt"]
        for name in ("com_vy", "wall_force", "kinetic"):
            value = np.interp(numbers["t"], outcome.columns["t"], outcome.columns[name])
            assert value == pytest.approx(numbers[name], abs=2e-2 * np.abs(outcome.columns[name]).max())

        # A point is pulled from the past on; another scene is compiled and shown in a window of any size.
        hand.drag(DISK, (DISK[0] + 80, DISK[1] - 60))
        assert hand.picture()[0]["changed by hand"] == "True"
        hand.key("n")
        hand.key("n")
        for width, height in ((300, 200), (700, 500)):
            hand("windowsize", hand.window, width, height)
            time.sleep(1.0)
        words, _, shown = hand.picture()
        assert words["scene"].startswith("scene: absorbing_wall") and len(shown) == 500
        hand.key("q")
        assert program.wait(20) == 0, program.stderr.read() if program.stderr else ""
        assert not list(tmp_path.rglob("imgui.ini"))
    finally:
        program.kill()
        program.wait()
