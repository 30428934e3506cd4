"""Visitors who come in crowds, never read, or send rubbish, and a server that dies: the
sandbox goes on."""

from __future__ import annotations

import asyncio
import io
import json
import re
import socket
import subprocess
import sys
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from functools import partial
from threading import Event
from typing import Any
from unittest.mock import Mock

import pytest
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed

from taichi_disk.errors import InputError
from taichi_disk.scenes import load_scene
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window import server
from taichi_disk.window.audience import MAX_SEATS, Audience
from taichi_disk.window.controls import Preset
from taichi_disk.window.door import Door
from taichi_disk.window.session import HEADER, MAX_BYTES, Common

SETTINGS = ["lattice.points=60", "impact.velocity=0.05", "material.eta_star=1"]
# of sockets, so that little is under way to somebody who does not read [bytes]
SMALL_BUFFER = 2**12
MAX_UNREAD = 2**17  # a scene and a state, about [bytes]
# a server that soon misses a page
QUICK = {"ping_interval": 0.3, "ping_timeout": 0.3, "close_timeout": 0.1}
PLAYLIST = [
    Preset("bounce", "Look.", partial(load_scene, "exponential_wall", SETTINGS))
]
Act = Callable[[int], Awaitable[None]]  # what visitors do, given the port


@pytest.fixture
def audience(kernels: KernelCache) -> Audience:
    return Audience(Common(2 * PLAYLIST, kernels))


def handshake(port: int) -> bytes:
    """The request with which a page opens its websocket."""
    lines = (
        "GET /secret/socket HTTP/1.1",
        f"Host: 127.0.0.1:{port}",
        f"Origin: http://127.0.0.1:{port}",
        "Upgrade: websocket",
        "Connection: Upgrade",
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==",
        "Sec-WebSocket-Version: 13",
    )
    return "\r\n".join([*lines, "", ""]).encode()


class Guest:
    """A page without a browser, over a real socket."""

    def __init__(self, connection: ClientConnection) -> None:
        self.connection, self.key, self.number = connection, "", 0

    async def say(self, kind: str, **more: Any) -> None:
        await self.connection.send(json.dumps({"do": kind} | more))

    async def see(self, states: int = 1) -> None:
        """Take what comes up to a state, and draw that."""
        for _ in range(states):
            while isinstance(
                message := await asyncio.wait_for(self.connection.recv(), 10.0), str
            ):
                if (content := json.loads(message))["kind"] == "session":
                    self.key = content["key"]
            self.number = HEADER.unpack(message[: HEADER.size])[0]
            await self.say("seen", number=self.number)


@asynccontextmanager
async def guest(port: int, key: str = "", **options: Any) -> AsyncIterator[Guest]:
    address = f"ws://127.0.0.1:{port}/secret/socket?{key}"
    async with connect(
        address, origin=f"http://127.0.0.1:{port}", **options
    ) as connection:  # type: ignore[arg-type]
        yield Guest(connection)


def visited(audience: Audience, act: Act) -> None:
    """Serve a sandbox while visitors act; whoever comes afterwards must be served and
    play."""

    async def visit() -> None:
        with socket.create_server(("127.0.0.1", 0), backlog=128) as listening:
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SMALL_BUFFER)
            port = listening.getsockname()[1]
            serving = asyncio.create_task(
                server.run(audience, Door("secret"), listening)
            )
            try:
                await asyncio.wait_for(act(port), 30.0)
                async with guest(port) as last:
                    await until(lambda: pages(audience) == 1)
                    await last.see()
                    await last.say("press", key="space")
                    await last.see(3)  # it plays
                assert not serving.done()
            finally:
                serving.cancel()
                await asyncio.wait([serving])

    asyncio.run(visit())


def pages(audience: Audience) -> int:
    return sum(len(seat.pages) for seat in audience.seats.values())


async def until(condition: Callable[[], object]) -> None:
    for _ in range(300):
        if condition():
            return
        await asyncio.sleep(0.02)
    raise AssertionError("it does not come to that")


