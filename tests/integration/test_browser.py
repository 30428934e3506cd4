"""The page in a browser: who may come, what may be said, and the real one, played with in Chromium."""

from __future__ import annotations

import asyncio
import io
import json
import os
import random
import re
import shutil
import signal
import socket
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from PIL import Image

from taichi_disk.cli import main
from taichi_disk.computation.outcome import compute
from taichi_disk.render import film_problem
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.browser import Page, understood

TOOLS = [tool for tool in ("chromium", "chromedriver") if not shutil.which(tool)]
MISSING = f"not installed: {', '.join(TOOLS)} (apt-get install chromium chromium-driver)" if TOOLS else film_problem()
SETTINGS = ["lattice.points=300", "impact.velocity=0.05", "material.eta_star=1"]
HOST = (b"host", b"127.0.0.1:1")


# ---- the door, without a server


class Inside:
    """What stands behind the door: it says where it was reached, and hears what pages say."""

    def __init__(self) -> None:
        self.heard: list[dict[str, Any]] = []

    async def __call__(self, scope: dict[str, Any], receive: Any, send: Any) -> None:
        await send({"type": "inside"})
        while scope["type"] == "websocket" and (event := await receive())["type"] == "websocket.receive":
            self.heard.append(json.loads(event["text"]))

    def get_count(self) -> int:
        return 0


def knock(page: Page, path: str, *headers: tuple[bytes, bytes], said: list[Any] | None = None) -> list[dict[str, Any]]:
    """Ask for a path, or say something through a websocket; what comes back."""
    answers: list[dict[str, Any]] = []
    events = [{"type": "websocket.receive", **one} for one in said or []] + [{"type": "websocket.disconnect"}]

    async def send(message: dict[str, Any]) -> None:
        answers.append(message)

    async def receive() -> dict[str, Any]:
        return events.pop(0)

    kind = "http" if said is None else "websocket"
    asyncio.run(page({"type": kind, "path": path, "headers": list(headers)}, receive, send))
    return answers


@pytest.fixture
def page(tmp_path: Path) -> Page:
    done: list[str] = []
    session: Any = SimpleNamespace(
        controls=SimpleNamespace(out=tmp_path), done=done, let_go=lambda pause: done.append(pause)
    )
    return Page(Inside(), session, "secret")


@pytest.mark.parametrize(
    "path", ["/", "/secre/", "/secret2/", "/SECRET/", "//secret/", "/ü/", "/files", "/favicon.ico"]
)
def test_without_the_token_there_is_nothing(page: Page, path: str) -> None:
    assert knock(page, path)[0]["status"] == 403
    assert knock(page, path, HOST, (b"origin", b"http://127.0.0.1:1"), said=[]) == [
        {"type": "websocket.close", "code": 1008}
    ]


@pytest.mark.parametrize(
    ("origin", "comes"),
    [(b"http://127.0.0.1:1", True), (b"http://evil.example", False), (b"http://127.0.0.1:12", False), (b"null", False)],
)
def test_a_websocket_is_for_the_own_page_alone(page: Page, origin: bytes, comes: bool) -> None:
    answers = knock(page, "/secret/", HOST, (b"origin", origin), said=[])
    assert answers == ([{"type": "inside"}] if comes else [{"type": "websocket.close", "code": 1008}])
    assert page._session.done == [True] * comes  # type: ignore[attr-defined]
    assert knock(page, "/secret/", HOST, said=[])[0]["type"] == "websocket.close"


def test_a_page_is_given_files_that_were_written_here_and_no_others(page: Page, tmp_path: Path) -> None:
    (tmp_path / "view-1.yaml").write_text("scene: a\n")
    (tmp_path / "other.yaml").write_text("not yours")
    (tmp_path / "view-2.mp4").write_bytes(b"old")
    os.utime(tmp_path / "view-2.mp4", (0, 0))
    (tmp_path.parent / "view-3.yaml").write_text("elsewhere")
    assert knock(page, "/secret/files")[1]["body"] == b'<a href="view-1.yaml" download>view-1.yaml</a>'
    start, body = knock(page, "/secret/view-1.yaml")
    assert (
        body["body"] == b"scene: a\n"
        and (b"content-disposition", b"attachment; filename=view-1.yaml") in start["headers"]
    )
    for name in ("other.yaml", "../view-3.yaml", "view-3.yaml", "view-1.yaml/", "%2e%2e/view-3.yaml", "view-١.yaml"):
        assert knock(page, f"/secret/{name}") == [{"type": "inside"}]  # where there is no such thing
    assert dict(knock(page, "/secret")[0]["headers"])[b"location"] == b"/secret/"


