"""Each page has a disk of its own, and gets states as fast as it draws them."""

import asyncio
import json
from functools import wraps

import numpy as np
import pytest

from taichi_disk.sandbox import page as pages, server
from taichi_disk.sandbox.page import Page
from taichi_disk.sandbox.server import KEPT, Sessions


class Reader:
    """A page without a browser: keeps what it is sent, and draws when it is told to."""

    def __init__(self, sessions, key):
        self.texts = {}
        self.numbers = []
        self.session = sessions.find(key)
        self.sandbox = self.session.sandbox
        self.page = Page(self.session, self.take)

    def take(self, message):
        if isinstance(message, bytes):
            self.numbers.append(int(np.frombuffer(message, "<f4", 1)[0]))
            return
        content = json.loads(message)
        self.texts[content["kind"]] = content

    def say(self, kind, **more):
        self.page.hear(json.dumps({"do": kind} | more))

    async def draw(self, pictures):
        for _ in range(pictures):
            await asyncio.sleep(0.02)
            if self.numbers:
                self.say("seen", number=self.numbers[-1])

    async def draw_until(self, holds):
        """Draw as long as a busy machine needs."""
        for _ in range(500):
            if holds():
                return
            await self.draw(1)
        raise AssertionError("it does not come to that")


@pytest.fixture
def sessions(playlist, kernels):
    return Sessions(playlist)


def visited(test):
    """Run a test that awaits."""

    @wraps(test)
    def run(sessions, **more):
        asyncio.run(test(sessions=sessions, **more))

    return run


@visited
async def test_a_page_gets_no_more_states_than_it_draws_and_holds_up_no_other(sessions):
    player, sleeper = Reader(sessions, "1"), Reader(sessions, "2")
    player.say("press", key="space")
    sleeper.say("press", key="space")
    await player.draw_until(lambda: len(player.numbers) > 10)
    assert len(sleeper.numbers) <= 4
    t = sleeper.sandbox.time.display.t
    await asyncio.sleep(0.1)  # both pages are hidden
    assert sleeper.sandbox.time.display.t == t
    # or its states were lost: it says that it waits for none
    player.numbers.clear()
    player.say("seen", number=9e6)
    await player.draw_until(lambda: player.numbers)
    player.say("alive")
    assert "alive" in player.texts and "alive" not in sleeper.texts


@visited
async def test_each_page_has_a_disk_of_its_own_and_gets_it_back(sessions):
    one, other = Reader(sessions, "1"), Reader(sessions, "2")
    one.say("press", key="space")
    one.say("press", key="t")
    other.say("press", key="n")
    await asyncio.gather(one.draw(3), other.draw(3))
    assert not one.sandbox.paused and other.sandbox.paused
    numbers = [each.session.controls.number for each in (one, other)]
    assert numbers == [0, 1]
    assert other.sandbox.scene.video.theme == "light"
    one.say("pull", x=0.0, y=2.5)
    await one.draw_until(lambda: one.sandbox.grip >= 0)
    one.page.leave()
    await other.draw(3)
    t = one.sandbox.time.segment.now
    again = Reader(sessions, "1")
    await again.draw_until(lambda: again.sandbox.grip < 0)
    assert again.session is one.session
    await again.draw_until(lambda: again.sandbox.time.segment.now > t)
    twin = Reader(sessions, "1")  # a tab that was duplicated
    twin.say("press", key="t")
    await asyncio.gather(again.draw(5), twin.draw(5))
    assert again.texts["panel"]["choices"] == twin.texts["panel"]["choices"]
    assert again.sandbox.scene.video.theme == "light"


def test_the_last_sessions_are_kept(sessions):
    first = sessions.find("first")
    for k in range(KEPT - 1):
        sessions.find(str(k))
    assert sessions.find("first") is first
    for k in range(KEPT):
        sessions.find(str(k))
    assert sessions.find("first") is not first


@visited
async def test_kernels_are_compiled_while_nobody_plays(sessions, playlist, monkeypatch):
    monkeypatch.setattr(server, "QUIET_TIME", 0.05)
    begun = []
    monkeypatch.setattr(
        server, "Timeline", lambda start: begun.append(start.scenario.scene)
    )
    player = Reader(sessions, "1")
    player.say("set", key="speed", value=0.01)
    player.say("press", key="space")
    await player.draw(3)
    compiling = asyncio.create_task(sessions.compile())
    await player.draw(10)
    assert not begun
    player.say("press", key="space")
    await player.draw_until(compiling.done)
    assert begun == [entry.load() for entry in playlist]


@visited
async def test_a_curve_is_collected_while_the_page_only_draws(sessions):
    one = Reader(sessions, "1")
    one.say("collect")
    await one.draw_until(lambda: len(one.sandbox.results) > 1)
    assert not one.sandbox.paused


def test_a_page_that_leaves_its_film_leaves_no_error(sessions, monkeypatch, capfd):
    async def broken(_):
        try:
            await asyncio.sleep(20.0)
        finally:
            raise ValueError("flush of closed file")

    async def act():
        player = Reader(sessions, "1")
        player.say("film")
        await player.draw(3)
        player.page.leave()
        await asyncio.sleep(0.1)
        assert player.sandbox.message == ""
        assert "film" not in player.texts

    monkeypatch.setattr(pages, "make_film", broken)
    asyncio.run(act())
    assert capfd.readouterr().err == ""


@pytest.mark.validate
@visited
async def test_the_disk_goes_on_while_a_film_is_made_for_its_page(sessions):
    player, other = Reader(sessions, "1"), Reader(sessions, "2")
    player.say("set", key="speed", value=0.05)
    player.say("press", key="space")
    player.say("film")
    player.say("film")  # one is enough
    await player.draw_until(lambda: "film" in player.texts)
    assert len(player.numbers) > 50
    page = player.texts.pop("film")["page"]
    assert page.startswith("<!doctype html>") and "states" in page
    assert "film" not in other.texts
    sandbox = player.sandbox
    sandbox.scene = sandbox.scene.with_({"impact.max_time": 0.1})  # `run` fails
    player.say("film")
    await player.draw_until(lambda: "film" in player.texts)
    assert player.texts["film"]["page"] == ""
    await player.draw(3)
    assert "max_time" in player.texts["panel"]["message"]