@pytest.mark.parametrize("count", [20, 100])
@pytest.mark.validate
def test_a_crowd_that_comes_at_once_is_served_as_far_as_there_is_room(audience, count):
    async def act(port: int) -> None:
        async with AsyncExitStack() as stack:
            crowd = await asyncio.gather(
                *(stack.enter_async_context(guest(port)) for _ in range(count))
            )
            seen = await asyncio.gather(
                *(one.see() for one in crowd), return_exceptions=True
            )
            refused = [error for error in seen if isinstance(error, ConnectionClosed)]
            assert len(refused) == max(0, count - MAX_SEATS)
            assert all("disks are in use" in error.rcvd.reason for error in refused)
            players = [
                one for one, error in zip(crowd, seen, strict=True) if error is None
            ]
            for one in players:
                await one.say("press", key="space")
            await asyncio.gather(*(one.see(5) for one in players))
            sandboxes = [seat.session.sandbox for seat in audience.seats.values()]
            assert not any(sandbox.paused for sandbox in sandboxes)
        # all have left
        await until(lambda: all(sandbox.paused for sandbox in sandboxes))

    visited(audience, act)


@pytest.mark.parametrize("count", [30, 100])
@pytest.mark.validate
def test_a_page_that_is_reloaded_again_and_again_leaves_nothing_behind(audience, count):
    async def act(port: int) -> None:
        await asyncio.sleep(0.1)  # the server has begun
        tasks = len(asyncio.all_tasks())
        for k in range(count):
            async with guest(port) as one:
                if k % 3:
                    await one.see()
                if k % 3 == 1:
                    one.connection.transport.abort()  # the network went away
        await until(lambda: len(asyncio.all_tasks()) == tasks)

    visited(audience, act)
    assert audience.ignored == 0


@pytest.mark.parametrize("claims_to_draw", [False, True])
@pytest.mark.validate
def test_a_page_that_reads_nothing_gets_no_queue_and_finds_its_disk_again(
    audience, monkeypatch, claims_to_draw
):
    connections: list[Any] = []
    answer = Door.answer
    monkeypatch.setattr(server.server, "serve", partial(server.server.serve, **QUICK))
    monkeypatch.setattr(
        Door,
        "answer",
        lambda door, *more: connections.append(more[0]) or answer(door, *more),
    )

    async def act(port: int) -> None:
        deaf = socket.socket()
        deaf.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, SMALL_BUFFER)
        deaf.connect(("127.0.0.1", port))
        async with guest(port, sock=deaf, max_queue=1) as player, guest(port) as other:
            await other.see()
            await player.say("press", key="space")
            while pages(audience) == 2:
                if claims_to_draw:
                    with suppress(ConnectionClosed):
                        await player.say("seen", number=9e6)
                assert connections[0].transport.get_write_buffer_size() < MAX_UNREAD
                await other.say("press", key="t")
                await other.see()
            player.connection.transport.abort()
            seat = next(iter(audience.seats.values()))
            assert seat.session.sandbox.paused and not seat.pages
            async with guest(port, seat.key) as again:
                await again.see()
                assert again.key == seat.key and seat.pages

    visited(audience, act)


NOISE = [
    b"OPTIONS * HTTP/1.1\r\nHost: x\r\n\r\n",
    b"GET /" + b"9" * 4000 + b" HTTP/1.1\r\n\r\n",
    b"GET /secret/%00 HTTP/1.1\r\n\r\n",
    b"GET /\xff\xfe HTTP/1.1\r\n\r\n",
    b"POST /secret/ HTTP/1.1\r\nContent-Length: 99999999999\r\n\r\n",
    b"GET / HTTP/1.1\r\n" + b"A: b\r\n" * 1000 + b"\r\n",
    b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03" + bytes(range(256)),  # TLS
    b"\r\n" * 100,
    b"",
]


