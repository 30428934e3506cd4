"""A page of the sandbox. It gets new states as fast as it draws them, so that they
never queue up."""

from __future__ import annotations

import asyncio
import json
from collections import deque
from collections.abc import Callable
from time import perf_counter

from taichi_disk.sandbox.controls import described
from taichi_disk.sandbox.films import make_film
from taichi_disk.sandbox.session import Session, read_command

Message = str | bytes
MAX_RATE = 60.0  # pictures per second


class Page:
    """A page that shows a session from now on until it leaves. A session may have
    several, if a tab was duplicated."""

    def __init__(self, session: Session, send: Callable[[Message], None]) -> None:
        """`send` sends a text or a state to the page."""
        self._session = session
        self._send = send
        # numbers of the last two states that were sent, and of the last that was drawn
        self._sent = deque([0, 0], 2)
        self._seen = 0.0
        self._shown: dict[str, Message] = {}  # the last message of each kind
        self._film: asyncio.Task[None] | None = None
        # the page may have been lost while its user pulled the disk
        session.hear({"do": "release"})
        self._playing = asyncio.create_task(self._play())

    def leave(self) -> None:
        """Send no more."""
        self._playing.cancel()
        if self._film:
            self._film.cancel()

    def hear(self, text: Message) -> None:
        """Carry out a message of the page; ignore what no page sends."""
        message = read_command(text)
        if message is None:
            return
        if message["do"] == "seen":
            self._seen = min(message["number"], self._session.number)
        elif message["do"] == "alive":
            # it has heard nothing for a while
            self._send(json.dumps({"kind": "alive"}))
        elif message["do"] == "film":
            self._film = self._film or asyncio.create_task(self._save_film())
        else:
            self._session.hear(message)
        self._session.news.set()

    async def _play(self) -> None:
        """Let the session go on as long as the page draws."""
        news = self._session.news
        while True:
            began = perf_counter()
            news.clear()
            if self._seen >= self._sent[0] and self._show():
                await asyncio.sleep(max(began + 1.0 / MAX_RATE - perf_counter(), 0.0))
            else:
                await news.wait()

    def _show(self) -> bool:
        """Let the session go on, and send the messages that the page does not have yet,
        the state as the last; return whether there are any."""
        session = self._session
        if session.is_busy:
            session.advance()
        news = {
            kind: message
            for kind, message in session.messages.items()
            if self._shown.get(kind) != message
        }
        self._shown |= news
        if "state" in news:
            self._sent.append(session.number)
        for message in news.values():
            self._send(message)
        return bool(news)

    async def _save_film(self) -> None:
        """Make a film of the present scene and send it, or show why there is none."""
        film = ""
        try:
            film = await make_film(self._session.sandbox.scene)
        except Exception as error:
            if self._playing.cancelled():
                return  # the page has left; to stop a film may end in an error
            self._session.tell(described(error))
        self._film = None
        self._send(json.dumps({"kind": "film", "page": film}))
