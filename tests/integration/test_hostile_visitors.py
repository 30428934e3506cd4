"""Visitors who send rubbish or say nothing: the sandbox goes on, and can be ended."""

import asyncio
import json
import re
import secrets
import socket
from contextlib import asynccontextmanager
from functools import partial
from threading import Event
from unittest.mock import Mock

import numpy as np
import pytest
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed

from taichi_disk.base.errors import InputError
from taichi_disk.experiments.scenes import load_scene
from taichi_disk.sandbox import server
from taichi_disk.sandbox.controls import Preset
from taichi_disk.sandbox.server import Sessions
from taichi_disk.sandbox.session import MAX_BYTES

SETTINGS = ["lattice.points=60", "impact.velocity=0.05", "material.eta_star=1"]
PLAYLIST = [
    Preset("bounce", "Look.", partial(load_scene, "exponential_wall", SETTINGS))
]


@pytest.fixture
def sessions(kernels, monkeypatch):
    # Whether a kernel is compiled meanwhile would depend on the time.
    monkeypatch.setattr(server, "QUIET_TIME", 100.0)
    return Sessions(2 * PLAYLIST)


def handshake(port):
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

    def __init__(self, connection):
        self.connection, self.number = connection, 0

    async def say(self, kind, **more):
        await self.connection.send(json.dumps({"do": kind} | more))

    async def see(self, states=1):
        """Take what comes up to a state, and draw that."""
        for _ in range(states):
            message = ""
            while isinstance(message, str):
                message = await asyncio.wait_for(self.connection.recv(), 10.0)
            self.number = int(np.frombuffer(message, "<f4", 1)[0])
            await self.say("seen", number=self.number)


@asynccontextmanager
async def guest(port, key="", **options):
    key = key or secrets.token_hex()
    address = f"ws://127.0.0.1:{port}/secret/socket?{key}"
    async with connect(
        address, origin=f"http://127.0.0.1:{port}", **options
    ) as connection:  # type: ignore[arg-type]
        yield Guest(connection)


def visited(sessions, act):
    """Serve a sandbox while visitors act; whoever comes afterwards must play."""

    async def visit():
        with socket.create_server(("127.0.0.1", 0), backlog=128) as listening:
            port = listening.getsockname()[1]
            serving = asyncio.create_task(server.run(sessions, "secret", listening))
            try:
                await asyncio.wait_for(act(port), 30.0)
                async with guest(port) as last:
                    await last.see()
                    await last.say("press", key="space")
                    await last.see(3)  # it plays
                assert not serving.done()
            finally:
                serving.cancel()
                await asyncio.wait([serving])

    asyncio.run(visit())


RUBBISH = ["", "}" * 9, "[" * 500, "\0", "😀", b"\xff" * MAX_BYTES, '{"do": 1}']


def test_rubbish_is_ignored_and_a_message_that_is_too_long_ends_its_page(sessions):
    async def act(port):
        async with guest(port, "1") as vandal:
            await vandal.see()
            for message in 50 * RUBBISH:
                await vandal.connection.send(message)
            await vandal.say("press", key="space")
            await vandal.see()
            assert sessions.find("1").sandbox.message == ""
            await vandal.connection.send("x" * (MAX_BYTES + 1))
            with pytest.raises(ConnectionClosed):
                while True:
                    await vandal.see()

    visited(sessions, act)


def test_pages_that_are_silent_do_not_hold_up_the_end(sessions, monkeypatch):
    monkeypatch.setattr(server, "_CLOSE_TIME", 0.1)

    async def visit():
        with socket.create_server(("127.0.0.1", 0)) as listening:
            port = listening.getsockname()[1]
            serving = asyncio.create_task(server.run(sessions, "secret", listening))
            streams = []
            for request in (handshake(port), b"", b"GET /secret/"):
                streams.append(await asyncio.open_connection("127.0.0.1", port))
                streams[-1][1].write(request)
            await asyncio.sleep(0.3)
            serving.cancel()
            # `websockets` would wait for ten seconds
            done, _ = await asyncio.wait([serving], timeout=5.0)
            assert done

    asyncio.run(visit())


@pytest.fixture
def quick(monkeypatch, kernels):
    """Let servers compile nothing anew, and leave the garbage of tests."""
    monkeypatch.setattr(server, "gc", Mock())


@pytest.mark.usefixtures("quick")
@pytest.mark.parametrize(
    ("host", "printed"), [("localhost", "localhost"), ("::1", "[::1]")]
)
def test_a_server_prints_an_address_that_answers(monkeypatch, capsys, host, printed):
    if ":" in host and not socket.has_dualstack_ipv6():
        pytest.skip("no IPv6")

    async def serving(_sessions, _token, listening):
        port = listening.getsockname()[1]
        socket.create_connection((host, port), 5.0).close()

    monkeypatch.setattr(server, "run", serving)
    server.serve(PLAYLIST, host)
    text = capsys.readouterr().out
    assert re.findall(r"http://(.*):\d+/[\w-]+/", text) == [printed]


def test_an_empty_host_does_not_listen_everywhere():
    with pytest.raises(InputError, match="--host is empty"):
        server.serve(PLAYLIST, "")


@pytest.mark.usefixtures("quick")
@pytest.mark.validate
def test_a_browser_in_the_foreground_does_not_hold_up_the_server(monkeypatch, capfd):
    is_closed = Event()
    opened = []

    def browse(address):
        opened.append(address)
        is_closed.wait(20.0)

    async def serving(*_):
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