def test_messages_that_no_page_sends_are_ignored_and_counted(page: Page) -> None:
    move = {"type": "pointer_move", "x": 3, "y": 4.5, "button": 1, "buttons": [1], "timestamp": 7.0}
    bad = [
        "",
        "{",
        "[1]",
        "null",
        "[" * 50_000,
        json.dumps({"type": "close"}),
        json.dumps({"type": "_clients_change", "ids": [9]}),
        json.dumps({"type": ["key_down"]}),
        json.dumps(move | {"x": float("nan")}),
        json.dumps(move | {"x": float("inf")}),
        json.dumps(move | {"y": None}),
        json.dumps(move | {"y": 1e9}),
        json.dumps(move).replace("4.5", "1" + 400 * "0"),
        json.dumps({"type": "resize", "pwidth": 1e9, "pheight": 10, "ratio": 1}),
        json.dumps({"type": "resize", "pwidth": 10, "pheight": -10, "ratio": 1}),
        json.dumps({"type": "key_down", "key": "a", "modifiers": 4}),
        json.dumps({"type": "wheel", "x": 1, "y": 1}),
    ]
    good = [json.dumps(move), json.dumps({"type": "hide"}), json.dumps({"type": "key_up", "key": "a", "modifiers": []})]
    said = [{"text": one} for one in (*bad, *good)] + [{"bytes": b"\0"}]
    random.Random(1).shuffle(said)
    knock(page, "/secret/", HOST, (b"origin", b"http://127.0.0.1:1"), said=said)
    assert page.ignored == len(bad) + 1
    heard = sorted(page._asgi.heard, key=str)
    assert heard[0] == {"type": "key_up", "timestamp": 0.0, "key": "a", "modifiers": []}
    assert heard[1] == {"type": "pointer_move", "timestamp": 0.0, "x": 3.0, "y": 4.5} and len(heard) == 2


def test_no_message_makes_an_error() -> None:
    words = random.Random(2)
    values = [None, True, -1, 1e300, "x", "", [], {}, [1], {"x": 1}, float("nan"), "\ud800", 2**70]
    names = [
        "type",
        "x",
        "y",
        "button",
        "key",
        "modifiers",
        "pwidth",
        "pheight",
        "ratio",
        "index",
        "timestamp",
        "dx",
        "dy",
    ]
    kinds = ["pointer_down", "key_down", "resize", "wheel", "_framefeedback", "char", "focus_out", "?", 5]
    known = 0
    for _ in range(5000):
        message = {name: words.choice(values) for name in words.sample(names, words.randrange(len(names)))}
        known += understood(json.dumps(message | {"type": words.choice(kinds)})) is not None
        understood(json.dumps(message)[: words.randrange(60)])
    assert 0 < known < 5000


def test_a_port_that_is_taken_is_told(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert main(["view", "--set", "lattice.points=60", "--port", port, "--out", str(tmp_path)]) == 1
    assert f"port {port}" in (said := capsys.readouterr().err) and "--port" in said


# ---- the real one


class Visitor:
    """A browser at the page."""

    def __init__(self, url: str, size: tuple[int, int] = (1400, 900)) -> None:
        from selenium import webdriver
        from selenium.webdriver.chrome.service import Service

        options = webdriver.ChromeOptions()
        for one in ("--headless=new", "--no-sandbox", "--disable-dev-shm-usage"):
            options.add_argument(one)
        options.binary_location = shutil.which("chromium")
        self.driver = webdriver.Chrome(options, Service(shutil.which("chromedriver")))
        self.resize(size)
        self.url = url
        self.driver.get(url)
        self.wait(lambda: self.script("return document.querySelector('#canvas img')?.naturalWidth > 700"))
        time.sleep(1.0)

    def script(self, code: str) -> Any:
        return self.driver.execute_script(code)

    def resize(self, size: tuple[int, int]) -> None:
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": size[0], "height": size[1], "deviceScaleFactor": 1, "mobile": False},
        )

    @staticmethod
    def wait(until: Any, seconds: float = 30.0) -> Any:
        end = time.monotonic() + seconds
        while not (found := until()):
            assert time.monotonic() < end, "it does not come to that"
            time.sleep(0.1)
        return found

    def key(self, name: str, seconds: float = 0.05) -> None:
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.driver).key_down(name).pause(seconds).key_up(name).perform()

    def drag(self, start: tuple[int, int], end: tuple[int, int], touch: bool = False) -> None:
        from selenium.webdriver.common.actions.action_builder import ActionBuilder
        from selenium.webdriver.common.actions.pointer_input import PointerInput

        builder = ActionBuilder(self.driver, mouse=PointerInput(*(("touch", "finger") if touch else ("mouse", "hand"))))
        pointer = builder.pointer_action
        pointer.move_to_location(*start).pointer_down().pause(0.3).move_to_location(*end).pause(0.5).pointer_up()
        builder.perform()
        time.sleep(0.5)

    def screen(self, path: Path | None = None) -> np.ndarray:
        """(rows, columns, 3) as it is seen."""
        data = self.driver.get_screenshot_as_png()
        if path:
            path.write_bytes(data)
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB")).astype(int)

    def errors(self) -> list[Any]:
        return [one for one in self.driver.get_log("browser") if one["level"] == "SEVERE"]


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str, Path]]:
    """The program, its address, and the folder of its files."""
    if MISSING:
        if os.environ.get("CI"):
            pytest.fail(f"the page cannot be tested: {MISSING}")
        pytest.skip(f"the page is not tested: {MISSING}")
    environment = {name: value for name, value in os.environ.items() if name != "DISPLAY"}
    environment["PYTHONPATH"] = str(Path(__file__).parents[2])
    command = [sys.executable, "-m", "taichi_disk", "view", "--out", str(tmp_path / "out")]
    command += [word for setting in SETTINGS for word in ("--set", setting)]
    pipes: dict[str, Any] = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    program = subprocess.Popen(command, env=environment, cwd=tmp_path, **pipes)
    assert program.stdout
    try:
        found = re.search(r"http://\S+/", program.stdout.readline())
        assert found
        yield program, found[0], tmp_path / "out"
    finally:
        program.kill()
        program.wait()


