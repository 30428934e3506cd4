"""The pages of a sandbox. A page gets new states as fast as it draws them, so that
they never queue up."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from time import perf_counter

from taichi_disk.runtime import alone
from taichi_disk.window.controls import described
from taichi_disk.window.films import make_film
from taichi_disk.window.look import Look
from taichi_disk.window.session import Session, read_command

MAX_RATE = 60.0  # pictures per second
_MAX_IN_FLIGHT = 2  # states that were sent to a page and not yet drawn
_ANSWERS = ("hand", "keep")  # of the player to visitors who ask to play
Message = str | bytes


class Visitor:
    """One page. `send` sends it a text or a state, `unsent` returns how many bytes
    still wait for the network.

    Attributes:
        look: how the disk is drawn for this visitor, while somebody else plays.
        asks: whether the visitor has asked to play.
        film: the task that makes a film for the visitor, or None.
    """

    def __init__(
        self, send: Callable[[Message], None], unsent: Callable[[], int], look: Look
    ) -> None:
        self.look = look
        self.asks = False
        self.film: asyncio.Task[None] | None = None
        self._send = send
        self._unsent = unsent
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

    def give_film(self, page: str) -> None:
        """Send a film to play with, an HTML page."""
        self._send(json.dumps({"kind": "film", "page": page}))

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
        self.session = session
        self.ignored = 0
        self._all_play = all_play
        self._visitors: list[Visitor] = []
        self._news = asyncio.Event()  # something may have to be sent

    def join(
        self, send: Callable[[Message], None], unsent: Callable[[], int] = int
    ) -> Visitor:
        """Return a new `Visitor`, to whom `run` will send everything."""
        visitor = Visitor(send, unsent, self.session.look)
        self._visitors.append(visitor)
        self._news.set()
        return visitor

    def leave(self, visitor: Visitor) -> None:
        """Send no more. After the player, the first visitor who asked plays, or else
        the next one; after the last visitor, the sandbox pauses."""
        played = self.plays(visitor)
        self._visitors.remove(visitor)
        if visitor.film:
            visitor.film.cancel()
        if not self._visitors:
            self.session.release()
            self.session.pause()
        elif played:
            self._hand_to(self._first_asking() or self._visitors[0])
        self._news.set()

    def plays(self, visitor: Visitor) -> bool:
        """Whether a visitor may change anything."""
        return self._all_play or visitor is self._visitors[0]

    def hear(self, visitor: Visitor, text: Message) -> None:
        """Carry out a page's message, as far as its visitor may; ignore and count
        malformed messages."""
        message = read_command(text)
        if message is None:
            self.ignored += 1
        elif message["do"] == "seen":
            visitor.acknowledge(message["number"])
        elif not self.plays(visitor):
            visitor.look = visitor.look.after(message)
            visitor.asks |= message["do"] == "ask"
        elif message["do"] in _ANSWERS:
            self._answer(message["do"])
        elif message["do"] == "film":
            visitor.film = visitor.film or asyncio.create_task(self._film_for(visitor))
        else:
            self.session.hear(message)
        self._news.set()

    async def _film_for(self, visitor: Visitor) -> None:
        """Make a film of the present scene and send it, or show why there is none."""
        try:
            page = await make_film(self.session.sandbox.scene)
            visitor.give_film(page)
        except Exception as error:
            self.session.tell(described(error))
        finally:
            visitor.film = None
            self._news.set()

    def _answer(self, answer: str) -> None:
        """Let the first visitor who asked play, or tell all of them that they have to
        wait."""
        asking = self._first_asking()
        if asking and answer == "hand":
            self._visitors[0].look = self.session.look
            self._hand_to(asking)
        elif answer == "keep":
            for one in self._visitors:
                one.asks = False

    def _first_asking(self) -> Visitor | None:
        return next((one for one in self._visitors if one.asks), None)

    def _hand_to(self, visitor: Visitor) -> None:
        """Let `visitor` play from now on. The disk is let go of, and the visitor keeps
        the look that it had."""
        self._visitors.remove(visitor)
        self._visitors.insert(0, visitor)
        visitor.asks = False
        self.session.release()
        if not self._all_play:
            for command in visitor.look.commands():
                self.session.hear(command)

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
                is_sent |= one.show(self._messages_for(one), session.number)
            if is_sent:
                await asyncio.sleep(max(0.0, 1.0 / MAX_RATE - (perf_counter() - began)))
            else:
                await self._news.wait()

    def _messages_for(self, visitor: Visitor) -> dict[str, Message]:
        """Return the present message of each kind, the state as the last one."""
        plays = self.plays(visitor)
        look = self.session.look if plays else visitor.look
        role = {
            "kind": "role",
            "plays": plays,
            "asks": visitor.asks,
            "asking": sum(one.asks for one in self._visitors),
            "awaitsFilm": visitor.film is not None,
        }
        messages = dict(self.session.messages(look))
        state = messages.pop("state")
        return {**messages, "role": json.dumps(role), "state": state}