def test_requests_that_are_none_get_no_answer_or_a_refusal(audience):
    async def ask(port: int, noise: bytes) -> bytes:
        reader, writer = await asyncio.open_connection("127.0.0.1", port)
        writer.write(noise)
        writer.write_eof()
        answer = await asyncio.wait_for(reader.read(), 5.0)
        writer.close()
        return answer

    async def act(port: int) -> None:
        # they ask for nothing
        silent = [await asyncio.open_connection("127.0.0.1", port) for _ in range(50)]
        for noise in NOISE:
            answer = await ask(port, noise)
            assert not answer or re.match(rb"HTTP/1.1 4\d\d ", answer), (
                noise[:40],
                answer[:80],
            )
        async with guest(port) as one:
            await one.see()
        for _, writer in silent:
            writer.close()

    visited(audience, act)


RUBBISH = ["", "}" * 9, "[" * 500, "\0", "😀", b"\xff" * MAX_BYTES, '{"do": 1}']


@pytest.mark.parametrize("count", [50, pytest.param(700, marks=pytest.mark.validate)])
def test_a_flood_of_rubbish_is_counted_and_everybody_else_goes_on(audience, count):
    async def act(port: int) -> None:
        async with guest(port) as vandal, guest(port) as watcher:
            await vandal.see()
            for message in count * RUBBISH:
                await vandal.connection.send(message)
            await vandal.say("press", key="space")
            await watcher.see()
            await vandal.see()
            assert audience.ignored == len(count * RUBBISH)
            await vandal.connection.send("x" * (MAX_BYTES + 1))
            with pytest.raises(ConnectionClosed):
                while True:
                    await vandal.see()
            await watcher.say("press", key="space")
            await watcher.see(3)
        for frame in (
            b"\xff" * 20,
            b"\x81\x05hello",
            b"\x8f\x80\0\0\0\0",
            b"\x01\xff" + b"\x7f" * 12,
        ):
            # frames without mask, of unknown kind, longer than the sea
            async with guest(port) as broken:
                broken.connection.transport.write(frame)
                with pytest.raises(ConnectionClosed):
                    while True:
                        await broken.connection.recv()

    visited(audience, act)


def test_pages_that_are_silent_do_not_hold_up_the_end(audience):
    async def visit() -> None:
        with socket.create_server(("127.0.0.1", 0)) as listening:
            port = listening.getsockname()[1]
            door = Door("secret")
            serving = asyncio.create_task(server.run(audience, door, listening))
            streams = []
            for request in (handshake(port), b"", b"GET /secret/"):
                streams.append(await asyncio.open_connection("127.0.0.1", port))
                streams[-1][1].write(request)
            await until(lambda: pages(audience))
            serving.cancel()
            # `websockets` would wait for ten seconds
            done, _ = await asyncio.wait([serving], timeout=5.0)
            assert done

    asyncio.run(visit())


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch, kernels: KernelCache) -> None:
    """Let servers compile nothing anew, and leave the garbage of tests."""
    monkeypatch.setattr(server, "KernelCache", lambda: kernels)
    monkeypatch.setattr(server, "gc", Mock())