def numbers_in(file: Path) -> dict[str, float]:
    with Image.open(file) as image:
        words = dict(image.text)  # type: ignore[attr-defined]
    return {name: float(words[name]) for name in words if name not in ("scene", "changed by hand")}


@pytest.mark.validate
def test_the_page_opens_obeys_and_computes_what_run_does(
    served: tuple[subprocess.Popen[str], str, Path], tmp_path: Path, kernels: KernelCache
) -> None:
    program, url, out = served
    visitor = Visitor(url)
    with pytest.raises(urllib.error.HTTPError, match="403"):
        urllib.request.urlopen(url.rsplit("/", 2)[0] + "/wrong-token/")
    try:
        # A picture in many colours, as large as the page.
        shown = visitor.screen(tmp_path / "start.png")
        assert shown.shape == (900, 1400, 3) and len(np.unique(shown.reshape(-1, 3), axis=0)) > 300

        def saved() -> Any:
            number = len(list(out.glob("*.yaml"))) + 1
            visitor.key("w")
            return load_scene(visitor.wait(lambda: (file := out / f"view-{number}.yaml").exists() and file))

        # The slider sets the viscosity, by mouse and by finger; a drag turns the disk.
        visitor.drag((25, 60), (60, 60))
        assert 10.0 < saved().material.eta_star < 60.0
        visitor.drag((60, 60), (40, 60), touch=True)
        assert 10.0 < saved().material.eta_star < 35.0
        visitor.drag((850, 200), (950, 260))
        scene = saved()
        assert 0.1 < abs(scene.impact.turn) < 3.0

        # The button drops the disk; it comes to the end that `run` computes.
        visitor.drag((50, 240), (50, 240))
        outcome = compute(scene.scenario(), scene.time, kernels=kernels)

        def pictured() -> dict[str, float]:
            number = len(list(out.glob("*.png"))) + 1
            visitor.key("p")
            return numbers_in(visitor.wait(lambda: (file := out / f"view-{number}.png").exists() and file))

        last = {name: values[-1] for name, values in outcome.columns.items()}
        ended = visitor.wait(lambda: (now := pictured())["t"] > last["t"] - 1e-9 and now, 60.0)
        assert [ended[name] for name in ("com_vy", "wall")] == [last[name] for name in ("com_vy", "wall")]
        end = numbers_in(max(out.glob("*.png"), key=lambda file: file.stat().st_mtime))["t"]
        visitor.screen(tmp_path / "end.png")

        # Back in time, by the graph and by a held key; the page offers what was written.
        links = visitor.wait(
            lambda: visitor.script("return [...document.querySelectorAll('#files a')].map(a => a.href)")
        )
        data = urllib.request.urlopen(links[0]).read()
        assert data == (out / links[0].rsplit("/", 1)[1]).read_bytes()
        height = visitor.script("return document.getElementById('canvas').clientHeight")
        visitor.drag((400, height - 80), (500, height - 80))
        there = pictured()["t"]
        assert 0.0 < there < 0.95 * end
        visitor.key("\ue012", 1.5)  # the left arrow
        assert pictured()["t"] < there

        # The page gets another size, a film is made, a second visitor watches.
        visitor.key("r")
        visitor.resize((800, 700))
        visitor.wait(lambda: visitor.script("return document.querySelector('#canvas img').naturalWidth") == 800)
        visitor.key("v")
        visitor.key(" ")
        time.sleep(1.5)
        visitor.key("v")
        visitor.wait(lambda: (out / "view-1.mp4").exists())
        visitor.screen(tmp_path / "narrow.png")
        watcher = Visitor(url, (800, 700))
        try:
            assert "watching" in watcher.script("return document.getElementById('state').textContent")
            watcher.key("n")
            visitor.driver.quit()  # who watched plays now
            watcher.wait(lambda: watcher.script("return document.getElementById('state').hidden"))
            assert watcher.errors() == []
        finally:
            watcher.driver.quit()
    finally:
        visitor.driver.quit()
    program.send_signal(signal.SIGTERM)
    said = program.communicate(timeout=20)[1]
    assert program.returncode == 130 and "Traceback" not in said and "ignored" not in said
    assert not list(tmp_path.rglob("imgui.ini"))


