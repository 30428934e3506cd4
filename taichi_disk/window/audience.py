"""The pages of a sandbox: each gets states as fast as it draws them, and never a
queue."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from time import perf_counter

from taichi_disk.runtime import alone
from taichi_disk.window.session import Session, read_command

MAX_RATE = 60.0  # pictures per second
_MAX_IN_FLIGHT = 2  # states that were sent to a page and not yet drawn
Message = str | bytes


class Visitor:
    """One page. `send` sends it a text or a state, `unsent` returns how many bytes
    still wait for the network."""

    def __init__(
        self, send: Callable[[Message], None], unsent: Callable[[], int]
    ) -> None:
        self._send, self._unsent = send, unsent
        self._in_flight: list[int] = []  # numbers of states
        self._messages: dict[str, Message] = {}  # the last message of each kind

    @property
    def is_ready(self) -> bool:
        """Whether the page may be sent another state. A page may say that it has drawn
        states, and never read."""
        return len(self._in_flight) < _MAX_IN_FLIGHT and not self._unsent()

    def acknowledge(self, number: float) -> None:
        """Note that the page has drawn the state with this number."""
        self._in_flight = [one for one in self._in_flight if one > number]

    def show(self, messages: dict[str, Message], number: int) -> bool:
        """Send those of `messages` (by kind) that the page does not have yet; return
        whether there were any.

        `number`: number of the state.
        """
        news = {
            kind: message
            for kind, message in messages.items()
            if self._messages.get(kind) != message
        }
        self._messages |= news
        if "state" in news:
            self._in_flight.append(number)
        for message in news.values():
            self._send(message)
        return bool(news)


class Audience:
    """The visitors of `session`: the first one plays and the others watch, or all of
    them play.

    Attributes:
        ignored: number of malformed messages.
    """

    def __init__(self, session: Session, all_play: bool = False) -> None:
        self.session, self.ignored, self._all_play = session, 0, all_play
        self._visitors: list[Visitor] = []
        self._news = asyncio.Event()  # something may have to be sent

    def join(
        self, send: Callable[[Message], None], unsent: Callable[[], int] = int
    ) -> Visitor:
        """Return a new `Visitor`, to whom `run` will send everything."""
        self._visitors.append(visitor := Visitor(send, unsent))
        self._news.set()
        return visitor

    def leave(self, visitor: Visitor) -> None:
        """Send no more. After the player, the next visitor plays; after the last
        visitor, the sandbox pauses."""
        played = self.plays(visitor)
        self._visitors.remove(visitor)
        if played:
            self.session.release(pause=not self._visitors)
        self._news.set()

    def plays(self, visitor: Visitor) -> bool:
        """Whether a visitor may change anything."""
        return self._all_play or visitor is self._visitors[0]

    def hear(self, visitor: Visitor, text: Message) -> None:
        """Carry out a page's message if its visitor plays; ignore and count malformed
        messages."""
        message = read_command(text)
        if message is None:
            self.ignored += 1
        elif message["do"] == "seen":
            visitor.acknowledge(message["number"])
        elif self.plays(visitor):
            self.session.hear(message)
        self._news.set()

    async def run(self) -> None:
        """Send states as fast as pages draw them; the pages of visitors who play set
        the sandbox's clock."""
        session = self.session
        while True:
            began = perf_counter()
            self._news.clear()
            ready = [one for one in self._visitors if one.is_ready]
            if session.is_busy and any(map(self.plays, ready)):
                with alone():  # another thread may compute
                    session.advance()
            is_sent = False
            for one in ready:
                role = json.dumps({"kind": "role", "plays": self.plays(one)})
                is_sent |= one.show(
                    {**session.texts, "role": role, "state": session.state},
                    session.number,
                )
            if is_sent:
                await asyncio.sleep(max(0.0, 1.0 / MAX_RATE - (perf_counter() - began)))
            else:
                await self._news.wait()