class Probe(socket.socket):
    """A socket that finds the address which this machine uses for the internet."""

    def connect(self, address: Any) -> None:
        if self.type != socket.SOCK_DGRAM:
            super().connect(address)

    def getsockname(self) -> Any:
        if self.type == socket.SOCK_DGRAM:
            return "192.0.2.1", 9
        return super().getsockname()


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("host", "bound", "printed", "encoding"),
    [
        ("localhost", "127.0.0.1", ["localhost"], "utf-8"),
        ("::1", "::1", ["[::1]"], "utf-8"),
        ("0.0.0.0", "127.0.0.1", ["192.0.2.1", "192.0.2.2", "desk"], "utf-8"),
        ("0.0.0.0", "127.0.0.1", ["192.0.2.1", "192.0.2.2", "desk"], "ascii"),
    ],
)
def test_a_server_prints_each_address_that_answers_once_and_a_code_for_others(
    monkeypatch, host, bound, printed, encoding
):
    if ":" in host and not socket.has_dualstack_ipv6():
        pytest.skip("no IPv6")
    own = ("127.0.1.1", "192.0.2.2", "192.0.2.2")
    rows = [(socket.AF_INET, 1, 6, "", (name, 0)) for name in own]
    terminal = io.TextIOWrapper(io.BytesIO(), encoding)
    find = socket.getaddrinfo

    async def serving(_audience: Any, _door: Any, listening: socket.socket) -> None:
        port = listening.getsockname()[1]
        socket.create_connection((bound, port), 5.0).close()

    def found(name: str, *more: Any, **options: Any) -> Any:
        return rows if name == "desk" else find(name, *more, **options)

    monkeypatch.setattr(server, "run", serving)
    monkeypatch.setattr(server.socket, "getaddrinfo", found)
    monkeypatch.setattr(server.socket, "gethostname", lambda: "desk")
    monkeypatch.setattr(server.socket, "socket", Probe)
    monkeypatch.setattr(terminal, "isatty", lambda: True)
    monkeypatch.setattr(sys, "stdout", terminal)
    server.serve(PLAYLIST, host)
    terminal.seek(0)
    text = terminal.read()
    assert re.findall(r"http://(.*):\d+/\w+/", text) == printed
    assert ("whoever has this address" in text) == (host == "0.0.0.0")
    assert ("█" in text) == (host == "0.0.0.0" and encoding == "utf-8")


def test_an_empty_host_does_not_listen_everywhere():
    with pytest.raises(InputError, match=r"--host is empty.*0\.0\.0\.0"):
        server.serve(PLAYLIST, "")


@pytest.mark.usefixtures("quick")
@pytest.mark.validate
def test_a_browser_in_the_foreground_does_not_hold_up_the_server(monkeypatch, capfd):
    is_closed = Event()
    opened: list[str] = []

    def browse(address: str) -> None:
        opened.append(address)
        is_closed.wait(20.0)

    async def serving(*_: Any) -> None:
        for _ in range(100):
            if opened:
                return
            await asyncio.sleep(0.05)

    monkeypatch.setattr(server.webbrowser, "open", browse)
    monkeypatch.setattr(server, "run", serving)
    server.serve(PLAYLIST, open_browser=True)
    assert not is_closed.is_set()
    assert opened[0] in capfd.readouterr().out
    is_closed.set()


@pytest.mark.validate
def test_a_film_survives_a_program_that_is_killed_and_its_page_finds_the_next_one(
    tmp_path, browser
):
    with socket.create_server(("127.0.0.1", 0)) as free:
        port = free.getsockname()[1]
    code = (
        "import sys; from taichi_disk.window import door; door.new_token = lambda:"
        " 'secret'; from taichi_disk.cli import main; "
    )
    arguments = [
        "view",
        "--no-open",
        "--port",
        str(port),
        *(f"--set={one}" for one in SETTINGS),
    ]

    def started() -> subprocess.Popen[str]:
        command = [sys.executable, "-c", f"{code} sys.exit(main({arguments!r}))"]
        program = subprocess.Popen(
            command, stdout=subprocess.PIPE, text=True, cwd=tmp_path
        )
        assert program.stdout and "/secret/" in program.stdout.readline()
        return program

    program = started()
    try:
        browser.open(f"http://127.0.0.1:{port}/secret/")
        browser.click("drop")
        browser.wait(lambda: browser.state("t") > 2.0)
        program.kill()
        program.wait()
        browser.wait(lambda: "does not answer" in browser.text("role"))
        program = started()
        browser.wait(lambda: browser.text("role") == "")
        browser.wait(lambda: browser.state("t") == 0.0)
        browser.click("drop")
        browser.wait(lambda: browser.state("t") > 0.5)
    finally:
        program.kill()
        program.wait()
