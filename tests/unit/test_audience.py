"""Many pages without a browser: each has a disk of its own, and none waits for
another."""

import asyncio
import json
from functools import wraps
from threading import Event

import pytest

from taichi_disk.errors import InputError
from taichi_disk.window import audience as pages
from taichi_disk.window.audience import Audience, Full
from taichi_disk.window.history import start_of
from taichi_disk.window.session import HEADER


class Reader:
    """A page without a browser: keeps what it is sent, and draws when it is told to."""

    def __init__(self, audience, key=""):
        self.audience = audience
        self.texts = {}
        self.numbers = []
        self.board = []
        self.page = audience.join(self.take, key=key)
        self.session = self.page.seat.session
        self.sandbox = self.session.sandbox

    def take(self, message):
        if isinstance(message, bytes):
            self.numbers.append(HEADER.unpack(message[: HEADER.size])[0])
            return
        content = json.loads(message)
        self.texts[content["kind"]] = content
        if content["kind"] == "board":
            self.board[content["first"] :] = content["rows"]

    def say(self, kind, **more):
        self.audience.hear(self.page, json.dumps({"do": kind} | more))

    def leave(self):
        self.audience.leave(self.page)

    async def draw(self, pictures):
        for _ in range(pictures):
            await asyncio.sleep(0.01)
            if self.numbers:
                self.say("seen", number=self.numbers[-1])

    @property
    def key(self):
        return str(self.texts["session"]["key"])


FEW_SEATS = {"keep_time": 0.4, "max_seats": 3}


@pytest.fixture
def audience(common, request):
    return Audience(common, **getattr(request, "param", {}))


def visited(test):
    """Run a test that awaits while its audience is served."""

    @wraps(test)
    def run(audience, **more):
        async def visit():
            serving = asyncio.create_task(audience.run())
            await test(audience=audience, **more)
            assert not serving.done()
            serving.cancel()

        asyncio.run(visit())

    return run


async def drawn(*readers, pictures=3):
    await asyncio.gather(*(one.draw(pictures) for one in readers))


async def drawn_until(holds, *readers):
    """Draw as long as a busy machine needs."""
    for _ in range(500):
        if holds():
            return
        await drawn(*readers, pictures=1)


@visited
async def test_a_page_gets_no_more_states_than_it_draws_and_holds_up_nobody(audience):
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


@visited
async def test_each_page_has_a_disk_of_its_own_and_gets_it_back(audience):
    one, other = Reader(audience), Reader(audience)
    await drawn(one, other)
    one.say("press", key="space")
    one.say("press", key="t")
    other.say("press", key="n")
    await drawn_until(lambda: other.session.controls.number == 1, one, other)
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
    stranger.say("alive")
    assert "alive" in stranger.texts and "alive" not in again.texts


@pytest.mark.parametrize("audience", [FEW_SEATS], indirect=True)
@visited
async def test_a_session_is_forgotten_in_time_or_for_lack_of_room(audience, common):
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


@visited
async def test_undisturbed_results_of_everybody_are_on_every_page(audience):
    readers = [Reader(audience) for _ in range(3)]
    seeds = [one.sandbox.scene.lattice.seed for one in readers]
    assert seeds == [0, 1, 2]  # a lattice of its own
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
    readers[1].say("wipe")
    await drawn(*readers, late)
    assert len(late.board) == 2 and readers[1].sandbox.results
    readers[0].say("wipe")  # on the first page, which is the teacher's
    await drawn(*readers, late)
    assert not any(one.board for one in (*readers, late, Reader(audience)))


@pytest.mark.parametrize(
    ("cost", "once", "always"),
    [(0.05, 1 / 60, 0.15), (0.001, 1 / 60, 1 / 60), (0.1, 0.03, 0.25)],
)
def test_a_session_that_computes_long_waits_long(
    audience, monkeypatch, cost, once, always
):
    """Six sessions want a picture, and each may take at most twice its part; several
    pauses pay for one long picture."""
    reader = Reader(audience)
    used = 0.0
    pictures = 0

    def advance(_):
        nonlocal used, pictures
        used += cost
        pictures += 1
        state = bytes([pictures]) + bytes(HEADER.size)
        reader.session.messages["state"] = state

    monkeypatch.setattr(reader.session, "advance", advance)
    monkeypatch.setattr(pages, "thread_time", lambda: used)
    monkeypatch.setattr(pages, "perf_counter", lambda: 100.0)
    reader.say("press", key="space")
    seat = reader.page.seat
    pauses = []
    for _ in range(80):
        audience._serve(seat, 6)
        pauses.append(seat.due - 100.0)
        reader.page.acknowledge(1e6)
    assert pauses[0] == pytest.approx(once)
    assert pauses[-1] == pytest.approx(always, rel=1e-3)


