"""The pages of the sandbox and their sessions, which one loop serves in turn. A page
gets new states as fast as it draws them, so that they never queue up."""

from __future__ import annotations

import asyncio
import json
import secrets
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from math import inf
from time import perf_counter, thread_time
from typing import Any

from taichi_disk.runtime import alone
from taichi_disk.scenes import Scene
from taichi_disk.window.controls import described, with_own_seed
from taichi_disk.window.films import make_film
from taichi_disk.window.history import Start, Timeline, start_of
from taichi_disk.window.sandbox import MAX_COMPUTING_TIME
from taichi_disk.window.session import Common, Session, read_command

MAX_RATE = 60.0  # pictures per second
MAX_SEATS = 40
KEEP_TIME = 600.0  # for which a session waits for its page [s]
# least time of computing between two pictures [s]
MIN_COMPUTING_TIME = 0.002
QUIET_TIME = 2.0  # without a command, after which nobody seems to play [s]
SWEEP_TIME = 60.0  # after which sessions that nobody wants are forgotten [s]
MAX_PAUSE = 0.25  # between two pictures of a session that takes long [s]
MAX_PARTS = 2.0  # most that a session may take of the time, in equal parts
# fraction of a picture's time that the next pause pays for; later pauses pay the rest,
# because a new start takes ten times longer than other pictures
CHARGED = 0.1
_MAX_IN_FLIGHT = 2  # states that were sent to a page and not yet drawn
Message = str | bytes


class Full(Exception):
    """There is no room for another session; the text is for the user, and has less than
    123 bytes, so that a websocket can close with it."""


class Page:
    """One page, or one view of a notebook's widget. `send` sends it a text or a state,
    `unsent` returns how many bytes still wait for the network.

    Attributes:
        seat: where its session is kept.
        film: the task that makes a film for the page, or None.
    """

    def __init__(
        self, seat: Seat, send: Callable[[Message], None], unsent: Callable[[], int]
    ) -> None:
        self.seat = seat
        self.film: asyncio.Task[None] | None = None
        self._send = send
        self._unsent = unsent
        self._in_flight: list[int] = []  # numbers of states
        self._messages: dict[str, Message] = {}  # the last message of each kind
        self._board: list[dict[str, Any]] = []  # the class's, and rows that it has
        self._on_board = 0

    @property
    def is_ready(self) -> bool:
        """Whether the page may be sent another state. A page may say that it has drawn
        states, and never read."""
        return len(self._in_flight) < _MAX_IN_FLIGHT and not self._unsent()

    def acknowledge(self, number: float) -> None:
        """Note that the page has drawn the state with this number."""
        self._in_flight = [one for one in self._in_flight if one > number]

    def tell(self, kind: str, **content: Any) -> None:
        """Send a message that is told once."""
        self._send(json.dumps({"kind": kind} | content))

    def show(self, board: list[dict[str, Any]]) -> bool:
        """Send what the page does not have yet: messages of its session, the state as
        the last one, and rows of the class's board; return whether there was any."""
        session = self.seat.session
        own = {
            "kind": "session",
            "key": self.seat.key,
            "disk": session.disk,
            "name": session.name,
            "awaitsFilm": self.film is not None,
        }
        messages: dict[str, Message] = {"session": json.dumps(own), **session.messages}
        news = {
            kind: message
            for kind, message in messages.items()
            if self._messages.get(kind) != message
        }
        self._messages |= news
        if "state" in news:
            self._in_flight.append(session.number)
        for message in news.values():
            self._send(message)
        if board is not self._board:
            self._board = board
            self._on_board = -1  # it has been emptied
        first = max(self._on_board, 0)
        is_news = len(board) > self._on_board
        if is_news:
            self.tell("board", first=first, rows=board[first:])
            self._on_board = len(board)
        return bool(news) or is_news


