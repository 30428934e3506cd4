"""Many pages of `taichi-disk view` at once, without browsers: each has a disk that
moves, and answers at the next picture of its screen."""

from __future__ import annotations

import asyncio
import json
import os
import re
import subprocess
import sys
import time
from contextlib import contextmanager
from itertools import pairwise
from math import inf
from pathlib import Path
from urllib.parse import urlsplit

from taichi_disk.window.session import HEADER

COUNTS = (1, 10, 30)
APART = 0.2  # time between two pages that join [s]
WATCHED = 15.0  # time of the measurement [s]
PERIOD = 1.0 / 60.0  # of a screen [s]
# After the disk's end the page begins again, not before this time [s].
RESTART = 0.5
# what the last page does in the second half, and how long others may wait then
COMMANDS = (
    {"do": "play", "number": 1},  # Backspin
    {"do": "press", "key": "l"},
    {"do": "set", "key": "lattice.points", "value": 5000},
    {"do": "play", "number": 17},  # Pressed on the wall
)
# of a websocket's frames: kinds, flags, and digits of lengths that need another byte
_TEXT = 1
_BINARY = 2
_PING = 9
_PONG = 10
_FINAL = 0x80
_MASKED = 0x80
_LENGTHS = {126: 2, 127: 8}
_STATM = 1  # field of /proc/PID/statm: resident pages
_PAGE = 4096  # bytes


class Page(asyncio.Protocol):
    """A page without a browser. It reads frames of the websocket itself, because
    measuring must cost less than serving.

    Attributes:
        times: when states arrived whose disk had moved [s].
    """

    def __init__(self, address):
        self.times = []
        self._address = urlsplit(address)
        self._received = bytearray()
        self._is_open = False
        self._panel = {}
        self._number = 0  # of the last state
        self._t = 0.0
        self._told = 0  # number of the last state that it has acknowledged
        self._pressed = 0.0

    async def join(self):
        loop = asyncio.get_running_loop()
        host = self._address.hostname
        await loop.create_connection(lambda: self, host, self._address.port)

    def leave(self):
        self._transport.close()

    def connection_made(self, transport):
        self._transport = transport
        where = self._address
        lines = (
            f"GET {where.path}socket HTTP/1.1",
            f"Host: {where.netloc}",
            f"Origin: {where.scheme}://{where.netloc}",
            "Upgrade: websocket",
            "Connection: Upgrade",
            "Sec-WebSocket-Version: 13",
            "Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==",
        )
        transport.write("\r\n".join((*lines, "", "")).encode())

    def data_received(self, data):
        self._received += data
        if not self._is_open:
            answer, _, rest = self._received.partition(b"\r\n\r\n")
            assert b" 101 " in answer, answer.decode()
            self._received = rest
            self._is_open = True
        while (end := self._end_of_frame()) <= len(self._received):
            size = self._received[1]
            begin = _LENGTHS.get(size, 0) + 2
            self._take(self._received[0] & 0x0F, bytes(self._received[begin:end]))
            del self._received[:end]

    def _end_of_frame(self):
        """Return where the first frame ends, inf as long as its length is unknown."""
        received = self._received
        if len(received) < 2:
            return inf
        size = received[1]
        digits = _LENGTHS.get(size, 0)
        if digits:
            size = int.from_bytes(received[2 : 2 + digits], "big")
        if len(received) < 2 + digits:
            return inf
        return 2 + digits + size

    def say(self, **message):
        self._send(_TEXT, json.dumps(message).encode())

    def _send(self, kind, content):
        assert len(content) < min(_LENGTHS)
        # its mask, 0, changes nothing
        head = bytes([_FINAL | kind, _MASKED | len(content), 0, 0, 0, 0])
        self._transport.write(head + content)

    def acknowledge(self):
        """Say that the last state has been drawn."""
        if self._number > self._told:
            self._told = self._number
            self.say(do="seen", number=self._number)

    def _take(self, kind, content):
        if kind == _PING:
            self._send(_PONG, content)
        elif kind == _TEXT and content.startswith(b'{"kind": "panel"'):
            self._panel = json.loads(content)
        elif kind == _BINARY:
            self._take_state(content)

    def _take_state(self, state):
        now = time.perf_counter()
        number, t, *_ = HEADER.unpack(state[: HEADER.size])
        if t != self._t:
            self.times.append(now)
        self._number = number
        self._t = t
        if self._panel.get("paused") and now > self._pressed + RESTART:
            self._pressed = now
            if not self._panel["atStart"]:
                self.say(do="press", key="r")
            self.say(do="press", key="space")

    def count(self, begin, end):
        return sum(begin <= one <= end for one in self.times)

    def gaps(self, begin, end) -> list[float]:
        inside = [one for one in self.times if begin <= one <= end]
        return [b - a for a, b in pairwise(inside)]


def pages(settings):
    """Measure states a second of each of many pages, the longest gap, memory, and the
    server's processor time for a state; and the longest gap of the others while one
    page changes scenes and lattices."""
    yield (
        f"{'pages with a disk of 1,099 points':<36}{'states/s of each':>18}"
        f"{'gap [s]':>9}{'by another [s]':>16}{'MB':>6}{'ms/state':>10}"
    )
    for count in COUNTS:
        yield asyncio.run(_measured(count, settings))


@contextmanager
def served(*words):
    """Yield the process of `taichi-disk view` with these arguments, and its address."""
    command = [sys.executable, "-m", "taichi_disk", "view", "--no-open", *words]
    program = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    assert program.stdout
    try:
        found = re.search(r"http://\S+/", program.stdout.readline())
        assert found, "the page is not served"
        yield program.pid, found[0]
    finally:
        program.terminate()
        program.wait()


def _used(pid):
    """Return the processor time of a process [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


async def _compiled(pid):
    """Wait until a program that nobody uses has compiled its kernels."""
    used = -1.0
    while _used(pid) > used + 0.1:
        used = _used(pid)
        await asyncio.sleep(2.0)


async def _measured(count, settings):
    words = [f"--set={one}" for one in settings]
    with served("--host", "0.0.0.0", *words) as (pid, root):
        await _compiled(pid)
        return await _watched(count, pid, root)


async def _watched(count, pid, address):
    players = [Page(address) for _ in range(count)]
    answering = asyncio.create_task(_answer(players))
    try:
        for one in players:
            await one.join()
            await asyncio.sleep(APART)
        await asyncio.sleep(2.0)
        begin = time.perf_counter()
        used = _used(pid)
        await asyncio.sleep(WATCHED)
        used = _used(pid) - used
        end = time.perf_counter()
        *others, last = players
        for message in COMMANDS:
            last.say(**message)
            await asyncio.sleep(WATCHED / len(COMMANDS))
        finished = time.perf_counter()
        memory = Path(f"/proc/{pid}/statm").read_text().split()
    finally:
        answering.cancel()
        for one in players:
            one.leave()
    states = [one.count(begin, end) for one in players]
    rates = [number / (end - begin) for number in states]
    calm = max(max(one.gaps(begin, end)) for one in players)
    disturbed = max((max(one.gaps(end, finished)) for one in others), default=0.0)
    megabytes = int(memory[_STATM]) * _PAGE / 2**20
    return (
        f"  {count:<34}{min(rates):8.1f} to{max(rates):7.1f}{calm:9.3f}"
        f"{disturbed:16.3f}{megabytes:6.0f}{1e3 * used / sum(states):10.2f}"
    )


async def _answer(players):
    """Acknowledge the last states with each picture of the screens."""
    while True:
        await asyncio.sleep(PERIOD - time.perf_counter() % PERIOD)
        for one in players:
            one.acknowledge()
