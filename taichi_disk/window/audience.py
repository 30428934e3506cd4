"""The visitors of a sandbox: each page gets states as fast as it draws them, and never a queue."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from time import perf_counter

from taichi_disk.runtime import alone
from taichi_disk.window.commands import understood
from taichi_disk.window.session import Session

MAX_RATE = 60.0  # pictures per second
_MAX_IN_FLIGHT = 2  # states that were sent to a page and not yet drawn
Send = Callable[[str | bytes], Awaitable[None]]


class Visitor:
    """One page. `send` sends it a text or a state."""

    def __init__(self, send: Send) -> None:
        self.news = asyncio.Event()  # something may have to be sent
        self.plays: bool | None = None  # as the page was told
        self.number = 0  # of the last state that was sent
        self.feeding: asyncio.Task[None] | None = None
        self._send = send
        self._in_flight: list[int] = []  # numbers of states
        self._texts: dict[str, str] = {}

    def acknowledge(self, number: float) -> None:
        """Note that the page has drawn a state."""
        self._in_flight = [one for one in self._in_flight if one > number]
        self.news.set()

    @property
    def keeps_up(self) -> bool:
        """Whether the page may be sent another state."""
        return len(self._in_flight) < _MAX_IN_FLIGHT

    async def show(self, session: Session, plays: bool) -> None:
        """Send the texts that have changed for the page, and the last state."""
        state, self.number, self.plays = session.state, session.number, plays
        self._in_flight.append(session.number)
        for kind, text in (session.texts | {"role": json.dumps({"kind": "role", "plays": plays})}).items():
            if self._texts.get(kind) != text:
                self._texts[kind] = text
                await self._send(text)
        await self._send(state)


class Audience:
    """The visitors of `session`: the first one plays and the others watch, or all of them play.

    Attributes:
        ignored: number of malformed messages.
    """

    def __init__(self, session: Session, all_play: bool = False) -> None:
        self.session, self.ignored, self._all_play = session, 0, all_play
        self._visitors: list[Visitor] = []

    def join(self, visitor: Visitor) -> None:
        """Begin to send; within a running event loop."""
        self._visitors.append(visitor)
        visitor.feeding = asyncio.create_task(self._feed(visitor))

    def leave(self, visitor: Visitor) -> None:
        """Send no more. After the player, the next visitor plays; after the last visitor, the sandbox pauses."""
        played = self.plays(visitor)
        self._visitors.remove(visitor)
        if visitor.feeding:
            visitor.feeding.cancel()
        if played:
            self.session.let_go(pause=not self._visitors)
        self._tell()

    def plays(self, visitor: Visitor) -> bool:
        """Whether a visitor may change anything."""
        return self._all_play or visitor is self._visitors[0]

    def hear(self, visitor: Visitor, text: str | bytes) -> None:
        """Carry out a page's message if its visitor plays; ignore and count malformed messages."""
        message = understood(text)
        if message is None:
            self.ignored += 1
        elif message["do"] == "seen":
            visitor.acknowledge(message["number"])
        elif self.plays(visitor):
            self.session.hear(message)
            visitor.news.set()

    @property
    def failure(self) -> BaseException | None:
        """The error of this program that has ended the feeding of a present visitor."""
        ended = [one.feeding for one in self._visitors if one.feeding and one.feeding.done()]
        return ended[0].exception() if ended else None

    def _tell(self) -> None:
        for one in self._visitors:
            one.news.set()

    async def _feed(self, visitor: Visitor) -> None:
        """Send states for as long as the page draws them; the page of the player is the sandbox's clock."""
        session = self.session
        while True:
            began, plays = perf_counter(), self.plays(visitor)
            visitor.news.clear()
            if visitor.keeps_up and plays and session.is_busy:
                with alone():  # another thread may compute
                    session.advance()
                self._tell()
            if visitor.keeps_up and (visitor.number < session.number or visitor.plays is not plays):
                await visitor.show(session, plays)
                await asyncio.sleep(max(0.0, 1.0 / MAX_RATE - (perf_counter() - began)))
            else:
                await visitor.news.wait()