@visited
async def test_who_has_waited_longest_is_served_first(audience):
    served = []

    readers = [Reader(audience) for _ in range(4)]
    await drawn(*readers)
    for one in readers:
        one.say("set", key="speed", value=0.01)  # none comes to its end
        one.say("press", key="space")
    for _ in range(60):
        served.append([len(one.numbers) for one in readers])
        await drawn(*readers, pictures=1)
    assert served[-1][0] > 5
    assert max(max(counts) - min(counts) for counts in served) <= 3


@visited
async def test_a_lattice_being_built_holds_up_nobody_else(audience, monkeypatch):
    may_end = Event()

    def slowly(scene, body):
        assert may_end.wait(20.0)
        return start_of(scene, body)

    def fail(*_):
        raise InputError("no such lattice")

    builder, other = Reader(audience), Reader(audience)
    await drawn(builder, other)
    monkeypatch.setattr("taichi_disk.window.session.start_of", slowly)
    other.say("press", key="space")
    builder.say("press", key="l")
    builder.say("press", key="t")
    await drawn(builder, other, pictures=20)
    assert len(other.numbers) > 10
    assert builder.sandbox.scene.lattice.seed == 0
    # what was said later is done later
    assert builder.sandbox.scene.video.theme == "light"
    may_end.set()
    while builder.sandbox.scene.video.theme == "light":
        await drawn(builder, other, pictures=1)
    assert builder.sandbox.scene.lattice.seed == 1
    # a lattice that cannot be built is the sandbox's message
    monkeypatch.setattr("taichi_disk.window.session.start_of", fail)
    builder.say("press", key="l")
    builder.say("press", key="t")
    while builder.sandbox.scene.video.theme == "dark":
        await drawn(builder, other, pictures=1)
    assert builder.texts["panel"]["message"] == "no such lattice"
    assert builder.sandbox.scene.lattice.seed == 1


@visited
async def test_a_throw_that_is_drawn_counts_once_its_start_is_known(audience):
    one = Reader(audience)
    await drawn(one)
    one.say("aim", dx=0.4, dy=-0.8)
    one.say("throw")
    one.say("press", key="space")
    while one.sandbox.at_start:
        await one.draw(1)
    impact = one.sandbox.scene.impact
    assert (impact.velocity, impact.angle) == (0.0447, 0.464)


@visited
async def test_kernels_are_compiled_while_nobody_plays(audience, common, monkeypatch):
    monkeypatch.setattr(pages, "QUIET_TIME", 0.1)
    begun = []
    monkeypatch.setattr(
        pages, "Timeline", lambda start, *_: begun.append(start.scenario.scene.scene)
    )
    common.playlist = [one._replace(group="Throw") for one in common.playlist]

    player = Reader(audience)
    player.say("set", key="speed", value=0.01)
    player.say("press", key="space")
    await player.draw(3)
    compiling = asyncio.create_task(audience.compile())
    await player.draw(20)
    assert not begun
    player.say("press", key="space")
    while not compiling.done():
        await player.draw(1)
    assert begun == ["exponential_wall", "absorbing_wall", "compression"]


@visited
async def test_a_curve_is_collected_while_the_page_only_draws(audience):
    one = Reader(audience)
    await drawn(one)
    one.say("collect")
    while len(one.sandbox.results) < 2:
        await one.draw(1)
    assert not one.sandbox.paused


def test_a_page_that_leaves_its_film_leaves_no_error(audience, monkeypatch, capfd):
    async def broken(_):
        try:
            await asyncio.sleep(20.0)
        finally:
            raise ValueError("flush of closed file")

    monkeypatch.setattr(pages, "make_film", broken)

    @visited
    async def act(audience):
        player = Reader(audience)
        await drawn(player)
        player.say("film")
        await drawn(player)
        film = player.page.film
        assert film and player.texts["session"]["awaitsFilm"]
        player.leave()
        await asyncio.wait([film], timeout=10.0)
        assert film.done() and player.sandbox.message == ""

    act(audience)
    assert capfd.readouterr().err == ""


@pytest.mark.validate
@visited
async def test_the_disk_goes_on_while_a_film_is_made_for_its_page(audience):
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
    sandbox = player.sandbox
    sandbox.scene = sandbox.scene.with_({"impact.max_time": 0.1})  # `run` fails
    player.say("film")
    while "max_time" not in player.texts["panel"]["message"]:
        await player.draw(1)