class Seat:
    """A session with its pages.

    Attributes:
        key: with which a page finds its session again.
        pages: usually one.
        left: when the last page left [s].
        due: when the session may be served again [s]; inf if its pages have all.
        cost: processor time of its last pictures, on average [s].
    """

    def __init__(self, key: str, session: Session) -> None:
        self.key = key
        self.session = session
        self.pages: list[Page] = []
        self.left = perf_counter()
        self.due = 0.0
        self.cost = 0.0

    def wake(self) -> None:
        """Note that there may be something to send."""
        if self.due == inf:
            self.due = perf_counter()

    @property
    def is_ready(self) -> bool:
        """Whether a page may be sent another state."""
        return any(page.is_ready for page in self.pages)


class Audience:
    """All pages with their sessions.

    Attributes:
        seats: by their keys.
        ignored: number of malformed messages.
    """

    def __init__(
        self, common: Common, keep_time: float = KEEP_TIME, max_seats: int = MAX_SEATS
    ) -> None:
        """`keep_time`: for which a session waits for its page [s]. Raises
        TaichiDiskError if the first scene cannot be built."""
        self._max_seats = max_seats
        self.seats: dict[str, Seat] = {}
        self.ignored = 0
        self._common = common
        self._keep_time = keep_time
        self._sessions = 0  # made so far
        self._prepared = 0  # whose lattices are known
        self._heard = -inf  # when a page last sent a command [s]
        # Lattices need no Taichi, so another thread builds them, one after the other.
        self._builder = ThreadPoolExecutor(1, "builder")
        self._first: Session | None = self._new_session()  # compiles the kernels
        self._news = asyncio.Event()  # something may have to be sent
        self._film_maker = asyncio.Semaphore(1)  # a film takes a process

    # ---- sessions

    def _new_session(self) -> Session:
        self._sessions += 1
        with alone():
            return Session(self._common, self._sessions, self._builder)

    def seat(self, key: str = "") -> Seat:
        """Return the seat with this key, or a new one. Raises Full."""
        if key in self.seats:
            return self.seats[key]
        self._drop(perf_counter() - self._keep_time)
        if len(self.seats) >= self._max_seats:
            self._drop_oldest()
        session = self._first or self._new_session()
        self._first = None
        seat = Seat(secrets.token_urlsafe(16), session)
        self.seats[seat.key] = seat
        self._common.memory.sharers = len(self.seats)
        return seat

    async def prepare(self, key: str) -> None:
        """Build the lattice of the next session, unless there is one with this key."""
        if key in self.seats:
            return
        self._prepared = max(self._prepared, self._sessions) + 1
        await self._start_of(with_own_seed(self._common.first, self._prepared))

    async def _start_of(self, scene: Scene) -> Start:
        return await asyncio.wrap_future(self._builder.submit(start_of, scene))

    async def compile(self) -> None:
        """Compile kernels while nobody plays, so that later nobody waits when somebody
        chooses a scene."""
        for scene in self._common.kinds():
            start = await self._start_of(scene)
            while self._is_played():
                await asyncio.sleep(QUIET_TIME)
            with alone():
                Timeline(start, self._common.kernels, self._common.memory)
            await asyncio.sleep(0)  # for the pages

    def _is_played(self) -> bool:
        is_moved = any(not one.session.sandbox.paused for one in self.seats.values())
        return is_moved or perf_counter() < self._heard + QUIET_TIME

    def _drop(self, until: float) -> None:
        """Forget the sessions that have had no page since `until` [s]."""
        self.seats = {
            key: seat
            for key, seat in self.seats.items()
            if seat.pages or seat.left > until
        }
        self._common.memory.sharers = max(1, len(self.seats))

    def _drop_oldest(self) -> None:
        """Forget the session that has been without a page for the longest time. Raises
        Full if all have one."""
        waiting = [seat for seat in self.seats.values() if not seat.pages]
        if not waiting:
            raise Full(
                f"All {self._max_seats} disks are in use. As soon as somebody leaves,"
                " you can play; `view --disks` allows more."
            )
        del self.seats[min(waiting, key=lambda seat: seat.left).key]

    # ---- pages

    def join(
        self,
        send: Callable[[Message], None],
        unsent: Callable[[], int] = int,
        key: str = "",
    ) -> Page:
        """Return a new `Page`, to which `run` will send everything; `key`: of the
        session that it had, if any. Raises Full."""
        seat = self.seat(key)
        page = Page(seat, send, unsent)
        seat.pages.append(page)
        self._wake(seat)
        return page

    def leave(self, page: Page) -> None:
        """Send no more. After its last page a session pauses."""
        seat = page.seat
        seat.pages.remove(page)
        if page.film:
            page.film.cancel()
        if not seat.pages:
            seat.left = perf_counter()
            seat.session.release()
            seat.session.pause()

    def hear(self, page: Page, text: Message) -> None:
        """Carry out a page's message; ignore and count malformed messages."""
        message = read_command(text)
        if message is None:
            self.ignored += 1
        elif message["do"] == "seen":
            page.acknowledge(message["number"])
        elif message["do"] == "alive":
            page.tell("alive")  # it has heard nothing for a while
        elif message["do"] == "film":
            page.film = page.film or asyncio.create_task(self._film_for(page))
        else:
            page.seat.session.hear(message)
            self._heard = perf_counter()
        self._wake(page.seat)

    def _wake(self, seat: Seat) -> None:
        seat.wake()
        self._news.set()

    async def _film_for(self, page: Page) -> None:
        """Make a film of the present scene and send it, or show why there is none."""
        session = page.seat.session
        scene = session.sandbox.scene
        try:
            async with self._film_maker:
                film = await make_film(scene)
            page.tell("film", page=film)
        except Exception as error:
            # a page that has left cancels its film, which may end in another error
            if page in page.seat.pages:
                session.tell(described(error))
        finally:
            page.film = None
            self._wake(page.seat)

    # ---- the loop

    async def run(self) -> None:
        """Send states as fast as pages draw them, first to the session that has waited
        longest; the pages of a session set its clock."""
        swept = perf_counter()
        while True:
            self._news.clear()
            now = perf_counter()
            if now > swept + SWEEP_TIME:
                swept = now
                self._drop(now - self._keep_time)
            waiting = [seat for seat in self.seats.values() if seat.due < inf]
            waiting.sort(key=lambda seat: seat.due)
            following = next((seat for seat in waiting if seat.is_ready), None)
            due = following.due if following else inf
            if following and due <= now:
                self._serve(following, len(waiting))
                await asyncio.sleep(0)  # for the network
            else:
                await self._wait(min(due - now, SWEEP_TIME))

    async def _wait(self, seconds: float) -> None:
        """Wait for news, at most `seconds`."""
        with suppress(asyncio.TimeoutError):
            await asyncio.wait_for(self._news.wait(), seconds)

    def _serve(self, seat: Seat, sharers: int) -> None:
        """Send the next picture of a session to its pages that are ready.

        `sharers`: number of sessions that want a picture.
        """
        began = perf_counter()
        used = thread_time()  # other programs do not count
        session = seat.session
        board = self._common.board
        rows = len(board)
        if session.is_busy:
            part = max(MAX_COMPUTING_TIME / sharers, MIN_COMPUTING_TIME)
            with alone():  # another thread may compute
                session.advance(part)
        sent = [page.show(self._common.board) for page in seat.pages if page.is_ready]
        seat.due = inf
        if any(sent):
            spent = thread_time() - used
            seat.cost += CHARGED * (spent - seat.cost)
            pause = min(seat.cost * sharers / MAX_PARTS, MAX_PAUSE)
            seat.due = began + max(1.0 / MAX_RATE, pause)
        if self._common.board is not board or len(board) > rows:
            for one in self.seats.values():
                one.wake()
