"""The sandbox as a page in a browser: one server, one sandbox, which the first page leads and others watch.

rendercanvas serves pictures and takes events; here is what it leaves to others: who may come, what may be said, files.
"""

from __future__ import annotations

import json
import logging
import re
import secrets
import socket
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from time import time
from typing import Any

from taichi_disk.errors import TaichiDiskError, pip_install
from taichi_disk.simulation.simulation import KernelCache
from taichi_disk.window.canvas import SessionCanvas
from taichi_disk.window.controls import Entry
from taichi_disk.window.session import Session

LOCAL = ("127.0.0.1", "localhost")
FASTEST = 60  # pictures per second at most
_LISTED = 4  # files that a page offers
_FILE = re.compile(r"view-\d+\.(yaml|mp4|png)")
# What a page says with the numbers that are needed of it, and what they stay below; what it says that nobody needs.
_SAID = "resize pwidth pheight ratio, pointer_down x y button, pointer_move x y, pointer_up x y, wheel x y dx dy, "
_SAID += "key_down, key_up, _framefeedback index timestamp"
_NUMBERS = {kind: names for kind, *names in map(str.split, _SAID.split(", "))}
_FAR, _WIDEST = 1e5, 8192.0
_UNUSED = ("show", "hide", "focus_in", "focus_out", "pointer_enter", "pointer_leave", "double_click", "char")
Receive = Callable[[], Awaitable[dict[str, Any]]]
Send = Callable[[dict[str, Any]], Awaitable[None]]


def serve(playlist: list[Entry], out: Path, host: str = LOCAL[0], port: int = 0) -> None:
    """Serve the sandbox until Ctrl-C, or until somebody presses q; files go into `out`. A `port` of 0: a free one.

    Prints the address, with the token that every request needs. Raises TaichiDiskError where nothing can be served,
    KeyboardInterrupt after Ctrl-C.
    """
    try:
        import uvicorn
        from rendercanvas import http
    except ImportError as error:
        text = f"{pip_install('taichi-disk[browser]')}; or give a display: `ssh -X`, `xvfb-run taichi-disk view`"
        raise TaichiDiskError(f"no page in a browser, because of {error}: {text}") from None
    session = Session(playlist, out, KernelCache())
    try:
        listening = socket.create_server((host, port))
    except (OSError, OverflowError) as error:
        raise TaichiDiskError(f"cannot listen at {host}, port {port}: {error}; choose another --port") from None
    page = Page(http.asgi, session, secrets.token_urlsafe(16))
    http.resources["index.html"] = "text/html; charset=utf-8", Path(__file__).with_name("page.html").read_text("utf-8")
    options: dict[str, Any] = {"log_config": None, "log_level": "critical", "lifespan": "on", "server_header": False}
    server = uvicorn.Server(uvicorn.Config(page, ws_max_size=2**16, timeout_graceful_shutdown=1, **options))
    watch = _Watch(server)
    logger = logging.getLogger("rendercanvas")
    logger.handlers, logger.propagate = [watch], False
    canvas = http.HttpRenderCanvas(size=None, title=None, max_fps=FASTEST)
    shown = SessionCanvas(canvas, session)
    canvas.add_event_handler(watch.end, "close")
    number = listening.getsockname()[1]
    name = socket.gethostname() if host == "0.0.0.0" else host
    print(f"the sandbox is at http://{name}:{number}/{page.token}/\nCtrl-C ends it; files go into {out}", flush=True)
    if host not in LOCAL:
        print("note: whoever has this address and reaches this machine can play, and nothing is encrypted", flush=True)
    server.run(sockets=[listening])
    shown.end()
    if page.ignored:
        print(f"note: {page.ignored} messages that no page sends were ignored", file=sys.stderr)
    if watch.failure:
        raise watch.failure
    if not session.controls.closing:
        raise KeyboardInterrupt