@pytest.mark.validate
def test_a_closed_tab_pauses_and_foreign_sockets_stay_out(served: tuple[subprocess.Popen[str], str, Path]) -> None:
    from websockets.exceptions import InvalidStatus
    from websockets.sync.client import connect

    _, url, out = served
    address = url.replace("http", "ws")
    own = url.rsplit("/", 2)[0]
    for where, origin in ((address, "http://evil.example"), (address[:-3] + "/", own), (address, None)):
        with pytest.raises(InvalidStatus) as refused:
            connect(where, origin=origin)  # type: ignore[arg-type]
        assert refused.value.response.status_code == 403

    def say(socket: Any, *keys: str) -> None:
        for key in keys:
            socket.send(json.dumps({"type": "key_down", "key": key, "modifiers": []}))
            socket.send(json.dumps({"type": "key_up", "key": key, "modifiers": []}))

    def look(socket: Any, seconds: float) -> None:
        """As a page does: confirm pictures."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            try:
                message = socket.recv(timeout=0.2)
            except TimeoutError:
                continue
            if isinstance(message, str) and (told := json.loads(message)).get("index"):
                socket.send(json.dumps({"type": "_framefeedback", "index": told["index"], "timestamp": 0}))

    times = []
    for keys in ((" ",), ("p",), ("p",)):
        with connect(address, origin=own) as socket:  # type: ignore[arg-type]
            socket.send(json.dumps({"type": "resize", "pwidth": 900, "pheight": 700, "ratio": 1}))
            look(socket, 0.5)
            say(socket, *keys)
            look(socket, 1.0)
        time.sleep(1.0)
        times += [numbers_in(file)["t"] for file in out.glob(f"view-{len(times) + 1}.png")]
    assert len(times) == 2 and times[0] == times[1] > 0.1


@pytest.mark.validate
def test_two_minutes_of_anything_leave_the_page_alive(served: tuple[subprocess.Popen[str], str, Path]) -> None:
    from selenium.webdriver.common.actions.action_builder import ActionBuilder
    from selenium.webdriver.common.actions.pointer_input import PointerInput

    program, url, out = served
    visitor, choose = Visitor(url, (1000, 760)), random.Random(3)
    keys = [*"rhbnwlxedazjksfycotiugpv ", *"\ue003\ue004\ue006\ue00c\ue012\ue013\ue014\ue015", "?", "5"]
    try:
        end = time.monotonic() + 120.0
        while time.monotonic() < end:
            what = choose.random()
            place = choose.randrange(1, 990), choose.randrange(1, 600)
            if what < 0.4:
                visitor.key(choose.choice(keys), choose.choice([0.02, 0.5]))
            elif what < 0.8:
                button = choose.choice([0, 0, 2])
                builder = ActionBuilder(visitor.driver, mouse=PointerInput("mouse", "mouse"))
                builder.pointer_action.move_to_location(*place).pointer_down(button=button)
                builder.pointer_action.move_to_location(choose.randrange(990), choose.randrange(600)).pointer_up(
                    button=button
                )
                builder.perform()
            elif what < 0.85:
                visitor.resize((choose.randrange(200, 1600), choose.randrange(200, 1100)))
                time.sleep(0.3)
                visitor.resize((1000, 760))
                time.sleep(0.3)
            elif what < 0.9:
                visitor.script('window.websocket.send(\'{"type": "pointer_move", "x": null}\')')
            else:
                from selenium.webdriver.common.action_chains import ActionChains

                ActionChains(visitor.driver).scroll_by_amount(0, choose.choice([-120, 120])).perform()
            assert program.poll() is None
        number = len(list(out.glob("*.png")))
        visitor.key("p")
        visitor.wait(lambda: len(list(out.glob("*.png"))) > number)
        assert visitor.errors() == []
    finally:
        visitor.driver.quit()
    program.send_signal(signal.SIGINT)
    said = program.communicate(timeout=30)[1]
    assert program.returncode == 130 and "Traceback" not in said
    assert re.search(r"\d+ messages that no page sends were ignored", said)
