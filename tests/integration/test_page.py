"""The page: who may come, what may be said, how fast states are sent; and the real one,
played with in Chromium."""

from __future__ import annotations

import asyncio
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
from collections.abc import Awaitable, Callable, Iterator
from contextlib import contextmanager
from functools import partial
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from taichi_disk.cli import main
from taichi_disk.computation.outcome import compute
from taichi_disk.errors import InputError
from taichi_disk.render.palette import full_scale
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.observables import INDEX
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.web.drawing import colour_values
from taichi_disk.window.app import list_folder, list_presets
from taichi_disk.window.audience import Audience, Full
from taichi_disk.window.controls import CHOICES, RANGES, Preset
from taichi_disk.window.graphs import CURVES
from taichi_disk.window.session import HEADER, Common, Session, read_command
from tests.browser import BROWSERS, MISSING_BROWSERS, Browser

WEB = Path(__file__).parents[2] / "taichi_disk" / "web"
SETTINGS = ["lattice.points=120", "impact.velocity=0.05", "material.eta_star=1"]
WALL = [
    "lattice.points=120",
    "impact.velocity=0.05",
    "wall.points=160",
    "wall.threshold=0.11",
]


@pytest.fixture
def common(kernels: KernelCache) -> Common:
    scenes = [
        ("exponential_wall", SETTINGS),
        ("absorbing_wall", WALL),
        ("compression", SETTINGS[:1]),
    ]
    return Common(
        [Preset(name, "Look.", partial(load_scene, name, own)) for name, own in scenes],
        kernels,
    )


@pytest.fixture
def session(common: Common) -> Session:
    return Session(common)


def say(session: Session, kind: str, **more: Any) -> None:
    """As a page does, through the check of messages."""
    message = read_command(json.dumps({"do": kind} | more))
    assert message
    session.hear(message)
    session.advance()


def messages(session: Session) -> dict[str, Any]:
    return session.messages


def panel(session: Session) -> dict[str, Any]:
    return dict(json.loads(messages(session)["panel"]))


# ---- messages


def test_messages_that_no_page_sends_are_ignored_and_counted(common: Common) -> None:
    audience = Audience(common)
    bad = [
        "",
        "{",
        "[1]",
        "null",
        "[" * 1000,
        '{"do": "close"}',
        '{"do": ["press"]}',
        b"\0",
        '{"do": "press"}',
    ]
    for pull in (
        {"x": 1},
        {"x": 1, "y": None},
        {"x": 1, "y": 1e9},
        {"x": 1, "y": float("nan")},
    ):
        bad.append(json.dumps({"do": "pull"} | pull))
    for key, value in (
        ("impact.gap", 1.0),
        ("wall.a", "soft"),
        ("video.colour", 3),
        ("lattice.seed", 3),
        ("wall.a", 1e99),
    ):
        bad.append(json.dumps({"do": "set", "key": key, "value": value}))
    page = audience.join(lambda message: None)
    session = page.seat.session
    before = session.sandbox.scene
    for text in bad:
        audience.hear(page, text)
    session.advance()
    assert audience.ignored == len(bad) and session.sandbox.scene is before


@pytest.mark.validate
def test_no_message_makes_an_error(session: Session) -> None:
    choose = random.Random(2)
    values = [
        None,
        True,
        -1,
        1e300,
        0.3,
        2,
        "x",
        "",
        [],
        {},
        float("nan"),
        "\ud800",
        2**70,
        "axial",
        "shear",
        "pinned",
    ]
    keys = [
        *RANGES,
        *CHOICES,
        "video.magnify",
        "impact.gap",
        "",
        *session.controls.actions,
    ]
    kinds = (
        "play",
        "scrub",
        "turn",
        "aim",
        "throw",
        "pull",
        "release",
        "rescale",
        "collect",
        "clear",
        "press",
    )
    heard = 0
    while heard < 40:
        message: dict[str, Any] = {
            "do": choose.choice([*kinds, "set", "set", "what"]),
            "key": choose.choice(keys),
        }
        for name in ("value", "number", "t", "angle", "final", "dx", "dy", "x", "y"):
            message[name] = choose.choice(
                [choose.uniform(-2.0, 3.0), choose.choice(values)]
            )
        read_command(json.dumps(message)[: choose.randrange(60)])
        if found := read_command(json.dumps(message)):
            message_points = found.get("key") == "lattice.points"
            found |= (
                {"value": 60 + abs(found["value"]) % 60}
                if message_points and found["do"] == "set"
                else {}
            )
            session.hear(found)
            heard += 1
            if choose.random() < 0.5:
                session.advance()
    assert len(messages(session)["state"]) > HEADER.size


@pytest.mark.validate
def test_a_slider_that_is_held_while_the_scene_changes_is_let_be(
    session: Session,
) -> None:
    say(session, "play", number=2)  # a compression
    say(session, "set", key="impact.velocity", value=0.03)
    say(session, "set", key="wall.boundary", value="pinned")
    assert panel(session)["name"] == "compression" and not panel(session)["message"]
    assert all(
        isinstance(one["value"], (int, float)) for one in panel(session)["sliders"]
    )
    # a number that was typed keeps its digits
    say(session, "set", key="compression.pressure", value=0.0123456)
    assert session.sandbox.scene.compression.pressure == 0.0123456  # type: ignore[attr-defined]


# ---- states


def unpacked(session: Session) -> tuple[tuple[Any, ...], np.ndarray]:
    header = HEADER.unpack(messages(session)["state"][: HEADER.size])
    points, forces, values = header[2], header[3], header[5]
    count = len(INDEX) + len(CURVES) + 2 * points + values + 3 * forces
    return header, np.frombuffer(messages(session)["state"], "<f4", count, HEADER.size)