class _Watch(logging.Handler):
    """Ends the server with its canvas, and where drawing or an event has failed, which rendercanvas only logs."""

    def __init__(self, server: Any) -> None:
        super().__init__()
        self._server = server
        self.failure: BaseException | None = None

    def end(self, event: Any) -> None:
        self._server.should_exit = True

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info and not self.failure:
            self.failure = record.exc_info[1]
            self.end(None)


class Page:
    """The application (ASGI) around that of rendercanvas.

    Attributes:
        token: the first part of every path: without it there is nothing to be had.
        ignored: messages that no page of ours sends.
    """

    def __init__(self, asgi: Any, session: Session, token: str) -> None:
        self._asgi, self._session, self.token, self.ignored = asgi, session, token, 0
        self._began = time()

    async def __call__(self, scope: dict[str, Any], receive: Receive, send: Send) -> None:
        kind = scope["type"]
        if kind == "lifespan":
            await self._asgi(scope, receive, send)
            return
        _, token, *rest = scope["path"].split("/", 2)
        headers = dict(scope["headers"])
        allowed = secrets.compare_digest(token.encode(), self.token.encode())
        if kind == "websocket":
            # Another site's script can open one here, but not say that it comes from here.
            origin = headers.get(b"origin", b"").partition(b"://")[2]
            if allowed and origin and origin == headers.get(b"host"):
                await self._asgi(scope, self._checked(receive), send)
                self._session.let_go(pause=not self._asgi.get_count())
            else:
                await send({"type": "websocket.close", "code": 1008})
        elif not allowed:
            await _answer(send, 403, "text/plain", b"The address printed by taichi-disk view has a token: use that.")
        elif not rest:
            await _answer(send, 307, "text/plain", b"", (b"location", f"/{token}/".encode()))
        elif rest[0] == "files":
            await _answer(send, 200, "text/html", self._links().encode())
        elif _FILE.fullmatch(rest[0]) and (path := self._session.controls.out / rest[0]).is_file():
            attached = (b"content-disposition", f"attachment; filename={path.name}".encode())
            await _answer(send, 200, "application/octet-stream", path.read_bytes(), attached)
        else:
            await self._asgi(scope, receive, send)

    def _links(self) -> str:
        """To the last files that were written here."""
        files = [path for path in self._session.controls.out.glob("view-*") if _FILE.fullmatch(path.name)]
        times = sorted((path.stat().st_mtime, path.name) for path in files)
        names = [name for written, name in times[-_LISTED:] if written >= self._began]
        return "".join(f'<a href="{name}" download>{name}</a>' for name in reversed(names))

    def _checked(self, receive: Receive) -> Receive:
        """What rendercanvas is given of what a page sends."""

        async def checked() -> dict[str, Any]:
            while True:
                event = await receive()
                if event["type"] != "websocket.receive":
                    return event
                message = understood(event.get("text"))
                if message is None:
                    self.ignored += 1
                elif message["type"] == "focus_out":  # its keys go up without a word
                    self._session.repeats.clear()
                elif message["type"] in _NUMBERS:
                    return {"type": "websocket.receive", "text": json.dumps(message)}

        return checked


def understood(text: Any) -> dict[str, Any] | None:
    """What is needed of a page's message; None if no page of ours sends it."""
    try:
        given = json.loads(text)
        kind = given["type"]
        if kind in _UNUSED:
            return {"type": kind}
        message = {"type": kind, "timestamp": 0.0} | {name: float(given[name]) for name in _NUMBERS[kind]}
        if not all(abs(message.get(name, 0.0)) < _FAR for name in ("x", "y", "dx", "dy")):
            return None
        if not all(0.1 <= message.get(name, 1.0) < _WIDEST for name in ("pwidth", "pheight", "ratio")):
            return None
        if kind.startswith("key"):
            message |= {"key": str(given["key"]), "modifiers": [str(one) for one in given["modifiers"]]}
        return message
    except (ValueError, TypeError, KeyError, OverflowError, RecursionError):
        return None


async def _answer(send: Send, status: int, kind: str, body: bytes, *headers: tuple[bytes, bytes]) -> None:
    headers += (b"content-type", kind.encode()), (b"cache-control", b"no-store")
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": body})
