"""The server of `taichi-disk view`: its processor time for a state, and many pages at
once without browsers, each with a disk that moves.

A page answers at the next picture of its screen."""

from __future__ import annotations

import asyncio
import json
import multiprocessing
import os
import time
from concurrent.futures import ProcessPoolExecutor
from itertools import pairwise
from pathlib import Path
from urllib.parse import urlsplit

from websockets.asyncio.client import connect

from taichi_disk.window.session import HEADER
from tests.browser import serving

SCENES = (
    ("compression",),
    ("exponential_wall",),
    ("absorbing_wall",),
    ("exponential_wall", "lattice.points=4400"),
    ("exponential_wall", "lattice.points=20000"),
)
COUNTED = 200  # number of states that are measured
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

    def __init__(self, connection):
        self.times = []
        self._connection = connection
        self._panel = {}
        self._number = 0  # of the last state
        self._t = 0.0
        self._acknowledged = 0  # number of the last state that was answered
        self._pressed = 0.0

    async def say(self, **message):
        await self._connection.send(json.dumps(message))

    async def listen(self):
        async for message in self._connection:
            if isinstance(message, bytes):
                await self._take_state(message)
            elif message.startswith('{"kind": "panel"'):
                self._panel = json.loads(message)

    async def _take_state(self, state):
        now = time.perf_counter()
        number, t, *_ = HEADER.unpack(state[: HEADER.size])
        if t != self._t:
            self.times.append(now)
        self._number = number
        self._t = t
        if self._panel.get("paused") and now > self._pressed + RESTART:
            self._pressed = now
            if not self._panel["atStart"]:
                await self.say(do="press", key="r")
            await self.say(do="press", key="space")

    async def answer(self):
        """Say with each picture of the screen that the last state has been drawn."""
        while True:
            await asyncio.sleep(PERIOD - time.perf_counter() % PERIOD)
            if self._number > self._acknowledged:
                self._acknowledged = self._number
                await self.say(do="seen", number=self._number)

    def count(self, begin, end):
        return sum(begin <= one <= end for one in self.times)

    def gaps(self, begin, end) -> list[float]:
        inside = [one for one in self.times if begin <= one <= end]
        return [b - a for a, b in pairwise(inside)]


def page(settings):
    """Measure many pages at once, and the server's processor time for a state."""
    yield from pages(settings)
    yield f"{'a state':<46}{'ms':>10}{'kB':>10}"
    for scene, *own in SCENES:
        given = (*own, *settings)
        with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as process:
            seconds, size = process.submit(states, scene, given).result()
        name = " ".join((scene, *given))
        yield f"  {name:<44}{1e3 * seconds:10.2f}{1e-3 * size:10.1f}"


def states(scene, settings):
    """Return the server's processor time for a state without the computation [s], and
    the bytes of a state."""
    from taichi_disk import runtime

    runtime.start()
    from taichi_disk.scenes import load_scene
    from taichi_disk.simulation.simulation import KernelCache
    from taichi_disk.window.app import list_presets
    from taichi_disk.window.session import Common, Session

    presets = list_presets(load_scene(scene, settings))
    session = Session(Common(presets, KernelCache()))
    stepping = 0.0
    advance = session.sandbox.advance

    def stepped(*given):
        nonlocal stepping
        began = time.process_time()
        made = advance(*given)
        stepping += time.process_time() - began
        return made

    session.sandbox.advance = stepped
    session.hear({"do": "press", "key": "space"})
    for _ in range(COUNTED // 4):
        session.advance()
    stepping = 0.0
    began = time.process_time()
    for _ in range(COUNTED):
        session.advance()
    of_all = time.process_time() - began - stepping
    return of_all / COUNTED, len(session.messages["state"])


def pages(settings):
    """Measure states a second of each of many pages, the longest gap, memory, and the
    server's processor time for a state; and the longest gap of the others while one
    page changes scenes and lattices."""
    yield (
        f"{'pages with a disk of 1,099 points':<36}{'states/s of each':>18}"
        f"{'gap [s]':>9}{'by another [s]':>16}{'MB':>6}{'ms/state':>10}"
    )
    words = [f"--set={one}" for one in settings]
    for count in COUNTS:
        with serving(Path(), "--no-open", "--host", "0.0.0.0", *words) as served:
            yield asyncio.run(_measured(count, served[0].pid, served[1]))


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


async def _measured(count, pid, address):
    await _compiled(pid)
    where = urlsplit(address)
    socket = f"ws://{where.netloc}{where.path}socket"
    players = []
    tasks = []
    for _ in range(count):
        connection = await connect(socket, origin=f"http://{where.netloc}")
        one = Page(connection)
        players.append(one)
        tasks += [asyncio.create_task(act) for act in (one.listen(), one.answer())]
        await asyncio.sleep(APART)
    await asyncio.sleep(2.0)
    begin = time.perf_counter()
    used = _used(pid)
    await asyncio.sleep(WATCHED)
    used = _used(pid) - used
    end = time.perf_counter()
    *others, last = players
    for message in COMMANDS:
        await last.say(**message)
        await asyncio.sleep(WATCHED / len(COMMANDS))
    finished = time.perf_counter()
    memory = Path(f"/proc/{pid}/statm").read_text().split()
    for task in tasks:
        task.cancel()
    states = [one.count(begin, end) for one in players]
    rates = [number / (end - begin) for number in states]
    calm = max(max(one.gaps(begin, end)) for one in players)
    disturbed = max((max(one.gaps(end, finished)) for one in others), default=0.0)
    megabytes = int(memory[_STATM]) * _PAGE / 2**20
    return (
        f"  {count:<34}{min(rates):8.1f} to{max(rates):7.1f}{calm:9.3f}"
        f"{disturbed:16.3f}{megabytes:6.0f}{1e3 * used / sum(states):10.2f}"
    )
