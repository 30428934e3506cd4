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
from pathlib import Path
from statistics import median

from websockets.asyncio.client import connect

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
_STATM = 1  # field of /proc/PID/statm: resident pages
_PAGE = 4096  # bytes


class Page:
    """A page without a browser.

    Attributes:
        times: when states arrived whose disk had moved [s].
    """

    def __init__(self):
        self.times = []
        self._panel = {}
        self._last = (0, 0.0)  # number and time of the last state
        self._pressed = 0.0

    async def play(self, address, origin):
        async with connect(
            address, origin=origin, max_size=None, compression=None
        ) as self.connection:
            answering = asyncio.create_task(self._answer())
            try:
                async for message in self.connection:
                    await self._take(message)
            finally:
                answering.cancel()

    async def say(self, **message):
        await self.connection.send(json.dumps(message))

    async def _answer(self):
        """Acknowledge the last state with each picture of the screen."""
        told = 0
        while True:
            await asyncio.sleep(PERIOD - time.perf_counter() % PERIOD)
            number, _ = self._last
            if number > told:
                told = number
                await self.say(do="seen", number=number)

    async def _take(self, message):
        if isinstance(message, str):
            content = json.loads(message)
            if content["kind"] == "panel":
                self._panel = content
            return
        now = time.perf_counter()
        number, t, *_ = HEADER.unpack(message[: HEADER.size])
        if t > self._last[1]:
            self.times.append(now)
        self._last = number, t
        if self._panel.get("paused") and now > self._pressed + RESTART:
            self._pressed = now
            if not self._panel["atStart"]:
                await self.say(do="press", key="r")
            await self.say(do="press", key="space")

    def gaps(self, begin, end):
        inside = [one for one in self.times if begin <= one <= end]
        # a restart takes two pictures more
        return [b - a for a, b in pairwise(inside)]


def pages(settings):
    """Measure states a second of each of many pages, the longest gap, and memory; then
    the longest gap of the others while one page changes scenes and lattices."""
    yield (
        f"{'pages with a disk of 1,099 points':<36}{'states/s of each':>18}"
        f"{'gap [s]':>9}{'by another [s]':>16}{'MB':>6}"
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


async def _watched(count, pid, root):
    address = root.replace("http", "ws", 1) + "socket"
    origin = root.rpartition("/")[0].rpartition("/")[0]
    tasks = []
    try:
        players = [Page() for _ in range(count)]
        for one in players:
            tasks.append(asyncio.create_task(one.play(address, origin)))
            await asyncio.sleep(APART)
        await asyncio.sleep(2.0)
        begin = time.perf_counter()
        await asyncio.sleep(WATCHED)
        end = time.perf_counter()
        *others, last = players
        for message in COMMANDS:
            await last.say(**message)
            await asyncio.sleep(WATCHED / len(COMMANDS))
        finished = time.perf_counter()
        memory = Path(f"/proc/{pid}/statm").read_text().split()
    finally:
        for task in tasks:
            task.cancel()
    rates = []
    for one in players:
        inside = [moment for moment in one.times if begin <= moment <= end]
        rates.append(len(inside) / (end - begin))
    calm = max(max(one.gaps(begin, end)) for one in players)
    disturbed = max((max(one.gaps(end, finished)) for one in others), default=0.0)
    megabytes = int(memory[_STATM]) * _PAGE / 2**20
    line = f"  {count:<34}{min(rates):8.1f} to{max(rates):7.1f}{calm:9.3f}"
    return f"{line}{disturbed:16.3f}{megabytes:6.0f}  (median {median(rates):.1f})"
