"""The real window, opened on a virtual screen, used with mouse and keys, and looked
at."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from taichi_disk.cli import main
from taichi_disk.render import film_problem
from taichi_disk.render.palette import THEMES
from taichi_disk.scenes import load_scene
from taichi_disk.window.viewer import PANEL_WIDTH

TOOLS = [tool for tool in ("Xvfb", "xdotool", "import") if not shutil.which(tool)]
MISSING = (
    f"not installed: {', '.join(TOOLS)} (apt-get install xvfb xdotool imagemagick)"
    if TOOLS
    else film_problem()
)
SEARCH = ["xdotool", "search", "--onlyvisible", "--name", "taichi-disk view"]
DISK = (790, 250)  # place in the disk [px]
BESIDE = (1180, 330)  # place beside the disk [px]
SETTINGS = ["lattice.points=300", "impact.velocity=0.05", "material.eta_star=1"]
GROUND = 255 * np.array(THEMES["light"].ground)


@pytest.mark.parametrize(
    ("name", "told"), [("", "DISPLAY is not set"), (":4711", ":4711 does not answer")]
)
def test_without_a_display_one_message_names_the_remedy(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    name: str,
    told: str,
) -> None:
    monkeypatch.setenv("DISPLAY", name)
    assert main(["view", "--window"]) == 1
    said = capsys.readouterr().err
    assert told in said
    assert "without --window" in said


class Hand:
    """Keys and mouse on the window of a running program, and the files that it writes
    into `out`."""

    def __init__(
        self, program: subprocess.Popen[str], environment: dict[str, str], out: Path
    ) -> None:
        self._environment = environment
        self._out = out
        self._pause = 0.3
        # `search --sync` may miss a window that opens meanwhile, and waits for ever
        for _ in range(600):
            search = subprocess.run(
                SEARCH, env=environment, capture_output=True, text=True
            )
            windows = search.stdout.split()
            if windows:
                break
            assert program.poll() is None, (
                program.stderr.read() if program.stderr else ""
            )
            time.sleep(0.2)
        self.window = windows[-1]
        self("windowfocus", self.window)
        for _ in range(60):  # the first scene that is saved says that keys are heard
            self.key("w")
            if (out / "view-1.yaml").exists():
                break
        began = time.monotonic()
        self.saved()
        # a slow machine draws few pictures
        self._pause = 0.5 * (time.monotonic() - began)

    def __call__(self, *words: object) -> str:
        command = ["xdotool", *map(str, words)]
        done = subprocess.run(
            command,
            env=self._environment,
            capture_output=True,
            text=True,
            check=True,
            timeout=60,
        )
        return done.stdout

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

    def file(self, kind: str) -> Path:
        """The next file of its kind, which a key writes."""
        number = len(list(self._out.glob(f"*.{kind}"))) + 1
        path = self._out / f"view-{number}.{kind}"
        self.key({"yaml": "w", "png": "p"}[kind])
        for _ in range(300):
            if path.exists():
                return path
            time.sleep(0.1)
        raise AssertionError(f"{path} does not come")

    def saved(self) -> Any:
        """The scene as it is saved now."""
        time.sleep(0.2)
        return load_scene(self.file("yaml"))

    def picture(self) -> np.ndarray:
        """(rows, columns, 3) of a picture that the window writes."""
        path = self.file("png")
        time.sleep(1.0)
        return np.asarray(Image.open(path).convert("RGB")).astype(int)


@pytest.fixture
def display() -> Iterator[dict[str, str]]:
    if MISSING:
        if os.environ.get("CI"):
            pytest.fail(f"the window cannot be tested: {MISSING}")
        pytest.skip(f"the window is not tested: {MISSING}")
    read, write = os.pipe()
    command = [
        "Xvfb",
        "-displayfd",
        str(write),
        "-screen",
        "0",
        "1400x1000x24",
        "-nolisten",
        "tcp",
        "-noreset",
    ]
    server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    with os.fdopen(read) as answer:
        number = answer.readline().strip()
    yield {
        **os.environ,
        "DISPLAY": f":{number}",
        "PYTHONPATH": str(Path(__file__).parents[2]),
    }
    server.terminate()
    server.wait()


@pytest.mark.validate
def test_the_window_opens_obeys_and_shows_the_disk(
    display: dict[str, str], tmp_path: Path
) -> None:
    command = [
        sys.executable,
        "-m",
        "taichi_disk",
        "view",
        "--window",
        "--out",
        str(tmp_path / "out"),
    ]
    command += [word for setting in SETTINGS for word in ("--set", setting)]
    program = subprocess.Popen(
        command, env=display, cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    try:
        hand = Hand(program, display, tmp_path / "out")
        # Keys change the scene; a drag turns the disk, and one from beside it aims.
        before = hand.saved().wall.a
        hand.key("z")
        assert hand.saved().wall.a < before
        hand.drag(DISK, (DISK[0] + 100, DISK[1] + 50))
        assert 0.1 < abs(hand.saved().impact.turn) < 3.0
        hand.drag(BESIDE, (BESIDE[0] + 60, BESIDE[1] + 120))
        assert hand.saved().impact.angle == pytest.approx(np.arctan2(60, 120), abs=0.05)
        shown = hand.picture()
        inked = np.abs(shown - GROUND).sum(axis=-1) > 100
        # outline, springs and wall; widgets are not in a picture
        assert 0.05 < inked[:, PANEL_WIDTH:].mean() < 0.95

        # The disk falls, comes back in time, and is pulled; another scene, another size
        # of the window.
        hand.key("space")
        time.sleep(2.0)
        hand.key("space")
        assert np.abs(hand.picture() - shown)[:, PANEL_WIDTH:].max() > 100
        hand.key("Left", 1.0)
        hand.drag(DISK, (DISK[0] + 80, DISK[1] - 60))
        for key in (
            "n",
            "n",
            "c",
            "o",
            "t",
            "i",
            "u",
            "g",
            "Return",
            "BackSpace",
            "Tab",
        ):
            hand.key(key)
        for width, height in ((300, 200), (700, 500)):
            hand("windowsize", hand.window, width, height)
            time.sleep(1.0)
        assert hand.saved().impact.spin == 0.4  # Backspin, the second of the list
        assert hand.picture().shape[:2] == (500, 700)
        hand.key("q")
        assert program.wait(20) == 0, program.stderr.read() if program.stderr else ""
        assert not list(tmp_path.rglob("imgui.ini"))
    finally:
        program.kill()
        program.wait()