def test_a_state_holds_what_the_sandbox_sees(session: Session) -> None:
    say(session, "press", key="space")
    while session.sandbox.time.display.values["wall_force"] < 1e-3:
        session.advance()
    (number, t, points, forces, pulled, *_), floats = unpacked(session)
    seen = session.sandbox.time.display
    assert (
        number == session.number
        and t == seen.t
        and points == len(seen.x)
        and forces > 0
        and pulled == -1
    )
    np.testing.assert_allclose(floats[: len(INDEX)], seen.row, rtol=1e-6)
    x = floats[len(INDEX) + len(CURVES) :][: 2 * points].reshape(-1, 2)
    np.testing.assert_allclose(x, seen.x, rtol=1e-6, atol=1e-6)
    energies = floats[len(INDEX) :][:5]
    assert energies.sum() == pytest.approx(
        session.sandbox.time.segment.scenario.reference_energy, rel=1e-4
    )
    graphs = json.loads(messages(session)["graphs"])
    assert len(graphs["values"]) == len(CURVES) and graphs["t"][0] == 0.0


@pytest.mark.skipif(not shutil.which("node"), reason="no node")
def test_the_page_s_modules_parse_and_read_a_state_as_it_was_packed(
    session: Session, tmp_path: Path
) -> None:
    for module in WEB.glob("*.js"):
        done = subprocess.run(
            ["node", "--check", module], capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
    (tmp_path / "state").write_bytes(messages(session)["state"])
    (tmp_path / "message.mjs").write_text(
        (WEB / "message.js").read_text(encoding="utf-8"), encoding="utf-8"
    )
    (tmp_path / "read.mjs").write_text(
        "import { readFileSync } from 'fs'; import { unpacked } from"
        " './message.mjs';const bytes = readFileSync('state');const buffer ="
        " bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length);const"
        f" state = unpacked(buffer, {json.dumps([*INDEX])},"
        f" {len(CURVES)});console.log(JSON.stringify([state.number, state.t,"
        " state.row.com_y, state.x.length, state.caption]))"
    )
    read = subprocess.run(
        ["node", "read.mjs"], cwd=tmp_path, capture_output=True, text=True, check=True
    ).stdout
    number, t, com_y, length, caption = json.loads(read)
    seen = session.sandbox.time.display
    assert (number, t, length) == (
        session.number,
        seen.t,
        2 * len(seen.x),
    ) and com_y == pytest.approx(seen.values["com_y"])
    assert caption.startswith("t = ")


@pytest.mark.validate
def test_the_panel_shows_every_warning_of_a_run_and_whether_the_user_interfered(
    session: Session,
) -> None:
    # 120 points with the paper's eta*
    assert any("per point" in one for one in panel(session)["warnings"])
    assert panel(session)["status"] == "same as taichi-disk run"
    say(session, "press", key="space")
    while session.sandbox.at_start:
        session.advance()
    say(session, "set", key="material.eta_star", value=3.0)
    assert panel(session)["status"] == "disturbed"
    dashpot = next(
        one for one in panel(session)["choices"] if one["key"] == "material.dashpot"
    )
    assert dashpot["options"] == ["vector", "axial"]
    say(session, "set", key="material.dashpot", value="axial")
    assert session.sandbox.time.segment.scenario.model.springs.axial and panel(session)[
        "status"
    ].startswith("same")


@pytest.mark.validate
def test_picture_and_curves_stay_while_the_scene_is_computed_again(
    kernels: KernelCache,
) -> None:
    hard = [
        "lattice.points=60",
        "material.eta_star=0",
        "wall.a=3000",
        "impact.velocity=0.1",
    ]
    entry = Preset("hard", "Look.", partial(load_scene, "exponential_wall", hard))
    session = Session(Common([entry], kernels))
    say(session, "set", key="speed", value=3.0)
    say(session, "press", key="space")
    while panel(session)["again"] == 1.0:
        session.advance()
        assert session.sandbox.time.segment.status == "running"
    curves = messages(session)["graphs"]
    t = session.sandbox.time.display.t
    assert max(json.loads(curves)["values"][5]) >= 0.0
    fractions = []
    while panel(session)["again"] < 1.0:
        fractions.append(panel(session)["again"])
        assert messages(session)["graphs"] == curves
        assert session.sandbox.time.display.t == t
        session.sandbox.time.go(20, 1.0)
        session._write_messages()
    assert len(fractions) > 2 and fractions == sorted(fractions)
    session.advance()
    assert messages(session)["graphs"] != curves
    assert session.sandbox.time.display.t > t


@pytest.mark.validate
def test_a_curve_is_collected_by_itself_and_stops_when_asked(
    session: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("taichi_disk.window.sandbox.COLLECTING_PACE", 1e4)
    say(session, "set", key="speed", value=100.0)
    say(session, "collect")
    while len(session.sandbox.results) < 2:
        session.advance()
    first, second = panel(session)["results"]
    assert first["load"] > second["load"] and not first["disturbance"]
    scene = load_scene(
        "exponential_wall", [*SETTINGS, f"impact.velocity={first['load']}"]
    )
    scenario = scene.scenario()
    outcome = compute(scenario)
    assert first["value"] == scenario.primary(outcome.series)[1]  # in all digits
    say(session, "collect")
    assert not session.sandbox.remaining_loads
    while not panel(session)["paused"]:
        session.advance()
    say(session, "press", key="r")
    say(session, "set", key="impact.velocity", value=0.04)
    scene = session.sandbox.scene
    say(session, "collect")
    while panel(session)["collecting"]:
        session.advance()
    assert len(panel(session)["results"]) == 11 and session.sandbox.scene == scene
    assert panel(session)["paused"] and panel(session)["atStart"]
    say(session, "clear")
    assert panel(session)["results"] == []


@pytest.mark.validate
def test_the_colour_scale_is_known_before_the_throw_and_doubles_at_most(
    session: Session,
) -> None:
    scales = session.scales
    before = scales.colour
    say(session, "set", key="speed", value=5.0)
    say(session, "press", key="space")
    largest = 0.0
    while not session.sandbox.paused:
        session.advance()
        assert scales.colour == before and not scales.note
        shown = session.sandbox.time.display
        values = colour_values(
            "shear",
            session._triangles,
            shown.segment.scenario.model.springs,
            shown.x,
            shown.v,
        )
        largest = max(largest, full_scale(values.astype(float), "shear"))
    assert 0.5 < before / largest < 2.0
    say(session, "rescale")
    assert scales.colour < before  # the disk vibrates
    say(session, "press", key="h")
    assert scales.colour == before


def test_a_scale_grows_by_twos_with_a_note_and_not_from_rounding_errors(
    session: Session,
) -> None:
    scales = session.scales
    before = scales.colour
    disk = np.full(120, 1.4 * before)
    nothing = np.zeros((0, 3))
    scales.update(disk, nothing, "shear")
    assert scales.colour == before and not scales.note
    scales.update(4.0 * disk, nothing, "shear")
    assert scales.colour == 4.0 * before and f"{4.0 * before:g}" in scales.note
    scales.rescale()
    scales.update(1e-9 * disk, nothing, "shear")
    assert scales.colour == before and not scales.note
    scales.rescale()
    scales.update(1e-3 * disk, nothing, "shear")
    assert 1e-3 < scales.colour / before < 2e-3


# ---- visitors


class Reader:
    """A page without a browser: keeps what it is sent, and draws when it is told to."""

    def __init__(self, audience: Audience, key: str = "") -> None:
        self.audience = audience
        self.texts: dict[str, Any] = {}
        self.numbers: list[int] = []
        self.board: list[Any] = []
        self.page = audience.join(self.take, key=key)
        self.session = self.page.seat.session
        self.sandbox = self.session.sandbox

    def take(self, message: str | bytes) -> None:
        if isinstance(message, bytes):
            self.numbers.append(HEADER.unpack(message[: HEADER.size])[0])
            return
        content = json.loads(message)
        self.texts[content["kind"]] = content
        if content["kind"] == "board":
            self.board[content["from"] :] = content["rows"]

    def say(self, kind: str, **more: Any) -> None:
        self.audience.hear(self.page, json.dumps({"do": kind} | more))

    def leave(self) -> None:
        self.audience.leave(self.page)

    async def draw(self, pictures: int) -> None:
        for _ in range(pictures):
            await asyncio.sleep(0.01)
            if self.numbers:
                self.say("seen", number=self.numbers[-1])

    @property
    def key(self) -> str:
        return str(self.texts["session"]["key"])


def visit(
    common: Common, act: Callable[[Audience], Awaitable[None]], **more: Any
) -> None:
    async def visited() -> None:
        audience = Audience(common, **more)
        running = asyncio.create_task(audience.run())
        await act(audience)
        assert not running.done()
        running.cancel()

    asyncio.run(visited())


async def drawn(*readers: Reader, pictures: int = 3) -> None:
    await asyncio.gather(*(one.draw(pictures) for one in readers))


def test_a_page_gets_no_more_states_than_it_draws_and_holds_up_nobody(
    common: Common,
) -> None:
    async def act(audience: Audience) -> None:
        player, sleeper = Reader(audience), Reader(audience)
        player.say("press", key="space")
        sleeper.say("press", key="space")
        await player.draw(60)
        assert len(player.numbers) > 10 and len(sleeper.numbers) <= 4
        t = sleeper.sandbox.time.display.t
        await asyncio.sleep(0.3)  # both pages are hidden
        assert sleeper.sandbox.time.display.t == t
        # or its states were lost: it says that it waits for none
        player.numbers.clear()
        player.say("seen", number=9e6)
        await asyncio.sleep(0.1)
        assert player.numbers

    visit(common, act)


def test_each_page_has_a_disk_of_its_own_and_gets_it_back(common: Common) -> None:
    async def act(audience: Audience) -> None:
        one, other = Reader(audience), Reader(audience)
        await drawn(one, other)
        one.say("press", key="space")
        one.say("press", key="t")
        other.say("press", key="n")
        await drawn(one, other, pictures=10)
        assert not one.sandbox.paused and other.sandbox.paused
        assert other.session.controls.number == 1 and one.session.controls.number == 0
        assert other.sandbox.scene.video.theme == "light"
        assert one.key != other.key
        one.say("pull", x=0.0, y=2.5)
        await drawn(one, other)
        one.leave()
        assert one.sandbox.paused
        await other.draw(3)
        again, stranger = Reader(audience, one.key), Reader(audience, "unknown")
        await drawn(again, stranger)
        assert again.session is one.session and not again.sandbox.grip
        assert again.texts["session"]["key"] == one.key
        assert stranger.session not in (one.session, other.session)
        twin = Reader(audience, one.key)  # a tab that was duplicated
        await drawn(again, twin)
        twin.say("press", key="t")
        await drawn(again, twin)
        assert again.texts["panel"] == twin.texts["panel"]
        twin.leave()
        assert len(audience.seats) == 3

    visit(common, act)


def test_a_session_is_forgotten_after_a_while_or_when_there_is_no_room(
    common: Common, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def act(audience: Audience) -> None:
        readers = [Reader(audience) for _ in range(3)]
        await drawn(*readers)
        with pytest.raises(Full, match="All 3 disks are in use"):
            Reader(audience)
        readers[1].leave()
        readers[0].leave()
        Reader(audience)  # in place of the one who left first
        assert readers[1].key not in audience.seats
        assert readers[0].key in audience.seats
        await asyncio.sleep(0.5)
        Reader(audience)
        assert readers[0].key not in audience.seats
        assert common.memory.sharers == 3

    visit(common, act, keep_time=0.4, max_seats=3)


def test_undisturbed_results_of_everybody_are_on_every_page(common: Common) -> None:
    async def act(audience: Audience) -> None:
        readers = [Reader(audience) for _ in range(3)]
        readers[1].say("rename", text=" \u202e12Ａda<7> ")
        for k, one in enumerate(readers[:2]):
            one.say("set", key="impact.velocity", value=0.04 + 0.02 * k)
            one.say("set", key="speed", value=50.0)
            one.say("press", key="space")
        for _ in range(300):
            await drawn(*readers, pictures=1)
            if len(readers[2].board) == 2:
                break
        late = Reader(audience)
        await drawn(*readers, late)
        for one in (*readers, late):
            assert {row["load"] for row in one.board} == {0.04, 0.06}
            assert {row["player"] for row in one.board} == {"disk 1", "Ada"}
        readers[0].say("clear")
        await drawn(*readers)
        assert len(late.board) == 2 and not readers[0].sandbox.results

    visit(common, act)


def test_a_session_that_takes_long_does_not_starve_the_others(
    common: Common, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def act(audience: Audience) -> None:
        slow, *others = (Reader(audience) for _ in range(6))
        advance = slow.session.advance

        def slowly(*given: float) -> None:
            until = time.thread_time() + 0.05
            while time.thread_time() < until:
                pass
            advance(*given)

        monkeypatch.setattr(slow.session, "advance", slowly)
        for one in (slow, *others):
            one.say("press", key="space")
        await drawn(slow, *others, pictures=150)
        least = min(len(one.numbers) for one in others)
        # in turn they would be served equally often; on a quiet machine it is 5 times
        assert least > 1.3 * len(slow.numbers) > 0

    visit(common, act)


@pytest.mark.validate
def test_the_disk_goes_on_while_a_film_is_made_for_its_page(common: Common) -> None:
    async def act(audience: Audience) -> None:
        player, other = Reader(audience), Reader(audience)
        await drawn(player, other)
        player.say("set", key="speed", value=0.05)
        player.say("press", key="space")
        player.say("film")
        player.say("film")  # one is enough
        counts = len(player.numbers)
        while "film" not in player.texts:
            await drawn(player, other, pictures=1)
            assert not player.page.film or player.texts["session"]["awaitsFilm"]
        assert len(player.numbers) > counts + 50
        page = player.texts["film"]["page"]
        assert page.startswith("<!doctype html>") and "states" in page
        await drawn(player, other)
        assert "film" not in other.texts
        assert not player.texts["session"]["awaitsFilm"]
        player.sandbox.set("impact.max_time", 0.1)  # `run` fails
        player.say("film")
        while "max_time" not in player.texts["panel"]["message"]:
            await player.draw(1)
        player.say("film")
        await player.draw(1)
        task = player.page.film
        assert task
        player.leave()
        await asyncio.wait([task], timeout=10.0)
        assert task.cancelled()

    visit(common, act)


def test_an_error_in_a_command_is_named_and_everybody_goes_on(
    session: Session, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: Any) -> None:
        raise IndexError("out of range")

    monkeypatch.setattr(session.sandbox, "hit_again", fail)
    session.controls.add("h", "", session.sandbox.hit_again)
    say(session, "press", key="h")
    assert "IndexError: out of range" in panel(session)["message"]
    assert "Traceback" in capfd.readouterr().err
    say(session, "press", key="space")
    monkeypatch.setattr(session.sandbox, "tick", fail)
    session.advance()
    assert "the disk is at the start again" in panel(session)["message"]
    assert panel(session)["paused"] and session.sandbox.at_start
    monkeypatch.undo()
    say(session, "press", key="space")
    while session.sandbox.at_start:
        session.advance()


@pytest.mark.validate
def test_names_that_are_not_utf_8_reach_every_page(
    kernels: KernelCache, tmp_path: Path
) -> None:
    name = os.fsdecode(b"\xff.yaml")
    try:
        (tmp_path / name).write_text("scene: exponential_wall\nlattice: {points: 60}\n")
    except OSError:
        pytest.skip("this file system takes only UTF-8")
    session = Session(Common(list_folder(tmp_path), kernels))
    for kind, message in messages(session).items():
        if kind != "state":
            message.encode()
    assert panel(session)["name"] == "\udcff"


@pytest.mark.parametrize(
    "table", [b"key\n\xff\xfe\n", b"key\n" + b"x" * 140_000 + b"\n"]
)
def test_a_table_that_cannot_be_read_is_named(tmp_path: Path, table: bytes) -> None:
    (tmp_path / "points.csv").write_bytes(table)
    with pytest.raises(InputError, match=r"points\.csv"):
        list_folder(tmp_path)


def test_a_huge_file_is_listed_and_refused_when_it_is_chosen(tmp_path: Path) -> None:
    text = "scene: exponential_wall\nlattice: {points: 60}\n"
    (tmp_path / "a.yaml").write_text(text)
    with (tmp_path / "b.yaml").open("w") as file:
        file.write(text)
        file.truncate(3_000_000_000)  # sparse
    small, huge = list_folder(tmp_path)
    small.load()
    with pytest.raises(InputError, match=r"b\.yaml.*larger than"):
        huge.load()


def test_a_port_that_is_taken_is_told(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = str(taken.getsockname()[1])
        assert (
            main(["view", "--set", "lattice.points=60", "--no-open", "--port", port])
            == 2
        )
    assert f"port {port}" in (said := capsys.readouterr().err) and "--port" in said


# ---- the real one


@contextmanager
def serving(
    folder: Path, *arguments: str
) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Yield `view` with these arguments, on a machine without display and Vulkan, and
    its address."""
    environment = {
        name: value for name, value in os.environ.items() if name != "DISPLAY"
    }
    environment |= {
        "PYTHONPATH": str(WEB.parents[1]),
        "VK_ICD_FILENAMES": "/nonexistent",
    }
    command = [sys.executable, "-m", "taichi_disk", "view", *arguments]
    pipes: dict[str, Any] = {
        "stdout": subprocess.PIPE,
        "stderr": subprocess.PIPE,
        "text": True,
    }
    program = subprocess.Popen(command, env=environment, cwd=folder, **pipes)
    assert program.stdout
    try:
        found = re.search(r"http://\S+/", program.stdout.readline())
        assert found, program.communicate()[1]
        yield program, found[0]
    finally:
        program.kill()
        program.communicate()


@pytest.fixture
def served(tmp_path: Path) -> Iterator[tuple[subprocess.Popen[str], str]]:
    """The program with the scenes of the list, and its address."""
    with serving(tmp_path, *(f"--set={one}" for one in SETTINGS)) as program:
        yield program


def opened(name: str) -> Iterator[Browser]:
    missing = MISSING_BROWSERS[name]
    if missing:
        if os.environ.get("CI"):
            pytest.fail(f"the page cannot be tested: {missing}")
        pytest.skip(f"the page is not tested: {missing}")
    one = BROWSERS[name]()
    yield one
    one.driver.quit()


@pytest.fixture
def browser() -> Iterator[Browser]:
    yield from opened("chromium")


@pytest.fixture(params=BROWSERS)
def each_browser(request: pytest.FixtureRequest) -> Iterator[Browser]:
    yield from opened(request.param)


def ended(program: subprocess.Popen[str], number: int = signal.SIGTERM) -> str:
    """End the program by a signal; what it said on stderr."""
    program.send_signal(number)
    said = program.communicate(timeout=30)[1]
    assert program.returncode == 130 and "Traceback" not in said
    return said


@pytest.mark.validate
def test_a_signal_right_after_the_address_ends_the_program(
    served: tuple[subprocess.Popen[str], str],
) -> None:
    ended(served[0])


@pytest.mark.validate
def test_the_page_opens_obeys_and_computes_what_run_does(
    served: tuple[subprocess.Popen[str], str],
    each_browser: Browser,
    kernels: KernelCache,
    tmp_path: Path,
) -> None:
    browser = each_browser
    program, url = served
    browser.open(url)
    assert browser.colours() > 50  # field, wall, scale

    # A slider, a number that is typed, degrees, a drag that turns the disk, one that
    # aims.
    browser.lead("material.eta_star", 300)
    assert browser.wait(lambda: browser.number("material.eta_star") == 30)
    browser.type("material.eta_star", "2,5")
    assert browser.wait(lambda: browser.setting("eta_star") == 2.5)
    (left, top), disk = browser.disk()
    browser.drag((left, top - 60), (left + 70, top - 20))
    assert browser.wait(lambda: 0.1 < abs(browser.setting("turn")) < 3.0)
    browser.drag((left + disk + 60, top), (left + disk + 90, top + 60))
    assert browser.wait(
        lambda: browser.setting("angle") == pytest.approx(np.arctan2(30, 60), abs=0.02)
    )
    browser.type("impact.angle", "0")
    browser.wait(lambda: browser.setting("angle") == 0.0)

    # It comes to the end that `run` computes, in all digits.
    scene = load_scene(browser.yaml(tmp_path / "scene.yaml"))
    browser.click("drop")
    scenario = scene.scenario()
    e = scenario.primary(compute(scenario).series)[1]
    result = browser.wait(lambda: (found := browser.results()) and found[0], 60.0)
    assert result["value"] == e and result["disturbance"] == ""

    # Back in time by a graph and by a key; pulling from there is a disturbance.
    end = browser.state("t")
    browser.drag_in("energy", 0.4, 0.3)
    assert browser.wait(lambda: 0.0 < browser.state("t") < 0.8 * end)
    there = browser.state("t")
    browser.key("\ue012")  # the left arrow
    assert browser.wait(lambda: browser.state("t") < there)
    (left, top), _ = browser.disk()
    browser.drag((left, top), (left + 80, top - 60))
    assert browser.wait(lambda: "disturbed" in browser.text("status"))
    assert browser.errors() == []
    assert "ignored" not in ended(program)


@pytest.mark.validate
def test_every_control_of_the_page_does_what_it_says(
    served: tuple[subprocess.Popen[str], str], browser: Browser
) -> None:
    program, url = served
    browser.open(url)
    for key in browser.script(
        "return [...document.querySelectorAll('.slider')].map(one => one.dataset.key)"
    ):
        before = browser.number(key)
        browser.lead(key, 700)
        assert browser.wait(
            lambda key=key, before=before: browser.number(key) != before
        ), key
    browser.click("start")
    for key, choice in (
        ("video.colour", "pressure"),
        ("video.draw", "springs"),
        ("video.theme", "dark"),
        ("material.dashpot", "axial"),
    ):
        browser.choose(key, choice)
        assert browser.wait(
            lambda key=key, choice=choice: (
                f" {choice}" in browser.setting(key.split(".")[1], word=True)
            )
        )
    for identity in ("forces", "outline", "path", "arrow", "follow", "slow"):
        browser.click(identity)
        time.sleep(0.2)  # a picture without it
        browser.click(identity)
    looks = ["closer", "farther", "contact", "all"]
    for identity in (*looks, "lattice", "hit", "picture", "film", "film", "yaml"):
        browser.click(identity)
        time.sleep(0.3)
    for button in ("[data-press=Left]", "[data-press=Right]", "[data-command=rescale]"):
        browser.script(f"document.querySelector('{button}').click()")
        time.sleep(0.3)
    for name in ("disk.png", "scene.yaml"):
        browser.wait(lambda name=name: browser.downloaded(name))
    browser.wait(
        lambda: browser.downloaded("disk.webm") or browser.downloaded("disk.mp4")
    )
    assert browser.downloaded("disk.png").read_bytes()[:4] == b"\x89PNG"
    browser.click("scenes")
    entries = browser.script(
        "return [...document.querySelectorAll('#entries button')].map(one =>"
        " one.textContent)"
    )
    assert len(entries) >= 21 and all(len(one) > 30 for one in entries)
    browser.script("document.querySelectorAll('#entries button')[18].click()")
    assert browser.wait(lambda: "flattens" in browser.text("sentence"), 60.0)
    browser.wait(
        lambda: (
            browser.script("return document.getElementById('drop').textContent")
            == "Load"
        )
    )
    browser.key("?")
    assert browser.script("return document.getElementById('keys').open")
    assert browser.errors() == []
    ended(program)


@pytest.mark.validate
def test_a_page_keeps_its_disk_over_a_reload_and_another_page_has_its_own(
    served: tuple[subprocess.Popen[str], str], each_browser: Browser
) -> None:
    browser = each_browser
    program, url = served
    browser.open(url)
    browser.click("drop")
    browser.wait(lambda: browser.state("t") > 1.0)
    browser.open(url)  # again
    # paused: its page was away
    assert browser.state("t") > 1.0 and browser.text("drop") == "Go on"
    other = Browser((800, 700))
    try:
        other.open(url)
        assert other.state("t") == 0.0 and other.text("drop") == "Throw"
        other.choose("video.theme", "dark")
        other.wait(lambda: other.look("theme") == "dark")
        assert browser.look("theme") == "light" and browser.text("role") == ""
        other.script("window.sandbox.send({ do: 'set', key: 'speed', value: 50 })")
        other.click("drop")
        other.wait(lambda: other.script("return window.sandbox.board.length") == 1)
        browser.wait(lambda: browser.script("return window.sandbox.board.length") == 1)
        browser.click("tab-results")
        rows = "return document.querySelectorAll('#table tbody tr').length"
        assert browser.script(rows) == 0
        browser.click("class")
        assert browser.script(rows) == 1
        wrong = url.rstrip("/")[:-3] + "/"
        browser.driver.get(wrong)
        assert "whole address" in browser.script("return document.body.textContent")
        program.send_signal(signal.SIGTERM)
        other.wait(lambda: "does not answer" in other.text("role"))
    finally:
        other.driver.quit()


@pytest.mark.validate
def test_the_projector_shows_large_letters_and_films_are_saved(
    served: tuple[subprocess.Popen[str], str], each_browser: Browser
) -> None:
    browser = each_browser
    program, url = served
    browser.open(url)
    browser.click("film-page")
    browser.click("film")
    browser.click("drop")
    browser.wait(lambda: browser.state("t") > 0.5)
    browser.click("film")
    browser.key("f")
    assert browser.wait(lambda: browser.visible("timeline"))
    assert browser.script("return sandbox.letters") > 1.3
    assert browser.visible("energy") and not browser.visible("help")
    browser.key("\ue00c")  # Escape
    assert browser.wait(lambda: browser.visible("help"))
    assert browser.script("return sandbox.letters") == 1.0
    page = browser.wait(lambda: browser.downloaded("disk.html"), 60.0)
    browser.wait(
        lambda: browser.downloaded("disk.webm") or browser.downloaded("disk.mp4")
    )
    assert "states" in page.read_text(encoding="utf-8")
    assert browser.errors() == []
    ended(program)


@pytest.mark.validate
def test_graphs_show_energies_below_0_and_no_noise(
    served: tuple[subprocess.Popen[str], str], browser: Browser
) -> None:
    program, url = served
    browser.open(url)

    def ends(graph: str, side: str = "left") -> list[str]:
        found = (
            f"[...document.querySelectorAll('#{graph} ~ .{side}')].map((one) =>"
            " one.textContent)"
        )
        return list(browser.script(f"return {found}"))

    # not the force of rounding errors
    assert ends("motion")[0] == "0" and float(ends("motion")[2]) > 1e-3
    for key, value in (
        ("impact.velocity", "0.1"),
        ("impact.spin", "0.4"),
        ("wall.friction", "0.3"),
        ("speed", "5"),
    ):
        browser.type(key, value)
    browser.click("drop")
    browser.wait(browser.results)
    lowest = browser.script(
        "return Math.min(...window.sandbox.graphs.curves[2].values)"
    )
    low, middle, _ = ends("energy")
    assert lowest < 0.0 and middle == "0" and float(low.replace("\u2212", "-")) < lowest
    browser.script("window.sandbox.send({ do: 'play', number: 18 })")
    browser.wait(lambda: browser.text("drop") == "Load")
    browser.wait(lambda: ends("motion", "right")[0] == "0")  # a compression of zero
    assert float(ends("motion", "right")[2]) > 1e-3
    ended(program)


LAYOUTS = [(1920, 1080), (1400, 900), (1024, 768), (768, 1024), (390, 844), (844, 390)]
# Whether the picture has the size of its place: a busy browser draws it later.
IS_DRAWN = """
const { canvas, width, height } = window.sandbox.drawing;
return canvas.clientWidth === width && canvas.clientHeight === height;
"""
# what the program sends to a visitor who watches


@pytest.mark.validate
def test_every_layout_is_free_of_overlaps_small_letters_and_small_targets(
    served: tuple[subprocess.Popen[str], str], browser: Browser
) -> None:
    from axe_selenium_python import Axe

    def faults() -> Any:
        time.sleep(0.3)
        browser.wait(lambda: browser.script(IS_DRAWN))
        return browser.script(FAULTS)

    def serious() -> list[Any]:
        found = [
            (one["id"], one["nodes"][0]["html"][:200])
            for one in axe.run()["violations"]
            if one["impact"] in ("serious", "critical")
        ]
        browser.close_lists()
        return found

    program, url = served
    browser.open(url)
    browser.script("window.sandbox.send({ do: 'set', key: 'speed', value: 20 })")
    browser.click("drop")
    browser.wait(browser.results, 60.0)  # the disk has risen, and its read-out is long
    for size in LAYOUTS:
        browser.resize(size)
        for tab in ("experiment", "view", "graphs", "results"):
            browser.script(f"window.sandbox.showTab('{tab}')")
            assert faults() == [], (size, tab)
        browser.script("window.sandbox.project(true)")
        assert faults() == [], (size, "projector")
        browser.script("window.sandbox.project(false)")
    axe = Axe(browser.driver)
    axe.inject()
    browser.resize(LAYOUTS[0])
    for theme in ("light", "dark"):
        browser.choose("video.theme", theme)
        assert serious() == [], (theme, "results")
        for opening in ("scenes", "help"):
            browser.click(opening)
            assert serious() == [], (theme, opening)
    ended(program)


FAULTS = """
const found = [];
const box = (one) => one.getBoundingClientRect();
const root = document.documentElement;
const start = (one) => one.outerHTML.slice(0, 80);
if (root.scrollWidth > innerWidth || root.scrollHeight > innerHeight)
  found.push("the page scrolls");
const seen = [...document.querySelectorAll("main *")].filter((one) =>
  one.checkVisibility({ visibilityProperty: true }) && !one.closest("dialog"));
for (const one of seen) {
  const hasWords = (node) => node.nodeType === 3 && node.data.trim();
  const size = parseFloat(getComputedStyle(one).fontSize);
  if ([...one.childNodes].some(hasWords) && size < 12)
    found.push("small letters: " + start(one));
}
const controls = seen.filter((one) => one.matches("button, select, input"));
for (const one of controls) {
  const { width, height } = box(one.closest("label") ?? one);
  if (width < 43.9 || height < 43.9)
    found.push(`small target ${width} x ${height}: ${start(one)}`);
}
const across = (a, b) => Math.min(a.right, b.right) - Math.max(a.left, b.left);
const down = (a, b) => Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
const place = (one) => one.closest("section, nav, header");
const names = ["caption", "message", "sentence", "role", "status"];
const texts = names.map((id) => document.getElementById(id));
const words = texts.filter((one) => seen.includes(one) && one.textContent);
const things = [...controls, ...words];
things.forEach((one, k) => things.slice(0, k).forEach((other) => {
  const width = across(box(one), box(other));
  const height = down(box(one), box(other));
  if (place(one) === place(other) && width >= 1 && height >= 1)
    found.push("overlap: " + start(one) + " and " + start(other));
}));
const { drawing, state } = window.sandbox, { left, top } = box(drawing.canvas);
const [x, y] = drawing.toScreen(state.row.com_x, state.row.com_y);
const legend = top + 2 * drawing.middle[1];
for (const one of texts.slice(0, 2).filter((text) => text.textContent).map(box)) {
  const dx = Math.max(one.left - left - x, left + x - one.right, 0);
  const dy = Math.max(one.top - top - y, top + y - one.bottom, 0);
  if (Math.hypot(dx, dy) < drawing.camera.scale) found.push("a text is on the disk");
  if (one.bottom > legend) found.push("a text is on the legend");
}
return found;
"""
# A control by chance: a slider is led, a choice made, a button pressed unless it saves
# a file. Arguments: which control, and which of its values, from 0 to 1.
ANY_CONTROL = """
const [which, part] = arguments;
const controls = [...document.querySelectorAll("main button, main input, main select")];
const all = controls.filter((one) => one.checkVisibility());
const one = all[Math.floor(which * all.length)];
if (!one) return;
if (one.type === "range") {
  one.value = Number(one.min) + 0.6 * part * (one.max - one.min);
  one.dispatchEvent(new Event("change"));
} else if (one.matches("select")) {
  one.selectedIndex = Math.floor(part * one.length);
  one.onchange();
} else if (!/picture|film|yaml|csv/.test(one.id)) one.click();
"""
# Delete, Tab, Enter, Escape, arrows and others, as selenium writes them
OTHER_KEYS = "\ue003\ue006\ue00c\ue012\ue013\ue014\ue015"
ANY_KEY = [*"rhbnlxedazjksfycotiug ?5", *OTHER_KEYS]
EVENTS = 6  # for each scene
# A disk may be large by now, and its state is computed before the next event.
ANSWER_TIME = 60.0


def interfere(browser: Browser, choose: random.Random) -> None:
    """Do one thing that a user may do: press a key, drag, use a control, or change the
    size of the page."""
    kind = choose.random()
    if kind < 0.3:
        browser.key(choose.choice(ANY_KEY), choose.choice([0.02, 0.4]))
    elif kind < 0.6:
        ends = [(choose.randrange(1, 990), choose.randrange(60, 750)) for _ in range(2)]
        button = choose.choice([0, 0, 2])
        is_touch = choose.random() < 0.3
        browser.drag(*ends, pause=0.05, button=button, touch=is_touch)
    elif kind < 0.85:
        browser.driver.execute_script(ANY_CONTROL, choose.random(), choose.random())
    elif kind < 0.9:
        browser.resize((choose.randrange(200, 1600), choose.randrange(200, 1100)))
        browser.resize((1000, 760))
    else:
        browser.close_lists()


def interfere_with_all_scenes(
    browser: Browser, program: subprocess.Popen[str], seed: int, events: int
) -> None:
    """Play every scene of the list and do `events` things to it. The page must answer
    afterwards, and say no error."""
    choose = random.Random(seed)
    scenes = browser.script("return window.sandbox.hello.playlist.length")
    for number in range(scenes):
        browser.script(f"window.sandbox.send({{ do: 'play', number: {number} }})")
        browser.script("window.sandbox.send({ do: 'press', key: 'space' })")
        for _ in range(events):
            interfere(browser, choose)
            assert program.poll() is None, f"scene {number}"
        browser.close_lists()
        before = browser.state("number")
        browser.script("window.sandbox.send({ do: 'press', key: 'r' })")
        answered = partial(answers_after, browser, before)
        assert browser.wait(answered, ANSWER_TIME)
        errors = browser.errors()
        message = browser.script("return window.sandbox.panel.message")
        assert errors == [], f"scene {number}: {errors}"
        assert "error of the program" not in message, f"scene {number}: {message}"
        assert browser.script("return window.sandbox.ui.fault.hidden")


def answers_after(browser: Browser, number: float) -> bool:
    return browser.state("number") > number


@pytest.mark.validate
def test_anything_that_a_user_does_to_any_scene_leaves_the_page_alive(
    served: tuple[subprocess.Popen[str], str], browser: Browser
) -> None:
    program, url = served
    browser.open(url)
    interfere_with_all_scenes(browser, program, seed=3, events=EVENTS)
    ended(program, signal.SIGINT)


@pytest.mark.validate
def test_a_swipe_of_a_finger_does_not_leave_the_page(
    served: tuple[subprocess.Popen[str], str], browser: Browser
) -> None:
    browser.open(served[1])
    for height in range(80, 740, 60):
        browser.drag((20, height), (980, height), pause=0.05, touch=True)
    assert browser.driver.current_url == served[1]


@pytest.mark.validate
def test_a_failure_to_draw_is_said_once_and_time_goes_on(
    served: tuple[subprocess.Popen[str], str], browser: Browser
) -> None:
    program, url = served
    browser.open(url)
    browser.script(
        "window.sandbox.drawing.draw = () => { throw new Error('no colours') }"
    )
    browser.click("drop")
    browser.wait(lambda: browser.state("t") > 1.0, 10.0)
    assert browser.text("fault") == "The picture cannot be drawn: no colours"
    assert browser.script("return document.getElementById('fault').checkVisibility()")
    ended(program)


@pytest.mark.validate
def test_curves_stay_while_the_scene_is_computed_again(
    tmp_path: Path, browser: Browser
) -> None:
    settings = ["oblique_impact", "--set=lattice.points=300", "--no-open"]
    with serving(tmp_path, *settings) as (program, url):
        browser.open(url)
        browser.script("window.sandbox.send({ do: 'set', key: 'speed', value: 20 })")
        browser.script(WATCH_AGAIN)
        browser.click("drop")
        browser.wait(browser.results, 180.0)
        seen = browser.script("return window.again")
        # Several steps are too long for this disk, and the message names each of them.
        again = [list(each) for _, each in groupby(seen, itemgetter("message"))]
        assert len(again) > 1
        for each in again:
            fractions = [one["fraction"] for one in each]
            assert fractions == sorted(fractions)
            shown = each[0]
            # curves have five digits
            assert shown["t"] == pytest.approx(shown["end"], abs=1e-3)
            assert shown["force"] > 0.01
            for one in each:
                assert one["isGrey"] and one["hasBar"]
                # neither the picture nor the curve of the contact's force goes back
                for name in ("t", "end", "force"):
                    assert one[name] == shown[name]
        times = [each[0]["t"] for each in again]
        assert times == sorted(times)
        assert not browser.visible("again")
        assert browser.state("t") > times[-1]
        assert browser.errors() == []
        ended(program)


# Keep what the page shows whenever the program has computed more of the scene again.
WATCH_AGAIN = """
const { sandbox } = window, show = sandbox.showPanel;
window.again = [];
sandbox.showPanel = (panel) => {
  show.call(sandbox, panel);
  if (panel.again === 1) return;
  const { data } = sandbox.graphs;
  window.again.push({
    message: panel.message,
    fraction: panel.again,
    t: sandbox.state.t,
    end: data.t.at(-1),
    force: Math.max(...data.values[5]),
    isGrey: getComputedStyle(sandbox.ui.disk).filter.includes("grayscale"),
    hasBar: sandbox.ui.again.checkVisibility(),
  });
};
"""


@pytest.mark.validate
def test_letters_are_keys_by_their_place_on_other_layouts(
    served: tuple[subprocess.Popen[str], str], each_browser: Browser
) -> None:
    browser = each_browser
    browser.open(served[1])
    press = (
        "document.body.dispatchEvent(new KeyboardEvent('keydown',"
        " { key: '%s', code: '%s', bubbles: true }))"
    )
    # t with Caps Lock, on a Cyrillic and on a Greek layout, and on Dvorak's
    for key, code in (("T", "KeyT"), ("е", "KeyT"), ("τ", "KeyT"), ("t", "KeyK")):
        before = browser.look("theme")
        browser.script(press % (key, code))
        browser.wait(lambda before=before: browser.look("theme") != before)
    ended(served[0])


@pytest.mark.validate
def test_the_system_s_preference_counts_until_a_theme_is_chosen_also_after_a_reload(
    served: tuple[subprocess.Popen[str], str], browser: Browser
) -> None:
    def prefer(theme: str) -> None:
        feature = {"name": "prefers-color-scheme", "value": theme}
        browser.driver.execute_cdp_cmd(
            "Emulation.setEmulatedMedia", {"features": [feature]}
        )

    def answered() -> None:
        # Messages of a page are answered in turn: then earlier ones are, too.
        quantity = browser.look("quantity")
        browser.key("c")
        browser.wait(lambda: browser.look("quantity") != quantity)

    prefer("dark")
    browser.open(served[1])
    browser.wait(lambda: browser.look("theme") == "dark")
    prefer("light")
    browser.wait(lambda: browser.look("theme") == "light")
    browser.choose("video.theme", "dark")
    browser.wait(lambda: browser.look("theme") == "dark")
    prefer("dark")
    prefer("light")
    answered()
    assert browser.look("theme") == "dark"
    browser.open(served[1])
    browser.wait(lambda: browser.look("theme") == "dark")
    browser.key("t")
    browser.wait(lambda: browser.look("theme") == "light")
    prefer("dark")
    browser.open(served[1])
    answered()
    assert browser.look("theme") == "light"
    ended(served[0])


@pytest.mark.validate
def test_results_are_copied_over_plain_http_too(
    served: tuple[subprocess.Popen[str], str], each_browser: Browser
) -> None:
    browser = each_browser
    browser.open(served[1])
    browser.type("speed", "20")
    browser.click("drop")
    browser.wait(browser.results, 60.0)
    # as a page has it that came by plain http from another machine
    browser.script(
        "Object.defineProperty(navigator, 'clipboard', { value: undefined });"
        "document.addEventListener('copy', (event) => {"
        " window.copied = document.activeElement.value.slice("
        "document.activeElement.selectionStart, document.activeElement.selectionEnd) })"
    )
    browser.script("document.querySelector('nav [data-tab=results]').click()")
    browser.driver.find_element("id", "copy").click()
    copied = browser.wait(lambda: browser.script("return window.copied ?? ''"))
    assert copied.startswith("result\t") and "\n" in copied
    assert not browser.script("return document.querySelectorAll('textarea').length")
    ended(served[0])


@pytest.mark.validate
@pytest.mark.parametrize("number", range(21))
def test_every_scene_of_the_list_ends_as_run_does_after_random_events(
    number: int, kernels: KernelCache
) -> None:
    """What a user does before the throw leaves no trace in the scene as it is listed,
    and the time between two pictures changes no digit."""
    entries = list_presets(None)
    session = Session(Common(entries, kernels))
    choose = random.Random(number)
    keys = [key for key in "bnrhzxadlecy" if key in session.controls.actions]
    for _ in range(12):
        t = choose.uniform(0.0, 20.0)
        do = choose.choice(["press", "scrub", "pull", "release", "turn"])
        if do == "press":
            say(session, "press", key=choose.choice([*keys, "space"]))
        elif do == "scrub":
            say(session, "scrub", t=t)
        elif do == "pull":
            say(session, "pull", x=choose.uniform(-1.0, 1.0), y=t)
        elif do == "turn":
            say(session, "turn", angle=0.1 * t, final=1)
        else:
            say(session, "release")
    say(session, "release")
    say(session, "clear")
    say(session, "play", number=number)
    sandbox = session.sandbox
    assert panel(session)["name"] == entries[number].name
    say(session, "set", key="speed", value=100.0)
    if sandbox.paused:
        say(session, "press", key="space")
    while not sandbox.paused:  # without a clock, so that it takes no longer than a run
        sandbox.advance(choose.uniform(0.001, 0.1), max_seconds=np.inf)
    assert sandbox.time.segment.control.attempt == 1
    scenario = entries[number].load().scenario()
    outcome = compute(scenario, estimate=False)
    expected = scenario.primary(outcome.series)[1]
    assert [one.value for one in sandbox.results] == [expected]
